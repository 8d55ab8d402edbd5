"""The rig that a saved run carries with it."""

import tomllib
from pathlib import Path

from .._errors import InputError
from ..rig import Rig, parse_rig


def rig_of_run(path: str | Path) -> Rig:
    """The rig of a run saved as `.nc`; `InputError` where the file holds none."""
    import xarray

    with xarray.open_dataset(path, engine="h5netcdf", decode_times=False) as data:
        text = str(data.attrs.get("rig", ""))
    if not text:
        raise InputError(f"{Path(path).name} holds no rig: save the run together with its rig.")
    return parse_rig(tomllib.loads(text), path=path)
