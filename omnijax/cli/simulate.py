"""`omnijax simulate`: one run of a rig."""

import sys
from dataclasses import dataclass, field
from json import dumps as json_text
from pathlib import Path
from typing import Any, NamedTuple

from .._files import claim
from .._interrupts import NOTHING, resumable
from .._reading import existing
from ._console import paragraph
from ._inputs import (
    PICTURES,
    AskedDrive,
    Json,
    MotionOptions,
    NumericsOptions,
    Overwrite,
    asked,
    check_ending,
    command_line,
    emit,
    file_kind,
    refuse,
    simulate_machine,
)
from ._simulate import compared, differences, lay_over, show, summarise


def simulate(
    rig: str,
    /,
    *,
    motion: MotionOptions = MotionOptions(),
    drive: Path | None = None,
    out: Path | None = None,
    plot: Path | None = None,
    compare: Path | None = None,
    numerics: NumericsOptions = NumericsOptions(),
    resume: bool = False,
    overwrite: Overwrite = False,
    json: Json = False,
) -> int:
    """Simulate one run: prescribed wheel speeds, motor torques, or the inputs of a recording.

    Example: omnijax simulate atlas --speed 0.1,1.2,0.3 --duration 8s --out run.nc

    Example: omnijax simulate rig.toml --drive run-1.csv.gz --out run.csv.gz --plot run.png

    A value `from..to` is a ramp over the whole run: --speed 0..30rpm,0,10rpm.

    Parameters
    ----------
    rig
        A rig file, the name of a bundled rig, or a machine file (an axis).
    drive
        A table of wheel speeds (columns t, speed_1, speed_2 ...; a header may say: speed_1 (rpm)),
        or a recording: its torques, force and first wheel angles, sampled at its times.
    out
        File of the run: .nc (every channel), or .csv, .csv.gz, .parquet (a recording).
    plot
        Picture of the run (.png, .svg, .pdf).
    compare
        A measured run to be laid over the simulated one in --plot; its difference is printed.
    resume
        Go on with the interrupted or killed run in --out, with none from the start, and show one
        that is whole; the other options must be the same.
    """
    _keep_programs()
    if file_kind(rig) == "machine":
        refuse(vars(motion) | {"plot": plot, "compare": compare, "resume": resume}, "simulate")
        return simulate_machine(rig, drive, out, json)
    _check_files(out, plot)
    for file in (drive, compare):
        if file is not None:
            existing(file)
    numerics.checked()
    from ..rig import load_rig

    machine = load_rig(rig)
    wanted = asked(machine, motion, drive)
    measured = None if compare is None else compared(compare, machine, plot)
    _claim(rig, machine, out, plot, resume, overwrite)
    begun = _begin(machine, wanted, numerics, FilesOfRun(out, plot), resume, overwrite)
    with resumable(begun.kept):
        run = begun.run()
        begun.files.whole = run.ok
        summary = summarise(run, machine) | {"rig": rig, "faults": [str(f) for f in wanted.faults]}
        summary["warnings"] = _remarks(machine, wanted, numerics.model)
        for warning in summary["warnings"]:
            print(paragraph(f"warning: {warning}", "  "), file=sys.stderr)
        if measured is not None:
            summary["differences"] = differences(run, machine, measured)
        summary |= _written(run, begun, rig, machine, out, plot, measured)
    emit(json, summary, lambda: show(summary))
    return _code(run)


def _remarks(rig: Any, wanted: AskedDrive, model: str) -> list[str]:
    """What the wheels' places and speeds say against the run."""
    from ..simulation import remarks

    return remarks(rig, wanted.drive, (float(wanted.times[0]), float(wanted.times[-1])), model)


def _keep_programs() -> None:
    """A failed check inside the compiled solve gives NaN, hence a status.

    It then needs no call back to Python; without one, JAX keeps the program for the next process.
    """
    import os

    os.environ.setdefault("EQX_ON_ERROR", "nan")


@dataclass
class FilesOfRun:
    """Whether the run has reached its end, and which of its files are written."""

    out: Path | None
    plot: Path | None
    whole: bool = False
    written: list[Path] = field(default_factory=list)

    def kept(self, pieces: Any, command: str) -> str:
        """What an interruption behind the run leaves, what is missing, and how to go on."""
        files = [file for file in (self.out, self.plot) if file is not None]
        missing = [str(file) for file in files if file not in self.written]
        stored = "" if pieces is None or not pieces.count else f"the run is whole in {pieces.path}"
        if not missing or not (self.written or stored):
            return NOTHING
        there = [f"{file} is written" for file in self.written]
        there += [stored] if stored else []
        goes_on = "--resume" if self.out is not None and (stored or _is_netcdf(self.out)) else ""
        return (
            f"Interrupted: {' and '.join(there)}. Missing: {', '.join(missing)}. This writes it: "
            f"{command} {goes_on or '--overwrite'}"
        )


