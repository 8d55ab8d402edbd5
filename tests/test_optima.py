"""What `design` and `pareto` print of their optima is what `simulate` says of each, built anew."""

import dataclasses

import numpy as np
import pytest
from machines import ANY_SPEEDS, drawn_machine
from seeds import drawn_anew
from test_one_evaluation import linear_effects

from omnijax import set_parameter, sweep
from omnijax.simulation import simulate, speeds
from omnijax.study import design, pareto, parse_study
from omnijax.study._evaluation import samples_of
from omnijax.vibration import evaluate

pytestmark = ANY_SPEEDS

METRICS = ("rms", "sphere_acceleration_rms")
DURATION, RATE = 0.06, 500.0
PATH, LOW, HIGH = "mount.stiffness", 3e5, 4e6
TABLES = {
    "rig": "atlas",
    "drive": [{"speed": [1, 2, 3]}],
    "duration": DURATION,
    "rate": RATE,
    "variable": [{"path": PATH, "low": LOW, "high": HIGH}],
    "search": {"starts": 2, "batch": 2},
    "pareto": {"metrics": list(METRICS), "points": 3},
}


def drawn_study(rng, wheels):
    """A study of a drawn rig with effects under a drawn force, and its drive."""
    rig = linear_effects(drawn_machine(rng, wheels))
    turning, force = rng.uniform(2, 9, wheels), rng.uniform(-30, 30, 3)
    study = parse_study(TABLES)
    case = dataclasses.replace(study.drives[0], values=tuple(turning), force=tuple(force))
    return dataclasses.replace(study, rig=rig, drives=(case,)), speeds(turning, force)


def conflicting(rng, wheels):
    """The first drawn study whose metrics are least at stiffnesses of their own."""
    while True:
        study, drive = drawn_study(rng, wheels)
        range_ = {PATH: np.linspace(LOW, HIGH, 16)}
        some = sweep(study.rig, range_, METRICS, drive=drive, duration=DURATION, rate=RATE)
        if len({int(np.argmin(some[name])) for name in METRICS}) == 2:
            return study, drive


def simulated(study, drive, value):
    """The metrics of a run of the rig with this stiffness."""
    rig = set_parameter(study.rig, PATH, float(value))
    figures = evaluate(simulate(rig, drive, samples_of(DURATION, RATE)), rig, METRICS)
    return np.array([figures[name] for name in METRICS])


@pytest.mark.full
@pytest.mark.parametrize("wheels", [3, 4])
def test_optima_are_what_a_run_of_them_says(wheels):
    """An effect or a force that one of the commands drops would move its figures."""
    study, drive = conflicting(drawn_anew(f"optima of {wheels} wheels"), wheels)
    best = design(study)
    expected = simulated(study, drive, best.variables[PATH])[0]
    np.testing.assert_allclose(best.objective, expected, rtol=1e-7)
    front = pareto(study)
    assert len(front.values) > 1
    for values, x in zip(front.values, front.x, strict=True):
        np.testing.assert_allclose(values, simulated(study, drive, x[0]), rtol=1e-7)
    assert front.values[:, 0].min() == pytest.approx(best.objective, rel=1e-6)
