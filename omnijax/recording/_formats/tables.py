"""Files of every kind into columns of numbers: CSV, Parquet, MAT, JSON, NetCDF, TDMS, UFF, ..."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import InputError, reason_of, require
from ..._memory import check_room
from ..._netcdf import load_netcdf
from ..._reading import regular
from .._columns import OUTPUTS, UNITS
from .._recording import Fault
from .csv import CsvTable, read_csv
from .json import read_json
from .mat import mat_sizes
from .mcap import read_mcap
from .names import doubled, leaves, once
from .spread import spread


def suffix_of(path: Path) -> str:
    """`.csv.gz`, `.json.gz` for a packed table, else the last suffix, in small letters."""
    name = path.name.lower()
    packed = next((x for x in (".csv.gz", ".json.gz") if name.endswith(x)), None)
    return packed or path.suffix.lower()


def stem_of(path: Path) -> str:
    """The file's name without its suffix: `run-1` for `run-1.csv.gz`."""
    return path.name[: len(path.name) - len(suffix_of(path))]


def may_be_run(path: Path) -> bool:
    """Whether a file of a folder may be a run; of JSON and text only with a NAME.toml beside it.

    They hold anything, settings, reports and notes too.
    """
    suffix = suffix_of(path)
    stated = suffix not in ANYTHING or path.with_name(f"{stem_of(path)}.toml").exists()
    return path.is_file() and suffix in READERS and stated


def read_table(path: Path) -> CsvTable:
    """Columns of the file; `InputError` for a kind of file that is not known."""
    suffix = suffix_of(path)
    if suffix not in READERS:
        known = ", ".join(sorted(READERS))
        raise InputError(
            f"{path.name}: the file's kind must be one of {known}, but is {suffix or '-'}."
        )
    with contextlib.suppress(OSError):  # what is missing is said by the reader
        check_room(path, regular(path).stat().st_size)
    try:
        table = READERS[suffix](path)
    except InputError:
        raise
    except MemoryError:
        raise InputError("needs more memory than there is.", path) from None
    except Exception as error:  # third-party readers raise whatever they like on a broken file
        if isinstance(error, OSError) and error.errno is not None:  # of the system, not of a reader
            raise
        raise InputError(f"{path.name} cannot be read as {suffix}: {reason_of(error)}.") from error
    if not table.columns:
        raise InputError(f"{path.name} holds no columns of numbers.")
    return table


def _parquet(path: Path) -> CsvTable:
    parquet = require("pyarrow.parquet", "measured", "reading `.parquet` files")
    with parquet.ParquetFile(path) as file:
        about = file.metadata
        check_room(path, 8 * about.num_rows * about.num_columns)
        table = file.read()
    columns = zip(table.column_names, (x.to_numpy() for x in table.columns), strict=True)
    return spread(once(path.name, columns))


def _mat(path: Path) -> CsvTable:
    import scipy.io

    try:
        check_room(path, max(mat_sizes(path)))
        _check_variables(path)
        variables = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=True)
    except NotImplementedError:  # version 7.3 is HDF5
        return _hdf5(path)
    named = [(k, x) for k, x in variables.items() if not k.startswith("__")]
    return spread(leaves(one for k, x in named for one in _fields((k,), x)))


def _check_variables(path: Path) -> None:
    """`InputError` for a variable that a MAT file holds twice: `loadmat` gives the last one."""
    import scipy.io

    names = [name for name, _, _ in scipy.io.whosmat(path)]
    twice = next((x for k, x in enumerate(names) if x in names[:k]), None)
    if twice is not None:
        raise doubled(path.name, twice)


def _fields(path: tuple[str, ...], value: Any) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Columns of a variable: itself, a struct's fields (nested too), or those of a sample list."""
    if not (isinstance(value, np.ndarray | np.void) and value.dtype.names):
        yield path, value
        return
    if np.size(value) > 1:
        numbers = {k: [np.asarray(x) for x in np.ravel(value[k])] for k in value.dtype.names}
        for k, column in numbers.items():
            if all(x.size == 1 and x.dtype.kind in "fiub" for x in column):
                yield (*path, k), np.array([float(x.item()) for x in column])
        return
    for field in value.dtype.names:
        inner = value[field]
        inner = inner.item() if isinstance(inner, np.ndarray) and inner.dtype == object else inner
        yield from _fields((*path, field), inner)


def _hdf5(path: Path) -> CsvTable:
    import h5py

    columns: list[tuple[list[str], np.ndarray]] = []
    sizes = [0]

    def keep(name, item):
        if isinstance(item, h5py.Dataset) and not name.startswith("#"):
            sizes.append(8 * (item.size or 0))
            check_room(path, sum(sizes))
            columns.append((name.split("/"), np.asarray(item[()]).T))  # MATLAB: columns first

    with h5py.File(path, "r") as file:
        file.visititems(keep)
    return spread(leaves(columns))


