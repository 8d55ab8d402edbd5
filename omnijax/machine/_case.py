"""A case of a machine: machine.toml (or a model of the user's) and its logs, in one folder."""

import dataclasses
from pathlib import Path

import numpy as np

from .._errors import InputError
from .._reading import existing, read_toml
from ..recording import Copy, RunSamples, share_in, stem_of, without_copies
from ._file import MachineFile, load_machine
from ._log import Log, LogFile, read_log, read_log_file, tables_of

HELD = 1 / 3  # of every log, its end, where no log has the role held-out


@dataclasses.dataclass
class MachineCase:
    """A machine and its logs; `blocks`: the ends of the logs play the held-out run."""

    path: Path
    file: MachineFile
    logs: list[Log]
    blocks: bool
    faults: list[str]


def is_machine_case(folder: str | Path) -> bool:
    """Whether a folder holds a machine.toml."""
    return (Path(folder) / "machine.toml").is_file()


def read_machine_case(folder: str | Path, file: MachineFile | None = None) -> MachineCase:
    """The machine of a folder (or `file`) and its runs; `InputError` where none can be used."""
    folder = existing(folder, "folder: a case is one, with machine.toml and logs")
    own = folder / "machine.toml"
    machine = load_machine(own) if file is None else file
    logs, faults = [], []
    for one in _log_files(folder):
        try:
            if file is None:
                _check_machine(one, own)
            logs.append(read_log(one, machine.machine.inputs, machine.machine.outputs))
        except InputError as error:
            faults += [f"{x} The run is not used." for x in error.problems]
    logs, copies = without_copies(logs, lambda log: log.role == "held-out", _share)
    faults += map(_copied, copies)
    if not logs:
        raise InputError("\n- ".join([f"{folder}: no run can be used.", *faults]))
    faults += [x for log in logs for x in log.faults]
    blocks = all(log.role == "train" for log in logs)
    if all(log.role == "held-out" for log in logs):
        raise InputError(f'{folder}: every run is held-out; at least one must be `role = "train"`.')
    if blocks:
        faults.append(
            f"{folder.name}: no run has the role held-out; the last third of each plays it."
        )
        logs = [part for log in logs for part in _parts(log)]
    return MachineCase(folder, machine, logs, blocks, faults)


def _check_machine(log: LogFile, own: Path) -> None:
    """`InputError` for a log of another machine than that of the case's `own` file."""
    if log.machine is None or log.machine.resolve() == own.resolve():
        return
    raise InputError(
        f"{log.path.name}: `machine` names {log.machine}, but the machine of this case is "
        f"{own.name} beside it."
    )


def _share(log: Log, other: Log) -> float:
    """Share of a log's samples that stand in another one: by its rows of one file, or by value."""
    by_rows = 0.0
    if log.rows is not None and other.rows is not None:
        by_rows = log.rows.share_in(other.rows)
    one, whole = (
        RunSamples(x.time, {x.measured: x.shown} if x.is_compared else {}, x.inputs)
        for x in (log, other)
    )
    return max(by_rows, share_in(one, whole))


def _copied(copy: Copy[Log]) -> str:
    """That a log was left out as a copy of another one."""
    what = f"{copy.run.name} {copy.said(copy.other.name)}"
    if copy.run.role == "held-out":
        return f"{what}: it confirms nothing, and is not used as held-out."
    return f"{what}: they count once, and it is not used."


def _log_files(folder: Path) -> list[LogFile]:
    tables, out = tables_of(folder), []
    for path in sorted(folder.glob("*.toml")):
        if path.name == "machine.toml" or path.stem.endswith("-diagnosed"):
            continue
        data = read_toml(path)
        if path.stem in tables or "log" in data:
            out.append(read_log_file(path, data, tables.pop(path.stem, None)))
    beside = [f.log.resolve() for f in out]
    for name, table in tables.items():
        if table.resolve() not in beside:
            out.append(LogFile(folder / f"{name}.toml", table))
    return out


def log_beside(path: str | Path) -> LogFile:
    """A log with the NAME.toml beside it: either of both may be named.

    Raises `InputError` where there is no such file.
    """
    path = Path(path)
    if path.suffix.lower() == ".toml":
        table = tables_of(path.parent).get(path.stem)
        return read_log_file(path, read_toml(path), table)
    if not path.is_file():
        raise InputError(f"{path} is not a file.")
    side = path.with_name(stem_of(path) + ".toml")
    return read_log_file(side, read_toml(side), path) if side.is_file() else LogFile(side, path)


def _parts(log: Log) -> list[Log]:
    """The first two thirds, and the last third as held-out."""
    n = len(log.time)
    cut = n - round(HELD * n)

    def part(role, where):
        return dataclasses.replace(
            log, name=f"{log.name} {role}", role=role, time=np.asarray(log.time[where]),
            inputs={k: x[where] for k, x in log.inputs.items()},
            outputs={k: x[where] for k, x in log.outputs.items()}, rows=None,
        )  # fmt: skip

    return [part("train", slice(None, cut)), part("held-out", slice(cut, None))]
