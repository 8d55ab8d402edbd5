"""Drives as plain numbers and back, and the quantities of a drive that a study may vary."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ..._errors import InputError
from ...rig import Rig, put_parameter
from ...simulation import Signal, SpeedDrive, TorqueDrive, drive_for, is_constant

Drive = SpeedDrive | TorqueDrive
_OPTIONAL = ("initial_angle", "initial_velocity")


def drive_to_plain(drive: Drive) -> dict[str, Any]:
    """The drive as nested dictionaries of numbers."""
    tables: dict[str, Any] = {"kind": kind_of(drive)}
    for name in (kind_of(drive), "force"):
        signal = getattr(drive, name)
        parts = {"knots": signal.knots, "values": signal.values, "slopes": signal.slopes}
        tables[name] = {key: np.asarray(part).tolist() for key, part in parts.items()}
    for name in _OPTIONAL:
        value = getattr(drive, name, None)
        if value is not None:
            tables[name] = np.asarray(value).tolist()
    return tables


def drive_from_plain(tables: dict[str, Any]) -> Drive:
    """The drive that `drive_to_plain` described."""

    def signal(name):
        return Signal(*(jnp.asarray(tables[name][k], float) for k in ("knots", "values", "slopes")))

    rest = {name: jnp.asarray(tables[name], float) for name in _OPTIONAL if name in tables}
    if tables["kind"] == "speed":
        return SpeedDrive(speed=signal("speed"), force=signal("force"), **rest)
    return TorqueDrive(torque=signal("torque"), force=signal("force"), **rest)


def kind_of(drive: Drive) -> str:
    """`speed` or `torque`."""
    return "speed" if isinstance(drive, SpeedDrive) else "torque"


def turning(drive: Drive) -> Signal:
    """The signal of the wheels: speeds or torques."""
    return drive.speed if isinstance(drive, SpeedDrive) else drive.torque


def with_few_knots(drive: Drive) -> Drive:
    """The drive with each constant signal written by one knot, so that it is known to be constant.

    A closed form asks for that while it is traced.
    """
    for name in (kind_of(drive), "force"):
        signal = getattr(drive, name)
        if is_constant(signal) and len(signal.knots) > 1:
            one = Signal(signal.knots[:1], signal.values[:1], signal.slopes[:1])
            drive = eqx.tree_at(lambda d, name=name: getattr(d, name), drive, one)
    return drive


class DriveQuantity(NamedTuple):
    """A quantity of a drive: its unit, how a value of it is put in, and the numbers it sets."""

    unit: str
    put: Callable[[Any, Any], Any]  # (drive, value) -> drive
    sets: frozenset[str]


def drive_quantities(drive: Drive, names: tuple[str, ...]) -> dict[str, DriveQuantity]:
    """Path -> quantity: `speed.w1`, `speed.scale`, `force.x`, `force.scale`, `angle.w1`."""
    kind, unit = kind_of(drive), "rad/s" if isinstance(drive, SpeedDrive) else "N m"
    turned, pushed = (
        {f"{name}.{part}": (name, i) for i, part in enumerate(parts)}
        for name, parts in ((kind, names), ("force", "xyz"))
    )
    angles = {f"angle.{name}": i for i, name in enumerate(names)}
    return {
        f"{kind}.scale": DriveQuantity("1", _scale(kind), frozenset(turned)),
        **{path: _one(unit, _set(*place), path) for path, place in turned.items()},
        **{path: _one("N", _set(*place), path) for path, place in pushed.items()},
        "force.scale": DriveQuantity("1", _scale("force"), frozenset(pushed)),
        **{path: _one("rad", _set_angle(i, len(names)), path) for path, i in angles.items()},
    }


def _one(unit: str, put: Callable, path: str) -> DriveQuantity:
    return DriveQuantity(unit, put, frozenset({path}))


def _scale(name: str) -> Callable:
    def scaled(drive, value):
        signal = getattr(drive, name)
        new = Signal(signal.knots, signal.values * value, signal.slopes * value)
        return eqx.tree_at(lambda d: getattr(d, name), drive, new)

    return scaled


def _set(name: str, i: int) -> Callable:
    def replaced(drive, value):
        signal = getattr(drive, name)
        new = Signal(
            signal.knots, signal.values.at[:, i].set(value), signal.slopes.at[:, i].set(0.0)
        )
        return eqx.tree_at(lambda d: getattr(d, name), drive, new)

    return replaced


def _set_angle(i: int, count: int) -> Callable:
    def replaced(drive, value):
        angle = jnp.zeros(count) if drive.initial_angle is None else drive.initial_angle
        return eqx.tree_at(
            lambda d: d.initial_angle, drive, angle.at[i].set(value), is_leaf=lambda x: x is None
        )

    return replaced


def apply(rig: Rig, drive: Drive, paths: tuple[str, ...], values) -> tuple[Rig, Drive]:
    """Rig and drive with `values` (d,), traced or not, at `paths`."""
    quantities = drive_quantities(drive, rig.names)
    for i, path in enumerate(paths):
        if path in quantities:
            drive = quantities[path].put(drive, values[i])
        else:
            rig = put_parameter(rig, path, values[i])
    return rig, drive


def drive_of(given: Any, rig: Rig) -> Drive:
    """A drive, or constant wheel speeds as one, as `simulate` takes them.

    Raises `InputError` for what is neither or does not fit the rig.
    """
    drive = drive_for(rig, given)
    if not isinstance(drive, Drive):
        raise InputError(
            f"studies take the drives of omnijax alone, but not a {type(drive).__name__}."
        )
    return drive
