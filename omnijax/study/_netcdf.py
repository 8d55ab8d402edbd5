"""Results of studies in netCDF files: one way out, one way back, one sentence where it fails."""

from pathlib import Path
from typing import Any

from .._errors import InputError


def write_result(data: Any, path: str | Path) -> None:
    """Write an `xarray.Dataset`; `InputError` where the file cannot be written."""
    try:
        data.to_netcdf(path, engine="h5netcdf")
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror or error}.", path) from None


def read_result(path: str | Path, kind: str, what: str) -> Any:
    """The dataset of a result whose `kind` is as given; `InputError` for any other file."""
    import xarray as xr

    try:
        with xr.open_dataset(path, engine="h5netcdf") as opened:
            data = opened.load()
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read as netCDF: {error}.", path) from None
    if data.attrs.get("kind") != kind:
        raise InputError(f"holds no {what}.", path)
    return data
