"""netCDF files in and out: whole, synced, and of a size that memory can hold."""

import gc
import hashlib
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from . import _interrupts
from ._errors import InputError, reason_of, tell
from ._files import reserve, writing
from ._memory import SHARE, available, in_words
from ._reading import existing

SEAL = "words_sha256"  # attribute: digest of all the others
_LINKS = {SEAL, "DIMENSION_LIST", "REFERENCE_LIST"}  # places in the file
CHUNK = 1 << 16  # numbers that share a checksum
_broken: list[Exception] = []
OVERHEAD = 200_000  # bytes of names, attributes and tables in a file, at most


def write_netcdf(data: Any, path: str | Path) -> Path:
    """Write an `xarray.Dataset`; `InputError` where the file cannot be written."""
    with writing(path) as part:
        reserve(part, data.nbytes + OVERHEAD)
        try:
            _write(data, part)
        except (OSError, RuntimeError) as error:  # of the disk, while HDF5 closes the file
            _interrupts.end_hard()  # HDF5 closes it again as the process ends, and crashes
            _broken.append(error)  # nor does h5netcdf close it before, and complain
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
    import h5py

    with h5py.File(part, "a") as file:
        file.attrs[SEAL] = _words_digest(file)


def _words_digest(file: Any) -> str:
    """Digest of all names, shapes, kinds and attributes of an HDF5 file; arrays have checksums."""
    import numpy as np

    digest = hashlib.sha256()

    def add(name: str, item: Any) -> None:
        digest.update(
            repr((name, getattr(item, "shape", None), str(getattr(item, "dtype", "")))).encode()
        )
        for key in sorted(item.attrs):
            if key not in _LINKS:
                value = item.attrs[key]
                digest.update(repr((key, np.asarray(value).tolist())).encode())

    add("", file)
    file.visititems(add)
    return digest.hexdigest()


def _check_words(path: Path) -> None:
    """Warn where names, kinds or attributes of a file of ours have changed since it was written."""
    import h5py

    with h5py.File(path, "r") as file:
        sealed = file.attrs.get(SEAL)
        if sealed is not None and sealed != _words_digest(file):
            tell([f"{path}: its names or attributes have changed since it was written."])


def _checked(data: Any) -> dict[str, dict[str, Any]]:
    """Checksums of all arrays of numbers: a flipped bit is noticed where they are read."""
    encoding = {}
    for name, values in data.variables.items():
        if values.dtype.kind in "fiu" and values.size > 1:
            rows = max(1, CHUNK // (values.size // values.shape[0]))
            sizes = (min(rows, values.shape[0]), *values.shape[1:])
            encoding[name] = {"fletcher32": True, "chunksizes": sizes}
    return encoding


def load_netcdf(path: str | Path, kind: str = "a netCDF file", decode_times: bool = False) -> Any:
    """The `xarray.Dataset` of a file, in memory; `InputError` where it is none or too large."""

    def whole(opened: Any) -> Any:
        if opened.nbytes > SHARE * available():
            raise InputError(f"needs {in_words(opened.nbytes)} of memory, which is not free.")
        opened.attrs.pop(SEAL, None)
        return opened.load()

    return _opened(path, kind, decode_times, whole)


def netcdf_attributes(path: str | Path, kind: str) -> dict[str, Any]:
    """The attributes of a file; its arrays are not read."""
    return _opened(path, kind, False, lambda opened: dict(opened.attrs))


def _opened(path: str | Path, kind: str, decode_times: bool, work: Callable[[Any], Any]) -> Any:
    import xarray

    path = existing(path)
    with _dropping_quietly():
        try:
            engine = _engine(path)
            if engine == "h5netcdf":
                _check_words(path)
            with xarray.open_dataset(path, engine=engine, decode_times=decode_times) as opened:
                return work(opened)
        except InputError as error:
            problems: Sequence[str] = error.problems
        except Exception as error:  # its readers raise whatever they like on a broken file
            problems = [f"is not {kind}: {reason_of(error)}."]
        gc.collect()  # the half-opened file, which the exception held
    raise InputError(problems, path)


def _engine(path: Path) -> Literal["scipy", "h5netcdf"]:
    """The engine that reads a file: SciPy for the classic format (netCDF 3), HDF5 for netCDF 4."""
    with path.open("rb") as file:
        return "scipy" if file.read(4) in (b"CDF\x01", b"CDF\x02") else "h5netcdf"


@contextmanager
def _dropping_quietly() -> Iterator[None]:
    """h5netcdf's destructor fails on a file that it could not open: nobody is told of that."""
    before = sys.unraisablehook

    def heard(unraisable: Any) -> None:
        if not str(getattr(unraisable.object, "__module__", "")).startswith("h5netcdf"):
            before(unraisable)

    sys.unraisablehook = heard
    try:
        yield
    finally:
        sys.unraisablehook = before
