"""What commands do for a machine file."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..._errors import InputError, tell
from ..._files import claim, write_text
from .options import check_ending, command_line, emit

COMPARED = {"balance": "the balance of accelerations", "free-run": "free runs"}


def machine_summary(path: str) -> dict[str, Any]:
    """What a machine file says; `InputError` with every problem at once."""
    from ...machine import criterion_of, load_machine, numbers_of

    file = load_machine(path)
    axis: Any = file.machine
    numbers = {
        path: {"value": float(value), "unit": key.quantity(axis.motion).unit}
        for path, key, value in numbers_of(axis)
    }
    uncertain = {file.names[k]: v for k, v in file.uncertainty.items()}
    return {
        "kind": "axis", "motion": axis.motion, "input": axis.drives,
        "inputs": axis.inputs, "numbers": numbers, "uncertainty": uncertain,
        "memory": axis.memory(), "criterion": criterion_of(file, axis.memory()),
        "effects": [x.law.id for x in file.placed], "assumed": list(file.assumed),
    }  # fmt: skip


def machine_lines(path: str, summary: dict[str, Any]) -> Iterator[str]:
    """The same for people."""
    from ..._text import written

    yield f"{path}: an axis ({summary['motion']}), driven by {summary['input']}"
    for key, x in summary["numbers"].items():
        about = summary["uncertainty"].get(key)
        unit = written(x["unit"])
        value = f"{x['value']:.6g} {unit}".rstrip()
        yield f"  {key:<22} {value}" + (f"  ± {_spread(about, x['value'], unit)}" if about else "")
    for key in [k for k in summary["uncertainty"] if k not in summary["numbers"]]:
        yield f"  {key:<22} uncertain"
    if summary["effects"]:
        yield f"  effects: {', '.join(summary['effects'])}"
    yield from (f"  {said}" for said in summary["assumed"])
    forgets = summary["memory"]
    back = f"forgets its start in {forgets:.3g} s"
    back = back if forgets < float("inf") else "nothing pulls it back"
    yield f"  {back}: it is compared by {COMPARED[summary['criterion']]}"


def _spread(sigma: float, value: float, unit: str) -> str:
    """A 1-sigma as `[uncertainty]` has it: a share of `value`, or absolute where that is 0."""
    return f"{sigma:g} {unit}".rstrip() if value == 0 else f"{100 * sigma:g} %"


def _run_of(file: Any, log: Path | None, compared: bool = True) -> Any:
    """The log that a machine moves under, for a study `compared` with what it measured.

    What is wrong with it is told.
    """
    from ...machine import log_beside, read_log

    if log is None:
        raise InputError("a machine moves under the inputs of a log: --drive LOG.")
    run = read_log(log_beside(log), file.machine.inputs, file.machine.outputs, compared)
    tell(run.faults)
    return run


def refuse(given: dict[str, Any], command: str) -> None:
    """`InputError` for options that a machine's study has not."""
    wrong = [f"--{k} belongs to rigs: `{command}` of a machine file does not take it."
             for k, v in given.items() if v]  # fmt: skip
    if wrong:
        raise InputError(wrong)


def sweep_axis(path: str, log: Path | None, vary: list[str], metric: str, sampling: Any,
               out: Path | None, overwrite: bool, json: bool) -> int:  # fmt: skip
    """Misfits of a machine's free run over its numbers; `out` is a netCDF file."""
    from ...machine import load_machine
    from ...study import sweep_machine

    check_ending(out, ".nc")
    file = load_machine(path)
    run = _run_of(file, log)
    claim([out], force=overwrite)
    result = sweep_machine(file, run, vary, metric, sampler=sampling.sampler,
                          samples=sampling.samples, seed=sampling.seed)  # fmt: skip
    if out is not None:
        result.save(out)
    best = {}
    for m, name in enumerate(result.metrics):
        k = result.best(name)
        if k is not None:
            design = dict(zip(result.paths, map(float, result.values[k]), strict=True))
            best[name] = {
                "design": k,
                "unit": result.unit,
                name: float(result.figures[k, m]),
            } | design
    summary = {"designs": len(result.values), "method": "free-run", "failed": result.failed,
               "best": best, "out": None if out is None else str(out)}  # fmt: skip
    emit(json, summary, lambda: print("\n".join(result.sentences())))
    return 0


