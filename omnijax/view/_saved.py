"""The rig that a saved run carries with it."""

from pathlib import Path

from .._errors import InputError
from .._netcdf import netcdf_attributes
from .._reading import toml_of
from ..rig import Rig, parse_rig


def rig_of_run(path: str | Path) -> Rig:
    """The rig of a run saved as `.nc`; `InputError` where the file holds none."""
    text = str(netcdf_attributes(path, "a run of omnijax").get("rig", ""))
    if not text:
        raise InputError("holds no rig: save the run together with its rig.", path)
    return parse_rig(toml_of(text, path), path=path)
