"""The store of a sweep: a zarr group of one array a quantity, written chunk by chunk.

Every array runs over `design` in chunks of the sweep's chunk.  A chunk file appears by renaming, so
it is whole or absent, and `status` is written last: its chunk files are the done-mask.  A killed
run therefore loses the chunk it was in, and nothing else.
"""

import os
import shutil
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..._errors import InputError
from .spec import SweepSpec

STATUS = {
    -1: "not done",
    0: "ok",
    1: "non-finite",
    2: "step limit",
    3: "failed",
    4: "lift-off",
    5: "slip",
}
FAILED = (1, 2, 3)  # without figures; lift-off and slip keep theirs
SCHEMA = "omnijax-sweep-1"


class Quantity(NamedTuple):
    """One stored array: name, unit and meaning."""

    name: str
    unit: str
    meaning: str


class Store:
    """A sweep on disk (or in memory, for a sweep without `out`)."""

    def __init__(self, group: Any, folder: Path | None):
        self.group, self.folder = group, folder
        if group.attrs.get("schema") != SCHEMA:
            raise InputError("is not the store of a sweep.", folder)
        self.spec = SweepSpec.from_json(group.attrs["spec"])
        self._arrays = dict(group.arrays())
        self._here: set[int] = set()  # done chunks of a store in memory

    @property
    def size(self) -> int:
        """Number of designs."""
        return self._arrays["status"].shape[0]

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-self.size // self.spec.chunk)

    @property
    def names(self) -> list[str]:
        """Names of the stored arrays, status last."""
        return [name for name in self.group.attrs["order"]]

    def unit(self, name: str) -> str:
        """Unit of one stored array."""
        return self._arrays[name].attrs["units"]

    def read(self, name: str, start: int = 0, stop: int | None = None) -> np.ndarray:
        """Values of the designs start ... stop - 1."""
        return np.asarray(self._arrays[name][start : self.size if stop is None else stop])

    def bounds(self, chunk: int) -> tuple[int, int]:
        """First design of a chunk and the one after its last."""
        start = chunk * self.spec.chunk
        return start, min(start + self.spec.chunk, self.size)

    def count(self, chunks: Iterable[int]) -> int:
        """Number of designs in `chunks`."""
        return sum(stop - start for start, stop in map(self.bounds, chunks))

    def done(self) -> np.ndarray:
        """Which chunks are complete, (chunks,)."""
        found = np.zeros(self.chunks, bool)
        found[sorted(self._here)] = True
        if self.folder is not None:
            found[[i for i in chunk_files(self.folder) if i < len(found)]] = True
        return found

    def write(self, chunk: int, columns: Mapping[str, np.ndarray]) -> None:
        """Write one chunk, `status` last."""
        start, stop = self.bounds(chunk)
        for name in self.names:
            self._arrays[name][start:stop] = columns[name]
        self._here.add(chunk)


def chunk_files(folder: Path) -> dict[int, float]:
    """Complete chunks of a store and the time each was finished, s since the epoch."""
    try:
        entries = list(os.scandir(folder / "status" / "c"))
    except FileNotFoundError:
        return {}
    return {int(e.name): e.stat().st_mtime for e in entries if e.name.isdigit()}


def create_store(
    folder: Path | None, spec: SweepSpec, quantities: list[Quantity], about: Mapping[str, Any]
) -> Store:
    """An empty store; the folder appears complete, by renaming."""
    from zarr.storage import MemoryStore

    if folder is None:
        return Store(_empty_group(MemoryStore(), spec, quantities, about), None)
    draft = folder.with_name(f".{folder.name}.{os.getpid()}.partial")
    try:
        draft.parent.mkdir(parents=True, exist_ok=True)
        _empty_group(str(draft), spec, quantities, about)
        draft.rename(folder)
    except OSError:
        shutil.rmtree(draft, ignore_errors=True)
        raise
    return open_store(folder)


def _empty_group(
    where: Any, spec: SweepSpec, quantities: list[Quantity], about: Mapping[str, Any]
) -> Any:
    import zarr

    size, order = spec.points.size, [q.name for q in quantities]
    attributes = {"schema": SCHEMA, "spec": spec.to_json(), "order": order, **about}
    group = zarr.open_group(where, mode="w", zarr_format=3, attributes=attributes)
    for q in quantities:
        status = q.name == "status"
        about_it: dict[str, Any] = {"units": q.unit, "long_name": q.meaning}
        if status:
            flags = " ".join(_flags(STATUS.values()))
            about_it |= {"flag_values": list(STATUS), "flag_meanings": flags}
        group.create_array(
            q.name,
            shape=(size,),
            chunks=(spec.chunk,),
            dtype="i1" if status else "f8",
            fill_value=-1 if status else np.nan,
            dimension_names=["design"],
            attributes=about_it,
        )
    return group


def _flags(names) -> list[str]:
    return [name.replace(" ", "_").replace("-", "_") for name in names]


def open_store(folder: str | Path, mode: Any = "r+") -> Store:
    """The store in `folder`; `InputError` where there is none."""
    import zarr
    from zarr.errors import GroupNotFoundError

    folder = Path(folder)
    if not folder.is_dir():
        raise InputError("there is no such folder.", folder)
    try:
        return Store(zarr.open_group(str(folder), mode=mode), folder)
    except (GroupNotFoundError, FileNotFoundError, KeyError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError("is not the store of a sweep.", folder) from None


def clean(folder: Path) -> None:
    """Remove what a killed run left half written."""
    for leftover in folder.glob("*/c/*.partial"):
        leftover.unlink(missing_ok=True)


class Lock:
    """One writing process a store: an advisory lock that ends with its process, however it ends."""

    def __init__(self, folder: Path | None):
        self._file: Any = None
        if folder is None or sys.platform == "win32":
            return
        import fcntl

        self._file = (folder / "zarr.json").open("rb")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise InputError("another process is writing this sweep.", folder) from None

    def release(self) -> None:
        """Give the store back."""
        if self._file is not None:
            self._file.close()


def is_running(folder: Path) -> bool:
    """Whether a process on this machine is writing the store."""
    try:
        Lock(folder).release()
    except InputError:
        return True
    return False
