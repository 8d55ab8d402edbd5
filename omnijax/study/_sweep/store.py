"""The store of a sweep: a zarr group of one array a quantity, written chunk by chunk.

Every array runs over `design` in chunks of the sweep's chunk.  A chunk file appears by renaming, so
it is whole or absent, and `status` is written last: its chunk files are the done-mask.  A killed
run therefore loses the chunk it was in, and nothing else.  Every chunk has a checksum; one that is
lost or damaged counts as not done, and is computed again by `--resume`.

Other studies keep parts of unlike arrays in a `Folder` of `_study_folder.py`, which says why.
"""

import os
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..._errors import InputError
from ..._files import sync
from ..._lock import Lock
from ..._reading import existing
from ..._status import Status
from .damage import add_note, check_description, damaged_chunks, seal
from .memory import HeldArray, HeldGroup
from .spec import SweepSpec

SCHEMA = "omnijax-sweep-1"


class StoredQuantity(NamedTuple):
    """One stored array: name, unit and meaning."""

    name: str
    unit: str
    meaning: str

    @property
    def dtype(self) -> str:
        """Of its values: those of `status` are small whole numbers."""
        return "i1" if self.name == "status" else "f8"

    @property
    def fill(self) -> float | int:
        """Value of a design that is not done."""
        return int(Status.NOT_DONE) if self.name == "status" else np.nan

    @property
    def attributes(self) -> dict[str, Any]:
        """What is said about the array, by the CF conventions."""
        about: dict[str, Any] = {"units": self.unit, "long_name": self.meaning}
        if self.name == "status":
            flags = " ".join(_flags(member.text for member in Status))
            about |= {"flag_values": [int(x) for x in Status], "flag_meanings": flags}
        return about


