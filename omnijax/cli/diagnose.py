"""`omnijax diagnose`: find and name the effect that a simulation lacks."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from .._files import claim, write_text
from .._reading import existing
from ._console import give_back_freed_memory, keep_freed_memory, stages
from ._inputs import Force, Json, Whole, above_zero, command_line, emit

WINDOW = 1.0  # s


def diagnose(
    case: Path,
    /,
    *,
    out: Path | None = None,
    rig: Path | None = None,
    law: Annotated[list[Path] | None, Parameter(negative="")] = None,
    model: Path | None = None,
    window: float = WINDOW,
    thin: Whole = 1,
    first: str | None = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Find where simulation and data disagree, name the missing effect, and add it.

    Example: omnijax diagnose recordings/case-01 --out diagnosis/case-01

    Writes diagnosis.json, rig-diagnosed.toml, index.html and its figures into --out.

    Parameters
    ----------
    case
        A folder with one rig file, or one machine.toml (an axis), and its runs (CSV, Parquet, MAT,
        NetCDF, JSON with a TOML beside).
    out
        Folder of the results; default: diagnosis-CASE in the current folder.
    rig
        Another rig file than the folder's.
    law
        A Python file with laws of your own that join the candidates; may be given several times.
    model
        A Python file with a machine of your own, a class that derives from AbstractMachine; the
        file is run.
    window
        Seconds after which Omega and the rolled lengths of a rig start anew.
    thin
        Compare one sample in so many, of runs that are too many for memory.
    first
        Use the first so much of every run (15s).
    """
    keep_freed_memory()
    from .._errors import InputError

    existing(case, "folder: a case is one, with a rig file or machine.toml and its runs")
    from ..diagnosis import diagnose as run
    from ..rig import load_laws

    if not 0.01 <= window <= 1e4:
        raise InputError(f"--window must lie in [0.01, 10000] s, but is {window:g}.")
    laws: dict[str, Any] = {}
    for file in law or []:
        own = load_laws(file)
        twice = [id for id in own if laws.get(id, own[id]) is not own[id]]
        if twice:
            raise InputError(f"{file}: another --law has a law of the id `{twice[0]}` already.")
        laws |= own
    folder = out or Path(f"diagnosis-{case.resolve().name}")
    asked = _less(_case(case, rig, model), window, thin, above_zero("first", first, "s"))
    claim(folders=[folder], force=force)
    with stages() as say:

        def tell(text: str) -> None:
            give_back_freed_memory()
            say(text)

        diagnosis = run(asked, laws=laws, window=window, tell=tell)
        tell("drawing the page")
        tell(f"wrote {folder}/index.html, diagnosis.json, {_write(diagnosis, folder)}")
    emit(json, diagnosis.to_dict(), lambda: _print(diagnosis))
    return 0


def _case(folder: Path, rig: Path | None, model: Path | None) -> Any:
    """The case of a rig, of an axis, or of a machine of the user's own."""
    from .._errors import InputError
    from ..machine import is_machine_case, load_model, read_machine_case
    from ..recording import read_case

    if model is None and not is_machine_case(folder):
        return read_case(folder, rig)
    if rig is not None:
        raise InputError("--rig speaks of a rig, but the case is that of a machine.")
    return read_machine_case(folder, None if model is None else load_model(model))


def _less(case: Any, window: float, thin: int, seconds: float | None) -> Any:
    """The case with what `--thin` and `--first` leave of its runs.

    `InputError` for these, and for a `window`, where it is no rig's.
    """
    from .._errors import InputError
    from ..recording import Case

    if not isinstance(case, Case):
        if window != WINDOW:
            raise InputError("--window speaks of a rig's runs; those of another machine have none.")
        if thin != 1 or seconds is not None:
            raise InputError(
                "--thin and --first speak of a rig's runs: of a machine's log, `rows = [first, "
                "end]` in its NAME.toml chooses a part."
            )
        return case
    if thin < 1:
        raise InputError(f"`thin` is {thin}, but must be 1 or more: one sample in so many is kept.")
    return (case if seconds is None else case.first(seconds)).thinned(thin)


def _write(diagnosis: Any, folder: Path) -> str:
    """The answer's files; the name of the machine's with the effects added.

    Or why there is none: an effect may stand beside one of its kind that the machine has there.
    """
    from .._errors import InputError
    from ..report import diagnosis_page
    from ..rig import Rig, save_laws, save_rig

    made = "rig-diagnosed.toml" if isinstance(diagnosis.rig, Rig) else "machine-diagnosed.toml"
    refused = ""
    try:
        if isinstance(diagnosis.rig, Rig):
            save_rig(diagnosis.rig, folder / made)
        else:
            save_laws((one.law for one in diagnosis.rig.placed), folder, "machine")
            write_text(folder / made, diagnosis.details["evidence"].text(diagnosis.rig))
    except InputError as why:
        refused = f"no {made}: {why}"
        (folder / made).unlink(missing_ok=True)  # an earlier answer's
        diagnosis.notes.append(f"There is {refused}")
    diagnosis.save(folder / "diagnosis.json")
    diagnosis_page(diagnosis, command_line()).write(folder)
    return f"but {refused}" if refused else made


def _print(diagnosis: Any) -> None:
    """The answer in a few lines."""
    from .._text import scaled_together
    from ..laws import in_words
    from ..report import effect_sizes

    print(f"verdict: {diagnosis.verdict}")
    for fault in diagnosis.faults:
        print(f"  data: {fault}")
    for some in diagnosis.alternatives:
        for k, effect in enumerate(some):
            name = f"{effect.id} at {effect.place}"
            words = in_words(effect.id, effect.place, diagnosis.laws)
            either = "or " if k else "either " if len(some) > 1 else ""
            print(f"  {either}{name}" + ("" if words.replace("`", "") == name else f": {words}"))
            print(f"    {effect_sizes(effect)}")
    for group, gap in diagnosis.gap.items():
        factor, unit = scaled_together((gap.before, gap.after, gap.noise_floor), gap.unit)
        print(
            f"  {group}: RMS {factor * gap.before:.4g} -> {factor * gap.after:.3g} {unit}, "
            f"noise {factor * gap.noise_floor:.3g}"
        )
    if diagnosis.remainder:
        print(f"  {diagnosis.remainder}")
    for run in diagnosis.free_runs:
        said = [
            f"{word} RMS {run[word]['rms']:.4g}, MAE {run[word]['mae']:.4g} {run['unit']}"
            + ("" if run[word]["percent"] is None else f" ({run[word]['percent']:.3g} %)")
            for word in ("before", "after") if word in run and run[word]["rms"] is not None
        ]  # fmt: skip
        print(f"  free run of {run['run']} ({run['role']}): {'; '.join(said) or 'left all bounds'}")
    if diagnosis.one_step:
        missed = " -> ".join(f"{x:.3g}" for x in diagnosis.one_step.values())
        print(f"  the balance misses on {diagnosis.judges.name}: {missed} % of the motor's torque")
    if diagnosis.learned:
        print(
            f"  learned, uninterpreted term at {diagnosis.learned['port']}: closes "
            f"{100 * diagnosis.learned['closed']:.0f} % of the gap on {diagnosis.judges.name}"
        )
    if diagnosis.next_experiment:
        print(f"  next experiment: {diagnosis.next_experiment['drive']}")
