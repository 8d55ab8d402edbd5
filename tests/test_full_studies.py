"""Sensitivity and design where only the full simulation will do: torques, nonlinear contacts."""

import jax.numpy as jnp
import numpy as np
import pytest

from omnijax.rig import load_rig, rig_text
from omnijax.simulation import torques
from omnijax.study import parse_study, sensitivity
from omnijax.study._design._search.engine import Engine
from omnijax.study._design.rig import rig_problem
from omnijax.study._evaluation.fixed_steps import fine_enough

pytestmark = pytest.mark.long

HERTZ = '\n[[effect]]\nid = "contact-hertz"\nplace = "all"\n'
TORQUE = [2.0, 3.0, 1.0]
STUDY = {
    "duration": 0.08,
    "rate": 250,
    "drive": [{"torque": TORQUE}],
    "objective": {"metric": "elastic_rms"},
    "variable": [{"path": "contact.damping", "low": 50, "high": 5000, "scale": "log"}],
    "constraint": [
        {
            "quantity": "patch_pressure",
            "max": "2.8 MPa",
            "youngs_modulus": [1e10, 5e7],
            "poisson_ratio": [0.3, 0.48],
        }
    ],
    "search": {"starts": 1},
}


@pytest.fixture(scope="module")
def hertz(tmp_path_factory):
    path = tmp_path_factory.mktemp("rig") / "hertz.toml"
    path.write_text(rig_text(load_rig("atlas")) + HERTZ)
    return str(path)


@pytest.fixture(scope="module")
def engine(hertz):
    return Engine(rig_problem(parse_study({**STUDY, "rig": hertz})), 1, 0)


@pytest.mark.full
def test_slopes_through_the_adaptive_solver(engine):
    """Central differences of step h err by rtol/h and h^2."""
    at, h = 0.6, 2e-3
    (s,) = engine.figures.slopes(np.array([[at]]))
    f, g = engine.figures.values(np.array([[at + h], [at - h]]))
    assert np.isclose(s.df[0, 0], (f[0, 0] - f[1, 0]) / (2 * h), rtol=5e-3)
    assert np.allclose(
        s.dg[:, 0], (g[0] - g[1]) / (2 * h), rtol=5e-3, atol=5e-3 * np.abs(s.dg).max()
    )


def test_fixed_steps_are_halved_until_that_changes_little():
    """An error of n^-4 falls below 1e-4 between n and 2 n at n = 16; one that stays asks for the
    adaptive solver, and a design whose run fails counts for nothing."""
    designs = np.array([[1.0], [2.0]])

    def figures(designs, n):
        return np.where(designs == 2.0, np.nan, 1.0 + float(n) ** -4)

    substeps, why = fine_enough(figures, designs, 8e-3)
    assert substeps == 16 and "fixed steps of 0.5 ms" in why
    assert fine_enough(lambda x, n: 1.0 + 0 * x + 1 / (1 + np.log(n)), designs, 8e-3) is None
    assert fine_enough(lambda x, n: np.where(n == 1, np.nan, x), designs, 8e-3)[0] == 2


@pytest.mark.full
def test_a_design_of_a_nonlinear_rig_under_torques(engine):
    """Pressures are limited half way between their least and their greatest over the range."""
    shares = np.linspace(0.01, 0.99, 16)[:, None]
    f, g = engine.figures.values(shares)
    limit = 0.5 * (g.max(axis=1).min() + g.max(axis=1).max())
    lanes = engine.lanes._replace(limit=jnp.full_like(engine.lanes.limit, limit))
    end = engine.batches(lanes, 1, "")[0]
    assert end.status == "optimal", end.reason
    allowed = np.all(g <= limit, axis=1)
    assert 0 < allowed.sum() < 16
    assert end.value <= f[allowed].min() * (1 + 1e-6)


@pytest.mark.full
def test_a_design_of_two_variables_with_a_limit_on_its_runs():
    """Least elastic vibration of runs under torques while their acceleration stays in the lowest
    quarter of what the range gives: the limit is active and has a price, and no drawn design that
    keeps it is better."""
    asked = {
        **STUDY, "rig": "atlas",
        "variable": [*STUDY["variable"],
                     {"path": "contact.stiffness", "low": "60 kN/m", "high": "600 kN/m"}],
        "constraint": [{"quantity": "sphere_acceleration_rms", "max": 1.0}],
    }  # fmt: skip
    engine = Engine(rig_problem(parse_study(asked)), 1, 0)
    f, g = engine.figures.values(np.random.default_rng(1).random((64, 2)))
    limit = float(np.percentile(g, 25))
    lanes = engine.lanes._replace(limit=jnp.full_like(engine.lanes.limit, limit))
    end = engine.batches(lanes, 1, "")[0]
    assert end.status == "optimal", end.reason
    assert abs(end.g[0]) < 1e-5 * limit and end.kkt.limits[0] > 0
    assert np.all((end.share > 0.01) & (end.share < 0.99))
    assert end.value < 0.95 * f[g[:, 0] <= limit].min()


@pytest.mark.full
def test_sensitivity_of_a_nonlinear_rig_under_torques(hertz, engine):
    """The same derivative as the design's: per ln C there, in % per % here."""
    found = sensitivity(
        hertz, torques(TORQUE), "elastic_rms", duration=0.08, rate=250,
        parameters=["contact.damping", "closure.preload"],
    )  # fmt: skip
    assert found.method == "full"
    share = np.log(120 / 50) / np.log(100)
    (s,) = engine.figures.slopes(np.array([[share]]))
    together = found.together("elastic_rms")
    assert np.isclose(s.f[0], found.figures[0], rtol=1e-4)
    assert np.isclose(s.df[0, 0] / np.log(100) / s.f[0], together["contact.damping"], rtol=5e-3)
    assert abs(together["closure.preload"]) > 1e-4  # Hertz' law knows the preload
