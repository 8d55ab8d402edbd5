"""What does the linear baseline of a measured electronic oscillator lack?

Silverbox: T. Wigren, J. Schoukens, "Three free data sets for development and benchmarking in
nonlinear system identification", ECC 2013.  An eighth of the multisine trains, the next judges.
"""

import tomllib
from pathlib import Path

from omnijax import diagnosis, machine

DATA = Path(__file__).parents[1] / ".." / "shared" / "realdata" / "silverbox" / "SNLS80mV.csv"
RATE = 1e7 / 2**14  # Hz
SHOWN = {"given": "V1", "position": "V2"}
TEST = {"multisine": (105708, 127400), "arrow": (100, 40575), "inner": (100, 32100)}  # rows


def main(path: Path = DATA, tell=print):
    """The diagnosis, and the simulation errors of the test parts in mV."""
    guess = machine.case_files([machine.guess(path, RATE, **SHOWN)])["machine.toml"]
    file = machine.parse_machine(tomllib.loads(guess) | {"compare": {"hold": "band-limited"}})

    def log(rows, role: str = "held-out"):
        about = machine.LogFile(Path(f"{rows[0]}.toml"), path, role=role, rows=rows, rate=RATE,
                                channels={"input": "V1", "position": "V2"})  # fmt: skip
        return machine.read_log(about, file.machine.inputs, file.machine.outputs)

    runs, errors = [log((40650, 51493), "train"), log((51493, 62336))], {}
    found = diagnosis.diagnose(machine.MachineCase(path.parent, file, runs, False, []), tell=tell)
    for name, run in ((k, log(rows)) for k, rows in TEST.items()):
        missed = run.outputs["position"] - machine.free_run_of(found.rig, run)["position"]
        errors[name] = 1e3 * float((missed[50:] ** 2).mean() ** 0.5)
    return found, errors


if __name__ == "__main__":
    answer, errors = main()
    print([e.id for e in answer.effects], errors)
    assert {"mount-cubic", "mount-quadratic"} <= {e.id for e in answer.effects}, answer
    assert errors["multisine"] <= 0.36 and errors["arrow"] <= 0.52, errors
