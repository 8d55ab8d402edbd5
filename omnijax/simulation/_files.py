"""Trajectories in files: NetCDF with everything, or CSV and Parquet that are recordings."""

import importlib.metadata
from pathlib import Path
from typing import Any, TypeVar

import jax.numpy as jnp
import numpy as np

from .. import __version__
from .._errors import InputError
from .._netcdf import load_netcdf, netcdf_attributes, write_netcdf
from .._status import Status
from ..recording import Recording, write_recording
from ..recording import channels as channel_names
from ..rig import Rig, rig_text
from ._run import PER_WHEEL, AbstractRun, Between
from ._sensors import GROUPS, measured

Run = TypeVar("Run", bound=AbstractRun)
SUFFIXES = (".nc", ".csv", ".csv.gz", ".parquet")
BETWEEN = "between_"  # of the names of what a run knows between its samples
_AXES = {"axis": ["x", "y", "z"], "quaternion": ["w", "x", "y", "z"]}


def save_trajectory(
    trajectory: AbstractRun,
    path: str | Path,
    rig: Rig | None = None,
    rig_path: str | Path | None = None,
    command: str = "",
    asked: str = "",
) -> Path:
    """Write a run.  `.nc` keeps every channel, unit and the rig; the others are recordings.

    `.csv`, `.csv.gz` and `.parquet` hold the inputs and what the sensors of `rig` read, with
    NAME.toml beside them; rows after a failure are left out.  `asked` says as JSON all that decides
    the numbers (`asked_in`; `.nc` only).
    """
    path = Path(path)
    kind = check_suffix(path)
    if kind != ".nc":
        return write_recording(path, to_recording(trajectory, path, rig, rig_path))
    data = to_xarray(trajectory, rig, command)
    if asked:
        data.attrs["asked"] = asked
    return write_netcdf(data, path)  # zlib saves a fifth and costs three times the time


def check_suffix(path: Path) -> str:
    """The kind of a run's file; `InputError` for another one."""
    for suffix in SUFFIXES:
        if path.name.lower().endswith(suffix):
            return suffix
    raise InputError(f"`{path.name}` must end in one of {', '.join(SUFFIXES)}.")


def read_run(path: str | Path, kind: type[Run]) -> Run:
    """The run in a `.nc` file, as a `kind` of run; `InputError` for another file."""
    path = Path(path)
    if check_suffix(path) != ".nc":
        raise InputError(
            f"{path.name} is a recording, not a run: runs are the .nc files of "
            "`omnijax simulate --out` (in Python, `omnijax.read_recording` reads recordings)."
        )
    data = load_netcdf(path, "a run of omnijax")
    try:
        return _from_dataset(data, kind)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"is not a run of omnijax: {error}.", path) from None


def asked_in(path: str | Path) -> str:
    """What decides the numbers of a run in a `.nc` file, as JSON; empty where it does not say."""
    path = Path(path)
    if check_suffix(path) != ".nc":
        return ""
    return str(netcdf_attributes(path, "a run of omnijax").get("asked", ""))


def to_xarray(trajectory: AbstractRun, rig: Rig | None = None, command: str = "") -> Any:
    """The run as an `xarray.Dataset`: every channel with its unit; rig, versions and status aside.

    Where `rig` has sensors' laws, `measured_dR` and so on stand beside the true values.
    """
    import xarray

    names = list(trajectory.names)
    variables = {
        name: (_dims(name), np.asarray(value), _unit(name))
        for name, value in _channels(trajectory).items()
        if name != "t"
    }
    if rig is not None and rig.at("sensor"):
        for group, value in measured(trajectory, rig).items():
            variables[f"measured_{group}"] = (_dims(group), np.asarray(value), _unit(group))
    time = ("t", np.asarray(trajectory.t), {"units": "s", "long_name": "time"})
    return xarray.Dataset(
        variables,
        coords={"t": time, "wheel": names, **_AXES},
        attrs=_attributes(trajectory, rig, command),
    )


def to_recording(
    trajectory: AbstractRun,
    path: str | Path = "run.csv",
    rig: Rig | None = None,
    rig_path: str | Path | None = None,
) -> Recording:
    """The run as a noise-free recording, as far as it got."""
    readings = (
        {g: getattr(trajectory, g) for g in GROUPS} if rig is None else measured(trajectory, rig)
    )
    table = {"torque": trajectory.torque, "force": trajectory.force, **readings}
    good = np.isfinite(np.asarray(trajectory.dR)).all(axis=1)
    wheels = len(trajectory.names)
    columns = {}
    for group, values in table.items():
        for i, column in enumerate(channel_names(group, wheels)):
            columns[column] = np.array(values[:, i])[good]
    path = Path(path)
    where = None if rig_path is None else Path(rig_path)
    exact = {group: 0.0 for group in GROUPS}  # what a simulation says has no noise
    time = np.array(trajectory.t)[good]
    return Recording(path.name.split(".")[0], path, time, columns, wheels, "train", exact, where)


def _channels(trajectory: AbstractRun) -> dict[str, Any]:
    """Fields that hold numbers in time, at the samples and between them."""
    channels = {name: getattr(trajectory, name) for name in trajectory.UNITS}
    if trajectory.between is not None:
        channels |= {f"{BETWEEN}{g}": x for g, x in trajectory.between._asdict().items()}
    return channels


def _unit(name: str) -> dict[str, str]:
    return {"units": AbstractRun.UNITS[name.removeprefix(BETWEEN)]}


def _dims(name: str) -> tuple[str, ...]:
    """The dimensions of a channel."""
    channel = name.removeprefix(BETWEEN)
    time = "t" if channel == name else f"{BETWEEN}t"
    if channel == "t":
        return (time,)
    if channel == "attitude":
        return (time, "quaternion")
    return (time, "wheel" if channel in PER_WHEEL else "axis")


def _attributes(trajectory: AbstractRun, rig: Rig | None, command: str) -> dict[str, Any]:
    code = int(trajectory.status)
    versions = [f"omnijax {__version__}"]
    versions += [f"{p} {importlib.metadata.version(p)}" for p in ("jax", "diffrax", "numpy")]
    return {
        "title": "a run of a sphere on omnidirectional wheels",
        "status": Status(code).text,
        "status_code": code,
        "message": trajectory.message(),
        "steps": int(trajectory.steps),
        "method": trajectory.method,
        "rig": "" if rig is None else rig_text(rig),
        "command": command,
        "versions": ", ".join(versions),
    }


def _from_dataset(data: Any, kind: type[Run]) -> Run:
    arrays = {n: jnp.asarray(data[n].values) for n in kind.UNITS if n in data.variables}
    seen = [f"{BETWEEN}{field}" for field in Between._fields]
    known = all(name in data.variables for name in seen)
    return kind(
        **arrays,
        between=Between(*(jnp.asarray(data[n].values) for n in seen)) if known else None,
        status=jnp.asarray(int(Status.of(data.attrs["status"])), int),
        steps=jnp.asarray(data.attrs["steps"], int),
        method=str(data.attrs["method"]),
        names=tuple(str(name) for name in data["wheel"].values),
    )
