"""What `check` and `simulate` do for a machine file."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ._options import emit


def machine_summary(path: str) -> dict[str, Any]:
    """What a machine file says; `InputError` with every problem at once."""
    from ..machine import KEYS, load_machine

    file = load_machine(path)
    axis: Any = file.machine
    numbers = {}
    unused = {"servo"} if axis.drives != "goal" else set()
    unused |= {"second"} if axis.second_inertia is None else set()
    for table, keys in KEYS.items():
        if table in unused:
            continue
        for name, key in keys.items():
            value = getattr(axis, key.field)
            if value is not None:
                unit = key.quantity(axis.motion).unit
                numbers[f"{table}.{name}"] = {"value": float(value), "unit": unit}
    uncertain = {file.names[k]: v for k, v in file.uncertainty.items()}
    return {
        "kind": "axis", "motion": axis.motion, "input": axis.drives,
        "inputs": axis.inputs, "numbers": numbers, "uncertainty": uncertain,
        "memory": axis.memory(), "effects": [x.law.id for x in file.placed],
    }  # fmt: skip


def machine_lines(path: str, summary: dict[str, Any]) -> Iterator[str]:
    """The same for people."""
    yield f"{path}: an axis ({summary['motion']}), driven by {summary['input']}"
    for key, x in summary["numbers"].items():
        about = summary["uncertainty"].get(key)
        yield f"  {key:<22} {x['value']:.6g} {x['unit']}" + (f"  ± {about:g}" if about else "")
    for key in [k for k in summary["uncertainty"] if k not in summary["numbers"]]:
        yield f"  {key:<22} uncertain"
    if summary["effects"]:
        yield f"  effects: {', '.join(summary['effects'])}"
    forgets = summary["memory"]
    held = "nothing pulls it back: it is compared by the balance of accelerations"
    yield f"  {f'forgets its start in {forgets:.3g} s' if forgets < float('inf') else held}"


def simulate_machine(path: str, log: Path | None, out: Path | None, json: bool) -> int:
    """A free run under the inputs of a log; CSV with t, input and outputs."""
    import numpy as np

    from .._errors import InputError
    from .._files import claim, write_text
    from ..machine import free_run, load_machine, log_beside, read_log

    file = load_machine(path)
    if log is None:
        raise InputError("a machine is simulated under the inputs of a log: --drive LOG.")
    if out is not None and out.suffix != ".csv":
        raise InputError(f"--out of a machine's run must end in .csv, but is {out.name}.")
    run = read_log(log_beside(log), file.machine.inputs, file.machine.outputs)
    if out is not None:
        claim([out])
    q = run.outputs["position"]
    start = {"position": (q[0], (q[1] - q[0]) / run.step)}
    hold = file.compare.hold
    found = free_run(file.machine, file.placed, start, run.inputs, run.step, hold)
    table = {"t": run.time, **run.inputs, **found}
    if out is not None:
        rows = [",".join(table), *(",".join(f"{x:.10g}" for x in row)
                                   for row in np.stack(list(table.values()), 1))]  # fmt: skip
        write_text(out, "\n".join(rows) + "\n")
    error = q - found["position"]
    summary = {
        "samples": len(run.time), "step": run.step, "out": None if out is None else str(out),
        "rms": float(np.sqrt(np.mean(error**2))), "mae": float(np.mean(np.abs(error))),
        "faults": run.faults,
    }  # fmt: skip
    unit = file.machine.outputs["position"]
    emit(json, summary, lambda: print(
        f"{len(run.time)} samples; measured less simulated: RMS {summary['rms']:.4g}, "
        f"MAE {summary['mae']:.4g} {unit}" + (f"; wrote {out}" if out else "")))  # fmt: skip
    return 0
