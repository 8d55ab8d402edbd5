"""The rig that a saved run carries with it."""

from pathlib import Path
from typing import Any

from .._consent import law_files
from .._errors import InputError
from .._netcdf import netcdf_attributes
from .._reading import toml_of
from ..rig import Rig, parse_rig


def rig_of_run(path: str | Path) -> Rig:
    """The rig of a run saved as `.nc`; `InputError` where the file holds none."""
    text = str(netcdf_attributes(path, "a run of omnijax").get("rig", ""))
    if not text:
        raise InputError("holds no rig: save the run together with its rig.", path)
    with law_files("read"):  # a run's file is data: what its rig names is not run
        return parse_rig(_without_laws(toml_of(text, path)), path=path)


def _without_laws(data: dict[str, Any]) -> dict[str, Any]:
    """The rig's tables without the effects whose laws stand in files elsewhere."""
    effects = data.get("effect", [])
    if isinstance(effects, list):
        effects = [e for e in effects if not (isinstance(e, dict) and "law" in e)]
    return data | {"effect": effects} if effects else {k: data[k] for k in data if k != "effect"}
