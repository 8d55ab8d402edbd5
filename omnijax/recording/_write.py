"""A recording into a file and its NAME.toml."""

import os
from pathlib import Path

import numpy as np

from .._errors import InputError
from ._columns import columns
from ._csv import write_csv
from ._recording import Recording
from ._tables import stem_of, suffix_of


def write_recording(path: str | Path, recording: Recording) -> Path:
    """Write `.csv`, `.csv.gz` or `.parquet` and NAME.toml; every digit is kept.

    The rig file is named relative to the file.  Returns the path.
    """
    path = Path(path)
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
    path.with_name(stem_of(path) + ".toml").write_text(_sidecar(path, recording), encoding="utf-8")
    return path


def _write_parquet(path: Path, table: dict[str, np.ndarray]) -> None:
    from ._tables import need

    arrow = need("pyarrow", "pyarrow", ".parquet")
    need("pyarrow.parquet", "pyarrow", ".parquet").write_table(arrow.table(table), path)


def _sidecar(path: Path, recording: Recording) -> str:
    lines = []
    if recording.rig_path is not None:
        rig = Path(os.path.relpath(recording.rig_path.resolve(), path.parent.resolve()))
        lines.append(f"rig = {_quoted(rig.as_posix())}")
    lines.append(f"role = {_quoted(recording.role)}")
    if recording.noise:
        lines += ["", "[noise]", *(f"{k} = {float(v)!r}" for k, v in recording.noise.items())]
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