def _netcdf(path: Path) -> CsvTable:
    data = load_netcdf(path)
    units = {str(k): str(v.attrs["units"]) for k, v in data.variables.items() if "units" in v.attrs}
    columns = {str(k): v.values for k, v in data.variables.items()}
    simulated = "status_code" in data.attrs
    for group in UNITS:  # what the sensors made of it stands beside the true value
        if f"measured_{group}" in columns:
            columns[group] = columns.pop(f"measured_{group}")
    exact = dict.fromkeys(OUTPUTS, 0.0) if simulated else {}
    own = {k: v for k, v in columns.items() if k in UNITS or k.rsplit("_", 1)[0] in UNITS}
    return spread(own if "t" in own else columns, units)._replace(noise=exact)


def _tdms(path: Path) -> CsvTable:
    tdms = require("nptdms", "measured", "reading `.tdms` files", "npTDMS")
    columns: list[tuple[tuple[str, ...], Any]] = []
    units: dict[str, str] = {}
    with tdms.TdmsFile.read(path) as file:
        some = [(group.name, x) for group in file.groups() for x in group.channels()]
        for group, channel in some:
            columns.append(((group, channel.name), channel[:]))
            unit = channel.properties.get("unit_string")
            if unit:
                units |= dict.fromkeys((channel.name, f"{group}.{channel.name}"), str(unit))
        clock = next((x for _, x in some if "wf_increment" in x.properties), None)
        if clock is not None and all(x.name != "t" for _, x in some):
            columns.append((("t",), clock.time_track()))
    return spread(leaves(columns), units)


class _Channels:
    """Channels of a recorder by their paths, on the times of the first one."""

    def __init__(self, file: str):
        self.file, self.faults = file, []
        self.columns: list[tuple[tuple[str, ...], Any]] = []

    def add(self, where: tuple[str, ...], times, values) -> None:
        """Add a channel; one whose times are off by more than half a step is left out, and said.

        (Values at other times, as many, would else be read as taken at the first channel's times.)
        """
        times = np.asarray(times, float)
        if not self.columns:
            self.columns.append((("t",), times))
        first = self.columns[0][1]
        near = len(times) != len(first) or len(first) < 2
        near = near or np.max(np.abs(times - first)) <= 0.5 * np.median(np.abs(np.diff(first)))
        if not near:
            self.leave_out(where[-1], "time", "its times are not those of the first channel")
            return
        self.columns.append((where, np.asarray(values)))

    def leave_out(self, name: str, kind: str, what: str) -> None:
        """Say of a channel that it is not used."""
        self.faults.append(Fault(self.file, name, (), kind, what, "it is not used"))


OVER_TIME, FREQUENCY = (0, 1), 18  # UFF's kinds of functions, and of an abscissa


def _uff(path: Path) -> CsvTable:
    pyuff = require("pyuff", "measured", "reading `.uff` files")
    channels, units = _Channels(path.name), {}
    sets = pyuff.UFF(str(path)).read_sets()
    for one in sets if isinstance(sets, list) else [sets]:
        if one.get("type") != 58:
            continue
        name = (one.get("id1") or one.get("id2") or "").strip()
        kind, over = one.get("func_type", 1), one.get("abscissa_spec_data_type")
        if kind not in OVER_TIME or over == FREQUENCY:
            channels.leave_out(name, "spectrum", "it is a spectrum, no course over time")
            continue
        channels.add((name,), one["x"], np.real(np.asarray(one["data"])))
        for column, axis in (("t", "abscissa"), (name, "ordinate")):
            unit = str(one.get(f"{axis}_axis_units_lab", "")).strip()
            if unit and unit.upper() not in ("NONE", "0"):
                units.setdefault(column, unit)
    if not channels.columns and channels.faults:
        raise InputError(f"{path.name} holds spectra only, no course over time.")
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - 100))
        whole = file.read().rstrip().endswith(b"    -1")
    if not whole:
        what, use = "the file ends within a data set", "what follows the last whole one is lost"
        channels.faults.append(Fault(path.name, "", (), "cut off", what, use))
    named = ((where[-1], x) for where, x in channels.columns)
    return spread(once(path.name, named), units)._replace(faults=channels.faults)


def _mdf(path: Path) -> CsvTable:
    asammdf = require("asammdf", "measured", "reading `.mf4` files")
    channels, units = _Channels(path.name), {}
    with asammdf.MDF(path) as file:
        groups = [(one.channel_group.cycles_nr, len(one.channels)) for one in file.groups]
        check_room(path, 8 * sum(rows * columns for rows, columns in groups))
        for signal in file.iter_channels():
            where = (f"group {signal.group_index}", str(signal.name))
            channels.add(where, signal.timestamps, signal.samples)
            if signal.unit:
                units |= dict.fromkeys((where[1], ".".join(where)), str(signal.unit))
    return spread(leaves(channels.columns), units)._replace(faults=channels.faults)


ANYTHING = (".json", ".json.gz", ".txt", ".dat", ".log")
READERS = {
    ".csv": read_csv,
    ".csv.gz": read_csv,
    ".tsv": read_csv,
    ".txt": read_csv,
    ".dat": read_csv,
    ".log": read_csv,
    ".parquet": _parquet,
    ".mat": _mat,
    ".nc": _netcdf,
    ".tdms": _tdms,
    ".uff": _uff,
    ".unv": _uff,
    ".mf4": _mdf,
    ".json": read_json,
    ".json.gz": read_json,
    ".mcap": read_mcap,
}
