"""What does the baseline of a measured motor-and-screw axis lack?

EMPS: A. Janot, M. Gautier, M. Brunot, "Data Set and Reference Models of EMPS", Nonlinear System
Identification Benchmarks workshop, 2019.  Baseline: M q'' + Fv q' = force + offset.

The first two thirds of the estimation file train, its last third accepts; the file with pulses is
read after that, once.  The position's low pass (100 Hz) is the published one; the noise comes from
differences of the measured position, not from a filtered signal.
"""

import sys
from pathlib import Path

from omnijax.diagnosis import diagnose, force_error
from omnijax.machine import LogFile, MachineCase, parse_machine, read_log

DATA = Path(__file__).parents[1] / ".." / "shared" / "realdata" / "emps"
AXIS = {
    "kind": "axis", "motion": "translation", "axis": {"inertia": 100.0, "damping": 300.0},
    "motor": {"input": "command", "torque_constant": 35.1507}, "compare": {"cutoff": 100.0},
    "uncertainty": {"axis.inertia": 1.0, "axis.damping": 1.0, "axis.offset": 20.0},
}  # fmt: skip


def main(folder: Path = DATA, tell=print) -> dict:
    """Diagnose, and return what was named and the relative force errors in per cent."""
    file = parse_machine(AXIS)

    def log(name: str, rows=None, role="train"):
        about = LogFile(folder / f"{name}.toml", folder / f"{name}.mat", role=role, rows=rows,
                        channels={"input": "vir", "position": "qm"})  # fmt: skip
        return read_log(about, file.machine.inputs, file.machine.outputs)

    whole, cut = log("DATA_EMPS"), 16560
    parts = [log("DATA_EMPS", (0, cut)), log("DATA_EMPS", (cut, len(whole.time)), "held-out")]
    found = diagnose(MachineCase(folder, file, parts, False, []), tell=tell)
    errors = force_error(found, whole, log("DATA_EMPS_PULSES"))  # refitted on the whole file
    lines = [e.parameters["order"]["value"] for e in found.effects if e.id == "motor-ripple"]
    free = {f"free run {k}, {r['role']}, mm": 1e3 * r[k]["rms"]
            for r in found.free_runs for k in ("before", "after")}  # fmt: skip
    names = [e.id for e in found.effects]
    return {"found": found, "names": names, "lines": lines, **errors, **free}


if __name__ == "__main__":
    if not DATA.is_dir():
        sys.exit(f"{DATA} is absent: this experiment needs the measured data.")
    answer = main()
    print(*(f"{k}: {v}" for k, v in answer.items()), sep="\n")
    assert answer["names"][0] == "bearing-coulomb", answer
    assert {"friction-asymmetry", "viscous-asymmetry"} & set(answer["names"]), answer
    assert any(abs(x - 2513.27) < 0.005 * 2513.27 for x in answer["lines"]), answer
    assert answer["train"] <= 3.2, answer
    assert answer["cross-test"] <= 5.4, answer
