"""Sweeps out: xarray in memory, NetCDF, CSV and Parquet files, written block by block."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import InputError, require
from ..._files import write_text, writing
from ..._netcdf import write_netcdf
from ..._status import Status
from .._points import Grid

BLOCK = 65_536  # designs at a time
FORMATS = (".nc", ".csv", ".parquet")


def attributes(result: Any) -> dict[str, str]:
    """What a file of this sweep must say: rig, specification, seed, versions, command."""
    stored = dict(result.store.group.attrs)
    texts = {k: v if isinstance(v, str) else json.dumps(v) for k, v in stored.items()}
    for key in ("order", "files", "sha256"):  # of the store, not of the sweep
        texts.pop(key, None)
    return texts | {"rig": result.spec.rig, "seed": str(result.spec.seed), "method": result.method}


def dataset(result: Any):
    """`xarray.Dataset` with units; a grid has one dimension a parameter."""
    import xarray as xr

    varied = [path for path, _, _ in result.spec.vary]
    grid = isinstance(result.points, Grid)
    dims = varied if grid else ["design"]
    coords: dict[str, Any] = {}
    for i, path in enumerate(varied):
        about = {"units": result.unit(path)}
        if grid:
            axis = result.points.axes[i]
            coords[path] = (path, axis.levels(), about)
        else:
            coords[path] = ("design", result[path], about)
    data = {}
    for name in result.store.names:
        if name not in varied:
            about = dict(result.store.group[name].attrs)
            data[name] = (dims, result[name], about)
    return xr.Dataset(data, coords, attributes(result))


def export(result: Any, file: str | Path) -> Path:
    """Write the sweep to `file`; its ending says how."""
    file = Path(file)
    writers = {".nc": _netcdf, ".csv": _csv, ".parquet": _parquet}
    kind = file.suffix.lower()
    if kind not in writers:
        raise InputError(f"the file must end in {', '.join(FORMATS)}.", file)
    writers[kind](result, file)
    return file


def _netcdf(result: Any, file: Path) -> None:
    write_netcdf(dataset(result), file)


def _blocks(result: Any):
    """(first design, columns) of the whole sweep."""
    for start in range(0, result.size, BLOCK):
        stop = min(start + BLOCK, result.size)
        yield start, {n: result.store.read(n, start, stop) for n in result.store.names}


def _csv(result: Any, file: Path) -> None:
    """One row a design, the unit behind each name; what the file is stands beside it as JSON."""
    names = result.store.names
    status = {int(member): member.text for member in Status}
    with writing(file) as part, part.open("w", encoding="utf-8", newline="") as out:
        out.write(",".join(["design", *(f"{n} [{result.unit(n)}]" for n in names[:-1]), "status"]))
        out.write("\n")
        for start, columns in _blocks(result):
            rows = zip(*(columns[name].tolist() for name in names), strict=True)
            out.writelines(
                f"{start + i},{','.join(map(repr, row[:-1]))},{status[row[-1]]}\n"
                for i, row in enumerate(rows)
            )
    write_text(file.with_suffix(".json"), json.dumps(attributes(result), indent=1))


def _parquet(result: Any, file: Path) -> None:
    pa, pq = require("pyarrow", "measured"), require("pyarrow.parquet", "measured")
    names = result.store.names
    fields = [pa.field("design", pa.int64())]
    for name in names:
        kind = pa.int8() if name == "status" else pa.float64()
        fields.append(pa.field(name, kind, metadata={"units": result.unit(name)}))
    schema = pa.schema(fields, metadata=attributes(result))
    with writing(file) as part, pq.ParquetWriter(part, schema) as writer:
        for start, columns in _blocks(result):
            index = np.arange(start, start + len(columns["status"]))
            writer.write_table(pa.table([index, *(columns[n] for n in names)], schema=schema))