class Store:
    """A sweep on disk (or in memory, for a sweep without `out`)."""

    def __init__(self, group: Any, folder: Path | None):
        self.group: Any = group
        self.folder = folder
        if group.attrs.get("schema") != SCHEMA:
            raise InputError("is not the store of a sweep.", folder)
        self.spec = SweepSpec.from_json(group.attrs["spec"])
        self._arrays = dict(group.arrays())
        for name in self.names:
            if name not in self._arrays:
                raise InputError(f"has no array `{name}`: {name}/zarr.json is missing.", folder)
        self._here: set[int] = set()  # chunks that were written here
        self._damaged: dict[int, str] | None = None

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

    @property
    def damaged(self) -> dict[int, str]:
        """Chunks that were done and cannot be used, each with the file and what is wrong."""
        if self._damaged is None:
            written = [] if self.folder is None else chunk_files(self.folder)
            folder = self.folder or Path(".")
            self._damaged = damaged_chunks(folder, self._arrays, set(written) - self._here)
        return self._damaged

    def kept(self) -> str:
        """What an interruption leaves, and how to go on."""
        text = f"Interrupted: {self.count_done()} of {self.size} designs are done"
        if self.folder is None:
            return f"{text}, but were kept in memory only; give --out to keep them."
        return f"{text} and kept in {self.folder}. Continue with the same command and --resume."

    def damage(self) -> list[str]:
        """One sentence a damaged file."""
        return [
            f"{self.folder}: {text}: its designs count as not done; --resume computes them again."
            for text in self.damaged.values()
        ]

    def read(self, name: str, start: int = 0, stop: int | None = None) -> np.ndarray:
        """Values of the designs start ... stop - 1; of a damaged chunk NaN, and status -1."""
        stop = self.size if stop is None else stop
        array, size = self._arrays[name], self.spec.chunk
        lost = [i for i in self.damaged if i * size < stop and (i + 1) * size > start]
        if not lost:
            return np.asarray(array[start:stop])
        values = np.full(max(stop - start, 0), array.fill_value, array.dtype)
        for chunk in range(start // size, -(-stop // size)):
            if chunk not in self.damaged:
                a, b = max(chunk * size, start), min((chunk + 1) * size, stop)
                values[a - start : b - start] = array[a:b]
        return values

    def bounds(self, chunk: int) -> tuple[int, int]:
        """First design of a chunk and the one after its last."""
        start = chunk * self.spec.chunk
        return start, min(start + self.spec.chunk, self.size)

    def count(self, chunks: Iterable[int]) -> int:
        """Number of designs in `chunks`."""
        return sum(stop - start for start, stop in map(self.bounds, chunks))

    def count_done(self) -> int:
        """Number of designs that are done."""
        return self.count(np.flatnonzero(self.done()).tolist())

    def done(self) -> np.ndarray:
        """Which chunks are complete, (chunks,)."""
        complete = np.zeros(self.chunks, bool)
        complete[sorted(self._here)] = True
        if self.folder is not None:
            complete[[i for i in chunk_files(self.folder) if i < len(complete)]] = True
            complete[[i for i in self.damaged if i < len(complete)]] = False
        return complete

    def write(self, chunk: int, columns: Mapping[str, np.ndarray]) -> None:
        """Write one chunk, `status` last."""
        start, stop = self.bounds(chunk)
        for name in self.names:
            self._arrays[name][start:stop] = columns[name]
            if self.folder is not None:
                sync(self.folder / name / "c" / str(chunk))
        self.written(chunk)

    def note(self, key: str, value: str) -> None:
        """One more attribute."""
        if self.folder is None:
            self.group.attrs[key] = value
            return
        import zarr

        add_note(self.folder, key, value)
        self.group = zarr.open_group(str(self.folder), mode="r")

    def written(self, chunk: int) -> None:
        """A chunk has been written, by this process or by another one."""
        self._here.add(chunk)
        self.damaged.pop(chunk, None)


def chunk_files(folder: Path) -> dict[int, float]:
    """Complete chunks of a store and the time each was finished, s since the epoch."""
    try:
        entries = list(os.scandir(folder / "status" / "c"))
    except FileNotFoundError:
        return {}
    return {int(e.name): e.stat().st_mtime for e in entries if e.name.isdigit()}


def create_store(
    folder: Path | None, spec: SweepSpec, quantities: list[StoredQuantity], about: Mapping[str, Any]
) -> Store:
    """An empty store; the folder appears complete, by renaming."""
    order = [q.name for q in quantities]
    attributes = {"schema": SCHEMA, "spec": spec.to_json(), "order": order, **about}
    if folder is None:
        size = spec.points.size
        arrays = {
            q.name: HeldArray(np.full(size, q.fill, q.dtype), q.attributes) for q in quantities
        }
        return Store(HeldGroup(attributes, arrays), None)
    draft = folder.with_name(f".{folder.name}.{os.getpid()}.partial")
    try:
        for name, content in _described(spec, quantities, attributes).items():
            (draft / name).parent.mkdir(parents=True, exist_ok=True)
            (draft / name).write_bytes(content)
        seal(draft)
        draft.rename(folder)
    except BaseException:
        shutil.rmtree(draft, ignore_errors=True)
        raise
    return open_store(folder)


def _described(
    spec: SweepSpec, quantities: list[StoredQuantity], attributes: dict[str, Any]
) -> dict[str, bytes]:
    """The files of an empty store; zarr's threads do not touch the disk: they outlive a failure."""
    import zarr
    from zarr.codecs import Crc32cCodec, ZstdCodec
    from zarr.storage import MemoryStore

    files: dict[str, Any] = {}
    group = zarr.open_group(MemoryStore(files), mode="w", zarr_format=3, attributes=attributes)
    for q in quantities:
        group.create_array(
            q.name,
            shape=(spec.points.size,),
            chunks=(spec.chunk,),
            dtype=q.dtype,
            fill_value=q.fill,
            compressors=[ZstdCodec(level=0), Crc32cCodec()],
            config={"write_empty_chunks": True},  # a chunk without a file is a lost one
            dimension_names=["design"],
            attributes=q.attributes,
        )
    return {name: content.to_bytes() for name, content in files.items()}


def _flags(names) -> list[str]:
    return [name.replace(" ", "_").replace("-", "_") for name in names]


def open_store(folder: str | Path, mode: Any = "r+") -> Store:
    """The store in `folder`; `InputError` where there is none."""
    folder = existing(folder, "folder")
    import zarr
    from zarr.errors import GroupNotFoundError

    check_description(folder)
    try:
        with zarr.config.set({"array.write_empty_chunks": True}):
            return Store(zarr.open_group(str(folder), mode=mode), folder)
    except (GroupNotFoundError, FileNotFoundError, KeyError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError("is not the store of a sweep.", folder) from None


def clean(folder: Path) -> None:
    """Remove what a killed run left half written."""
    for leftover in folder.glob("*/c/*.partial"):
        leftover.unlink(missing_ok=True)


def lock(folder: Path | None) -> Lock:
    """The store is written by this process alone until the lock is released."""
    return Lock(None if folder is None else folder / "zarr.json", "sweep")


def is_running(folder: Path) -> bool:
    """Whether a process on this machine is writing the store."""
    try:
        lock(folder).release()
    except InputError:
        return True
    return False
