"""A case: one rig and its runs, in one folder."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import InputError
from .._reading import existing
from ._copies import Copy, share_of_recording, without_copies
from ._formats import may_be_run, read_table, stem_of
from ._read import read_recording
from ._recording import Fault, Recording
from ._shorten import first, thinned
from ._sidecar import read_sidecar


@dataclasses.dataclass
class Case:
    """One rig and its runs; `faults` are the folder's, `all_faults` those of the runs too.

    `measured` holds the whole runs where `runs` are parts of them.  Figures are SI.
    """

    path: Path
    rig: Any
    runs: list[Recording]
    rig_path: Path
    faults: list[Fault] = dataclasses.field(default_factory=list)
    measured: list[Recording] = dataclasses.field(default_factory=list)

    @property
    def train(self) -> list[Recording]:
        """Runs to learn from."""
        return [run for run in self.runs if not run.held_out]

    @property
    def held_out(self) -> list[Recording]:
        """Runs that are never fitted."""
        return [run for run in self.runs if run.held_out]

    @property
    def all_faults(self) -> list[Fault]:
        """Everything wrong with the folder and its runs."""
        return [*self.faults, *(fault for run in self.runs for fault in run.faults)]

    @property
    def noise_runs(self) -> list[Recording]:
        """The runs that say most about the noise: the whole ones."""
        return self.measured or self.runs

    def thinned(self, every: int) -> "Case":
        """The case with one sample in `every` of each run, for runs that are too many for memory.

        Outputs stay as measured, inputs are averaged onto the kept times.  Raises `InputError`
        where `every` is below 1 or leaves less than two samples.
        """
        runs = [thinned(run, every) for run in self.runs]
        return dataclasses.replace(self, runs=runs, measured=self.noise_runs)

    def first(self, seconds: float) -> "Case":
        """The case with the first `seconds` of each run.

        Raises `InputError` where less than two samples lie in them.
        """
        runs = [first(run, seconds) for run in self.runs]
        return dataclasses.replace(self, runs=runs, measured=self.noise_runs)

    def __repr__(self) -> str:
        runs = "\n  ".join(map(repr, self.runs))
        return (
            f"Case({self.path.name}: {self.rig_path.name}, {len(self.all_faults)} faults\n  {runs})"
        )


def read_case(folder: str | Path, rig: Any = None) -> Case:
    """Read a folder with one rig file and its runs.  `rig` (a `Rig` or a path) overrides the file.

    A run that cannot be used at all is a fault of the case; `InputError` where none is left.

    Columns are SI.  Raises `InputError` for what is no folder, and for one without a usable run.
    """
    folder = existing(folder, "folder: a case is one, with a rig file and its runs")
    faults: list[Fault] = []
    paths = _tables(folder, faults)
    rig_path = _rig_path(folder, paths, rig)
    if rig is None or isinstance(rig, (str, Path)):
        from ..rig import load_rig

        rig = load_rig(rig_path)
    runs = []
    for path in paths:
        try:
            runs.append(read_recording(path, rig))
        except InputError as error:
            what = str(error).removeprefix(path.name).lstrip(":, ").removesuffix(".")
            faults.append(Fault(path.name, "", (), "unusable", what, "the run is not used"))
    if not runs:
        said = [x.what if x.file in x.what else f"{x.file}: {x.what}" for x in faults]
        raise InputError("\n- ".join([f"{folder}: no run can be used.", *said]))
    runs, copies = without_copies(runs, lambda run: run.held_out, share_of_recording)
    faults += [_copied(copy) for copy in copies] + _between(runs)
    return Case(folder, rig, runs, rig_path, faults)


def _copied(copy: Copy[Recording]) -> Fault:
    """That a run was left out as a copy of another one."""
    what, use = copy.said(copy.other.path.name), "the run is not used: they count once"
    if copy.run.held_out:
        what, use = f"{what}: it confirms nothing", "the run is not used as held-out"
    return Fault(copy.run.path.name, "", (), "same samples", what, use)


def _tables(folder: Path, faults: list[Fault]) -> list[Path]:
    """The runs' files: those with a NAME.toml, and other tables that have a column `t`."""
    files: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        stem = stem_of(path)
        if not may_be_run(path) or (stem in files and path.suffix == ".json"):
            continue
        if stem in files:
            what = f"{files[stem].name} has the same name"
            faults.append(Fault(path.name, "", (), "double file", what, "only that one is used"))
        elif (folder / f"{stem}.toml").exists() or _has_time(path):
            files[stem] = path
        else:
            what = "the file has neither a NAME.toml nor a column `t`"
            faults.append(Fault(path.name, "", (), "not a run", what, "it is not used"))
    for path in sorted(folder.glob("*.toml")):
        if path.stem not in files and _is_sidecar(path):
            what = "the run that belongs to it is not there"
            faults.append(Fault(path.name, "", (), "no run", what, "it is not used"))
    return list(files.values())


def _has_time(path: Path) -> bool:
    try:
        return "t" in read_table(path).columns
    except InputError:
        return True  # reading it as a run says why it cannot be read


def _is_sidecar(path: Path) -> bool:
    try:
        sidecar = read_sidecar(path)
    except InputError:
        return False
    return sidecar.rig is not None or bool(sidecar.noise or sidecar.channels)


def _rig_path(folder: Path, paths: list[Path], rig: Any) -> Path:
    """The rig file that the runs name; else `rig.toml`."""
    if isinstance(rig, (str, Path)):
        return Path(rig)
    named: dict[Path, str] = {}
    for path in paths:
        sidecar = folder / f"{stem_of(path)}.toml"
        try:
            given = read_sidecar(sidecar).rig
        except InputError:
            continue  # said when the run itself is read
        if given is not None:
            named.setdefault(given.resolve(), f"{sidecar.name} names {given.name}")
    if len(named) > 1 and rig is None:
        raise InputError(
            f"{folder}: the runs belong to different rigs: {'; '.join(named.values())}."
        )
    chosen = next(iter(named), folder / "rig.toml")
    if rig is None and not chosen.is_file():
        said = next(iter(named.values()), "no run names one and there is no rig.toml")
        raise InputError(f"{folder}: no rig file: {said}.")
    return chosen


def _between(runs: list[Recording]) -> list[Fault]:
    """Faults that only show when runs are put side by side."""
    faults = []
    common = float(np.median([run.step for run in runs]))
    for run in runs:
        if abs(run.step - common) > 0.01 * common:
            what = f"sampled at {1 / run.step:g} Hz, other runs at {1 / common:g} Hz"
            use = "each run is analysed at its own rate"
            faults.append(Fault(run.path.name, "t", (), "different sampling", what, use))
    groups = set().union(*(run.groups for run in runs))
    for run in runs:
        for group in sorted(groups - set(run.groups)):
            what = "other runs have this output"
            use = "this run says nothing about it"
            faults.append(Fault(run.path.name, group, (), "missing output", what, use))
    roles = {run.role for run in runs}
    if len(roles) == 1:
        lacking = "held-out" if roles == {"train"} else "train"
        what = f"no run has the role {lacking}"
        faults.append(
            Fault(runs[0].path.parent.name, "", (), "roles", what, "a diagnosis says what it does")
        )
    return faults
