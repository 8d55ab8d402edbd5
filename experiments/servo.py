"""Which friction do Coulomb and viscous lack in a servo that lifts a pendulum?

M. Duclusaud et al., "Extended Friction Models for the Physics Simulation of Servo Actuators", ICRA
2025; 16 logs of the data set Rhoban/bam.  Gains 100, 200, 800 train; gain 400 is held out.
"""

from pathlib import Path

import numpy as np

from omnijax.diagnosis import diagnose
from omnijax.machine import LogFile, MachineCase, load_machine, read_log

DATA = Path(__file__).parents[1] / "tests" / "data" / "servo"
COLUMNS = {"t": "timestamp", "input": "goal_position", "gain": "kp", "enable": "torque_enable"}
HELD = 400  # gain


def main(folder: Path = DATA, tell=print):
    """The diagnosis, and mean absolute errors of the held-out gain in mrad, before and after."""
    file, logs = load_machine(Path(__file__).with_suffix(".toml")), []
    for path in sorted(folder.glob("*.json.gz")):
        about = LogFile(path, path, channels=COLUMNS)
        logs.append(read_log(about, file.machine.inputs, file.machine.outputs))
        logs[-1].role = "held-out" if logs[-1].inputs["gain"][0] == HELD else "train"
    found = diagnose(MachineCase(folder, file, logs, False, []), tell=tell)
    held = [r for r in found.free_runs if r["role"] == "held-out"]
    return found, [1e3 * np.mean([r[k]["mae"] for r in held]) for k in ("before", "after")]


if __name__ == "__main__":
    answer, (before, after) = main()
    names = [e.id for e in answer.effects]
    print(names, f"mean absolute error of the held-out gain: {before:.1f} -> {after:.1f} mrad")
    assert names[0] == "load-friction-quadratic", names
    assert after <= 40, after  # by friction in proportion to the load: 43.6
