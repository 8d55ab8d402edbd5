"""Designs whose figures are evaluated many at once."""

import numpy as np
import pytest
from seeds import drawn_anew

import omnijax
from omnijax.study import parse_study
from omnijax.study._design._search.figures import ProblemFigures
from omnijax.study._design.rig import rig_problem

pytestmark = pytest.mark.brief
STUDY = {
    "rig": "atlas-tripod",
    "objective": {"weights": {"rms": 1.0, "elastic_rms": 2.0}},
    "duration": 0.2,
    "rate": 200,
    "drive": [{"speed": [3.0, 5.1, 7.3]}, {"speed": [1, 2, 3], "force": [9, 0, 4]}],
    "variable": [
        {"path": "contact.stiffness", "low": 1e5, "high": 3e5},
        {"path": "contact.damping", "low": 60, "high": 300, "scale": "log"},
        {"path": "closure.preload", "low": 60, "high": 90},
    ],
    "tolerance": {"wheel.w1.roundness": 0.002, "wheel.w2.mount.stiffness": 0.1, "draws": 3},
    "constraint": [
        {"quantity": "slip_margin", "min": 3.0},
        {"quantity": "preload", "max": 80.0},
        {"quantity": "frequency_separation", "min": 1e-4, "orders": [1, 2]},
    ],
    "search": {"starts": 2},
}


@pytest.mark.full
def test_figures_in_bulk_are_those_of_the_cases_one_by_one():
    """Runs under two drives with parts that are off: figures, limits and slopes of drawn designs.

    Limits are a metric, a preload and natural frequencies, which look at the rig alone.
    """
    rng = drawn_anew("design in bulk")
    drives = [{"speed": rng.uniform(-4, 4, 3).tolist()}, STUDY["drive"][1]]
    spread = str(rng.choice(["worst", "mean+sigma"]))
    objective = {"objective": {**STUDY["objective"], "spread": spread}}
    problem = rig_problem(parse_study(STUDY | objective | {"drive": drives}))
    figures, shares = ProblemFigures(problem, 0), rng.uniform(0.1, 0.9, (3, 3))
    assert problem.many is not None
    alone = ProblemFigures(problem._replace(many=None), 0)
    assert alone.size == pytest.approx(figures.size, rel=1e-9)
    for many, one in zip(figures.slopes(shares), alone.slopes(shares), strict=True):
        for ours, theirs in zip(many, one, strict=True):
            size = np.abs(theirs).max(axis=-1, keepdims=True)
            assert ours.shape == theirs.shape
            assert np.all(np.abs(ours - theirs) <= 1e-8 * size)
    for ours, theirs in zip(figures.values(shares), alone.values(shares), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-8, atol=1e-9)


def test_what_a_design_brings_is_said_by_case_under_the_worst_of_its_parts():
    """Cases are the drives, not the drives with every draw."""
    best = omnijax.design(STUDY)
    assert len(best.cases) == 2 * 4 and list(best.was["cases"]) == ["drive 1", "drive 2"]
    assert best.was["new"] == max(new for _, new in best.was["cases"].values())
    assert best.optimal and best.was["new"] < best.objective < best.was["old"]


def test_a_limit_on_pressures_is_not_read_from_metrics():
    """It looks at the forces of a run, so that its designs go one by one."""
    assert rig_problem(parse_study(STUDY)).many is not None
    limit = {"quantity": "patch_pressure", "max": 1e9, "youngs_modulus": [7e10, 5e7]}
    limits = [*STUDY["constraint"], limit | {"poisson_ratio": [0.3, 0.45]}]
    assert rig_problem(parse_study(STUDY | {"constraint": limits})).many is None
