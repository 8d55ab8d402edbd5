"""What `check` and `simulate` do for a machine file."""

from pathlib import Path
from typing import Any

from ._options import emit


def is_machine(path: str | Path) -> bool:
    """Whether a file is a machine's: TOML with a `kind`."""
    from .._errors import InputError
    from .._reading import read_toml

    file = Path(path)
    if file.suffix != ".toml" or not file.is_file():
        return False
    try:
        return "kind" in read_toml(file)
    except InputError:  # told where it is read as what it is
        return False


def check_machine(path: str, json: bool) -> int:
    """A machine file: its numbers, or every error at once."""
    from .._errors import InputError
    from ..machine import KEYS, load_machine

    try:
        file = load_machine(path)
    except InputError as error:
        if not json:
            raise
        emit(True, {"ok": False, "problems": list(error.problems)}, lambda: None)
        return 2
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
    summary = {
        "ok": True, "kind": "axis", "motion": axis.motion, "input": axis.drives,
        "inputs": axis.inputs, "numbers": numbers, "uncertainty": uncertain,
        "memory": axis.memory(), "effects": [x.law.id for x in file.placed],
    }  # fmt: skip
    emit(json, summary, lambda: _print(path, summary))
    return 0


def _print(path: str, summary: dict) -> None:
    print(f"{path}: an axis ({summary['motion']}), driven by {summary['input']}")
    for key, x in summary["numbers"].items():
        about = summary["uncertainty"].get(key)
        print(f"  {key:<22} {x['value']:.6g} {x['unit']}" + (f"  ± {about:g}" if about else ""))
    for key in [k for k in summary["uncertainty"] if k not in summary["numbers"]]:
        print(f"  {key:<22} uncertain")
    if summary["effects"]:
        print(f"  effects: {', '.join(summary['effects'])}")
    forgets = summary["memory"]
    held = "nothing pulls it back: it is compared by the balance of accelerations"
    print(f"  {f'forgets its start in {forgets:.3g} s' if forgets < float('inf') else held}")


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
