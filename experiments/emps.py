"""What does the baseline of a measured motor-and-screw axis lack?

EMPS: A. Janot, M. Gautier, M. Brunot, "Data Set and Reference Models of EMPS", workshop on
Nonlinear System Identification Benchmarks, 2019.  Two thirds of the estimation file train, the last
accepts; the pulses are read once, their `free run` (nonlinearbenchmark.org) from the voltage alone.
"""

from pathlib import Path

from omnijax.diagnosis import diagnose, force_error
from omnijax.machine import LogFile, MachineCase, load_machine, read_log

DATA = Path(__file__).parents[1] / ".." / "shared" / "realdata" / "emps"
COLUMNS, CUT = {"input": "vir", "position": "qm"}, 16560


def main(folder: Path = DATA, tell=print) -> dict:
    """Diagnose: names, orders, force errors in per cent, free runs of the pulses in m."""
    file = load_machine(Path(__file__).with_suffix(".toml"))

    def log(name: str, rows=None, role="train"):
        about = LogFile(folder / f"{name}.toml", folder / f"{name}.mat", None, role, rows,
                        channels=COLUMNS)  # fmt: skip
        return read_log(about, file.machine.inputs, file.machine.outputs)

    whole = log("DATA_EMPS")
    parts = [log("DATA_EMPS", (0, CUT)), log("DATA_EMPS", (CUT, len(whole.time)), "held-out")]
    found = diagnose(MachineCase(folder, file, parts, False, []), tell=tell)
    errors = force_error(found, whole, log("DATA_EMPS_PULSES"))  # refitted on the whole file
    lines = [x for e in found.effects for x in e.parameters.get("orders", {"value": []})["value"]]
    lines += [e.parameters["order"]["value"] for e in found.effects if "order" in e.parameters]
    return {"found": found, "names": [e.id for e in found.effects], "lines": lines, **errors}


if __name__ == "__main__":
    answer = main()
    print(*(f"{k}: {v}" for k, v in answer.items()), sep="\n")
    assert answer["names"][0] == "bearing-coulomb" and answer["train"] <= 3.2, answer
    assert {"friction-asymmetry", "viscous-asymmetry"} & set(answer["names"]), answer
    assert answer["cross-test"] <= 5.4 and any(abs(x / 2513.27 - 1) < 5e-3 for x in answer["lines"])
