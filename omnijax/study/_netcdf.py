"""Results of studies in netCDF files: one way out, one way back, one sentence where it fails."""

from pathlib import Path
from typing import Any

from .._errors import InputError
from .._netcdf import load_netcdf, write_netcdf


def write_result(data: Any, path: str | Path) -> None:
    """Write an `xarray.Dataset`; `InputError` where the file cannot be written."""
    write_netcdf(data, path)


def read_result(path: str | Path, kind: str, what: str) -> Any:
    """The dataset of a result whose `kind` is as given; `InputError` for any other file."""
    data = load_netcdf(path, decode_times=True)
    if data.attrs.get("kind") != kind:
        raise InputError(f"holds no {what}.", path)
    return data