def sensitivity_axis(path: str, log: Path | None, metric: str, parameters: list[str]) -> tuple:
    """(sensitivities of a machine's misfit, what makes its page again)."""
    from ...machine import load_machine, machine_text
    from ...report import provenance
    from ...study import sensitivity_machine

    file = load_machine(path)
    result = sensitivity_machine(file, _run_of(file, log), metric, parameters or None)
    return result, lambda: provenance(command_line(), machine_text(file))


def replay_axis(path: Path, log: Path | None, page: Path, title: str | None, force: bool,
                json: bool) -> None:  # fmt: skip
    """A page with the signals of a machine's free run under a log's inputs; no scene."""
    from ...machine import load_machine, machine_text
    from ...report import provenance, signals_page

    file = load_machine(path)
    run = _run_of(file, log)
    claim([page], force=force)
    made = provenance(command_line(), machine_text(file))
    text = signals_page(title or run.name, signals_of(file, run), made).html()
    write_text(page, text)
    size = len(text.encode())
    emit(json, {"page": str(page), "bytes": size}, lambda: print(f"{page} ({size / 1e6:.2f} MB)"))


def signals_of(file: Any, run: Any) -> list[tuple[str, str, dict[str, Any]]]:
    """(word, unit, curves over time) of a free run under a log's inputs, beside what was measured.

    A curve is (times, values).
    """
    from ...machine import free_run_of

    simulated, units, name = free_run_of(file, run), file.machine.outputs, run.measured
    other = "velocity" if name == "position" else "position"
    out = [(name, units[name], {"simulated": simulated[name], "measured": run.shown}),
           ("measured less simulated", units[name], {"": run.shown - simulated[name]}),
           (other, units[other], {"simulated": simulated[other]})]  # fmt: skip
    out += [(k, file.machine.inputs[k], {"": x}) for k, x in run.inputs.items() if x.std() > 0]
    return [(w, u, {k: (run.time, x) for k, x in c.items()}) for w, u, c in out]


def simulate_machine(path: str, log: Path | None, out: Path | None, json: bool) -> int:
    """A free run under the inputs of a log; CSV with t, input and outputs."""
    from ...machine import free_run_of, load_machine

    file = load_machine(path)
    check_ending(out, ".csv")
    run = _run_of(file, log, compared=False)
    if out is not None:
        claim([out])
    simulated = free_run_of(file, run)
    if out is not None:
        write_text(out, _csv({"t": run.time, **run.inputs, **simulated}))
    summary = {"samples": len(run.time), "step": run.step, "out": None if out is None else str(out)}
    summary |= _misfit(run, simulated) | {"faults": run.faults}
    emit(json, summary, lambda: print(_sentence(file, run, summary)))
    return 0


def _csv(table: dict[str, Any]) -> str:
    """Columns (t,) by name as text."""
    rows = zip(*table.values(), strict=True)
    lines = [",".join(table), *(",".join(f"{x:.10g}" for x in row) for row in rows)]
    return "\n".join(lines) + "\n"


def _misfit(run: Any, simulated: dict[str, Any]) -> dict[str, float | None]:
    """RMS and mean size of measured less simulated; None under inputs alone."""
    import numpy as np

    if not run.is_compared:
        return {"rms": None, "mae": None}
    error = run.shown - simulated[run.measured]
    return {"rms": float(np.sqrt(np.mean(error**2))), "mae": float(np.mean(np.abs(error)))}


def _sentence(file: Any, run: Any, summary: dict[str, Any]) -> str:
    """The run for people."""
    said = "the log measured no motion: the machine began at rest at 0"
    if run.is_compared:
        unit = file.machine.outputs[run.measured]
        rms, mae = summary["rms"], summary["mae"]
        said = f"measured less simulated: RMS {rms:.4g}, MAE {mae:.4g} {unit}"
    wrote = f"; wrote {summary['out']}" if summary["out"] else ""
    return f"{summary['samples']} samples; {said}{wrote}"
