"""netCDF files in and out: whole, synced, and of a size that memory can hold."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from . import _interrupts
from ._errors import InputError
from ._files import reserve, writing
from ._memory import SHARE, available, in_words
from ._reading import existing, regular

CHUNK = 1 << 16  # numbers that share a checksum
OVERHEAD = 200_000  # bytes of names, attributes and tables in a file, at most


def write_netcdf(data: Any, path: str | Path) -> Path:
    """Write an `xarray.Dataset`; `InputError` where the file cannot be written."""
    with writing(path) as part:
        reserve(part, data.nbytes + OVERHEAD)
        try:
            _write(data, part)
        except (OSError, RuntimeError) as error:  # of the disk, while HDF5 closes the file
            _interrupts.end_hard()  # HDF5 closes it again as the process ends, and crashes
            raise OSError(None, f"HDF5 says: {error}") from None
    return Path(path)


def _write(data: Any, part: Path) -> None:
    """One variable after the other: xarray copies what it writes at a time."""
    how = {"engine": "h5netcdf"}
    frame = data.drop_vars(list(data.data_vars))
    frame.to_netcdf(part, mode="w", encoding=_checked(frame), **how)
    for name in data.data_vars:
        one = data[[name]].drop_vars(data.coords, errors="ignore")
        one.to_netcdf(part, mode="a", encoding=_checked(one), **how)


def _checked(data: Any) -> dict[str, dict[str, Any]]:
    """Checksums of all arrays of numbers: a flipped bit is noticed where they are read."""
    found = {}
    for name, values in data.variables.items():
        if values.dtype.kind in "fiu" and values.size > 1:
            rows = max(1, CHUNK // (values.size // values.shape[0]))
            sizes = (min(rows, values.shape[0]), *values.shape[1:])
            found[name] = {"fletcher32": True, "chunksizes": sizes}
    return found


def load_netcdf(path: str | Path, kind: str = "a netCDF file", decode_times: bool = False) -> Any:
    """The `xarray.Dataset` of a file, in memory; `InputError` where it is none or too large."""

    def whole(opened: Any) -> Any:
        if opened.nbytes > SHARE * available():
            raise InputError(f"needs {in_words(opened.nbytes)} of memory, which is not free.")
        return opened.load()

    return _opened(path, kind, decode_times, whole)


def netcdf_attributes(path: str | Path, kind: str) -> dict[str, Any]:
    """The attributes of a file; its arrays are not read."""
    return _opened(path, kind, False, lambda opened: dict(opened.attrs))


def _opened(path: str | Path, kind: str, decode_times: bool, work: Callable[[Any], Any]) -> Any:
    import xarray

    path = regular(existing(path))
    try:
        with xarray.open_dataset(path, engine="h5netcdf", decode_times=decode_times) as opened:
            return work(opened)
    except InputError as error:
        raise InputError(error.problems, path) from None
    except Exception as error:  # h5netcdf raises whatever it likes on a broken file
        said = str(error).strip().rstrip(".") or type(error).__name__
        raise InputError(f"is not {kind}: {said}.", path) from None
