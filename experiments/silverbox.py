"""What does the linear baseline of a measured electronic oscillator lack?

Silverbox: T. Wigren, J. Schoukens, "Three free data sets for development and benchmarking in
nonlinear system identification", ECC 2013.  Baseline: m y'' + c y' + k y = u.  The multisine's
first eighth trains, the next judges; its last quarter and the arrow are simulated once, at the end.
"""

import sys
import tomllib
from pathlib import Path

import numpy as np

from omnijax.diagnosis import diagnose
from omnijax.machine import (
    LogFile,
    MachineCase,
    case_files,
    describe,
    free_run_of,
    parse_machine,
    read_log,
)

DATA = Path(__file__).parents[1] / ".." / "shared" / "realdata" / "silverbox" / "SNLS80mV.csv"
RATE = 1e7 / 2**14  # Hz
ARROW, INNER, OUTER, SINE, END = 100, 32100, 40575, 40650, 127400  # rows of the official split
PART = (END - SINE) // 8


def main(path: Path = DATA, tell=print):
    """The diagnosis, and the simulation errors of the test parts in mV."""
    guess = describe(path, None, "V1", "V2", RATE)
    text = tomllib.loads(case_files([guess])["machine.toml"])
    file = parse_machine(text | {"compare": {"hold": "band-limited"}})

    def log(first: int, end: int, role: str = "train"):
        about = LogFile(Path(f"{first}.toml"), path, role=role, rows=(first, end), rate=RATE,
                        channels={"input": "V1", "position": "V2"})  # fmt: skip
        return read_log(about, file.machine.inputs, file.machine.outputs)

    runs = [log(SINE, SINE + PART), log(SINE + PART, SINE + 2 * PART, "held-out")]
    found = diagnose(MachineCase(path.parent, file, runs, False, []), tell=tell)
    tests = {"multisine": (SINE + 6 * PART, END), "arrow": (ARROW, OUTER), "inner": (ARROW, INNER)}
    return found, {name: error(found.rig, log(*rows)) for name, rows in tests.items()}


def error(file, run) -> float:
    """RMS of a free run from the first sample, less the first 50, in mV."""
    missed = run.outputs["position"] - free_run_of(file, run)["position"]
    return 1e3 * float(np.sqrt(np.mean(missed[50:] ** 2)))


if __name__ == "__main__":
    if not DATA.is_file():
        sys.exit(f"{DATA} is absent: this experiment needs the measured data.")
    answer, errors = main()
    print([e.id for e in answer.effects], errors)
    assert answer.effects[0].id == "mount-cubic", answer
    assert "mount-quadratic" in [e.id for e in answer.effects], answer
    assert errors["multisine"] <= 0.36 and errors["arrow"] <= 0.52, errors
