"""A recording into a file and its NAME.toml."""

import os
from pathlib import Path

import numpy as np

from .._errors import InputError, require
from .._files import looked_at, write_text, writing
from .._reading import read_toml
from .._toml import toml_value
from ._columns import columns
from ._formats import stem_of, suffix_of, write_csv
from ._recording import Recording
from ._sidecar import KEYS


def write_recording(path: str | Path, recording: Recording) -> Path:
    """Write `.csv`, `.csv.gz` or `.parquet` and NAME.toml; every digit is kept.

    The rig file is named relative to the file.  Returns the path.

    Columns are SI.  Raises `InputError` for another ending, `OSError` where nothing can be
    written.
    """
    path = Path(path)
    _, beside = files_of_recording(path)
    check_beside(path)
    names = [c for c in columns(recording.wheels)[1:] if c in recording.channels]
    table = {"t": recording.time, **{c: recording.channels[c] for c in names}}
    suffix = suffix_of(path)
    if suffix in (".csv", ".csv.gz"):
        write_csv(path, table)
    elif suffix == ".parquet":
        _write_parquet(path, table)
    else:
        raise InputError(
            f"{path.name}: a run is written as .csv, .csv.gz or .parquet, not {suffix}."
        )
    write_text(beside, _sidecar(path, recording))
    return path


def files_of_recording(path: str | Path) -> list[Path]:
    """What `write_recording` writes."""
    path = Path(path)
    return [path, path.with_name(stem_of(path) + ".toml")]


def _write_parquet(path: Path, table: dict[str, np.ndarray]) -> None:
    arrow = require("pyarrow", "measured", "writing `.parquet` files")
    parquet = require("pyarrow.parquet", "measured", "writing `.parquet` files")
    with writing(path) as part:
        parquet.write_table(arrow.table(table), part)


def check_beside(path: str | Path) -> None:
    """`InputError` where another file than a NAME.toml has the sidecar's name: a rig file, say."""
    _, sidecar = files_of_recording(path)
    if not sidecar.exists():
        return
    try:
        with looked_at():
            keys = set(read_toml(sidecar))
    except (InputError, OSError):
        keys = {""}
    if not keys <= set(KEYS):
        raise InputError(
            "exists and is no NAME.toml of a run: give the run another name, whose .toml is free.",
            sidecar,
        )


def _sidecar(path: Path, recording: Recording) -> str:
    lines = []
    if recording.rig_path is not None:
        rig = Path(os.path.relpath(recording.rig_path.resolve(), path.parent.resolve()))
        lines.append(f"rig = {toml_value(rig.as_posix())}")
    lines.append(f"role = {toml_value(recording.role)}")
    if recording.noise:
        lines += ["", "[noise]", *(f"{k} = {float(v)!r}" for k, v in recording.noise.items())]
    return "\n".join(lines) + "\n"