class Begun(NamedTuple):
    """A run that is asked for, with its pieces on the disk, or whole in its file."""

    plan: Any
    asked: str  # JSON
    files: FilesOfRun
    pieces: Any = None
    whole: Any = None

    def run(self) -> Any:
        """The run, computed as far as it is not there."""
        from ._simulate import perform

        return perform(self.plan, self.pieces) if self.whole is None else self.whole

    def kept(self) -> str:
        """What an interruption leaves, and how to go on."""
        if self.files.whole:
            return self.files.kept(self.pieces, _command())
        return NOTHING if self.pieces is None else self.pieces.kept(_command())


def _begin(
    rig: Any,
    asked: AskedDrive,
    numerics: NumericsOptions,
    files: FilesOfRun,
    resume: bool,
    force: bool,
) -> Begun:
    from ._simulate import StoredPieces, asked_of, planned, whole_run

    out = files.out
    plan = planned(rig, asked.drive, asked.times, numerics)
    identity = asked_of(rig, asked.drive, asked.times, plan.how)
    text = json_text(identity)
    if resume and (run := whole_run(out, identity, force)) is not None:
        files.written += [out] if out is not None else []
        return Begun(plan, text, files, whole=run)
    _warn_of_memory(rig, len(asked.times), plan.points)
    keep = out is not None and (plan.is_long() or resume)
    pieces = StoredPieces(out, identity, resume, force) if keep and out is not None else None
    return Begun(plan, text, files, pieces)


def _warn_of_memory(rig: Any, samples: int, points: int) -> None:
    """Tell where a run needs more than half of the memory that is free."""
    from .._errors import tell
    from .._memory import SHARE, available, in_words
    from ..simulation import bytes_a_sample

    # the run, and what its figures and files take
    need = 2 * bytes_a_sample(rig.size) * samples * points
    if need > SHARE * available():
        tell([
            f"{samples} samples need about {in_words(need)} of memory, and {in_words(available())} "
            "are free: a lower --rate or a shorter --duration needs less."
        ])  # fmt: skip


def _written(
    run: Any,
    begun: Begun,
    name: str,
    rig: Any,
    out: Path | None,
    plot: Path | None,
    measured: Any,
) -> dict[str, str]:
    """The files that were asked for."""
    from ..simulation import save_trajectory

    files = {}
    if begun.whole is not None:
        files["out"] = str(out)
    elif out is not None:
        beside = _rig_file(name, rig, out)
        files["out"] = str(save_trajectory(run, out, rig, beside, _command(), begun.asked))
        begun.files.written.append(out)
        if begun.pieces is not None:
            begun.pieces.remove()
    if plot is not None:
        files["plot"] = str(_plot(run, name, rig, plot, measured))
    return files


def _command() -> str:
    """This command; resumed, it is still the same."""
    return command_line(without=("--resume", "--overwrite"))


def _code(run: Any) -> int:
    """The exit code, and on stderr what to do about a run that did not reach its end."""
    from ._frame import FAILED, OK

    if run.ok:
        return OK
    print(run.message(), file=sys.stderr)
    return FAILED


def _is_netcdf(out: Path) -> bool:
    """Whether the file of a run can hold one that shall go on."""
    return out.name.lower().endswith(".nc")


def _check_files(out: Path | None, plot: Path | None) -> None:
    if out is not None:
        from ..simulation import check_suffix

        check_suffix(out)
    check_ending(plot, *PICTURES)


def _claim(
    name: str, rig: Any, out: Path | None, plot: Path | None, resume: bool, force: bool
) -> None:
    """Every file that this run will write, before it begins."""
    from ..recording import check_beside, files_of_recording
    from ..rig import files_of_rig

    files = [plot]
    if out is not None:
        files += [out] if _is_netcdf(out) else files_of_recording(out)
        copy = _copy_of_rig(name, out)
        files += [] if copy is None else files_of_rig(rig, copy)
    claim(
        files, force=force, resumed=out if resume and out is not None and _is_netcdf(out) else None
    )
    if out is not None and not _is_netcdf(out):
        check_beside(out)


def _rig_file(name: str, rig: Any, out: Path) -> Path | None:
    """The rig file that NAME.toml of a recording names; of a bundled rig, a copy beside the run."""
    from ..rig import rig_path, save_rig

    copy = _copy_of_rig(name, out)
    return rig_path(name) if copy is None else save_rig(rig, copy)


def _copy_of_rig(name: str, out: Path) -> Path | None:
    """Where the copy of a bundled rig goes; None for a rig file of the user's, and for .nc."""
    from ..rig import bundled_rigs, rig_path

    if _is_netcdf(out) or rig_path(name) != bundled_rigs().get(name):
        return None
    return out.with_name(f"{out.name.split('.')[0]}-rig.toml")


def _plot(run: Any, name: str, rig: Any, path: Path, measured: Any) -> Path:
    from .._files import writing
    from ..report import figure, style
    from ..simulation import plot_run

    with writing(path) as part, style():
        picture, axes = figure(4)
        plot_run(run, axes)
        if measured is not None:
            lay_over(axes, run, measured)
        axes[0].set_title(Path(name).stem if run.ok else f"{Path(name).stem}: {run.message()}")
        picture.savefig(part, dpi=150)
    return path
