"""Steady states in bulk against those one by one, and their gradients against differences."""

import sys
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import ORTHOGONAL, SKEW, machine

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import _c
from benchmarks import _omnijax as ours
from benchmarks import _problem as problem
from omnijax import laws
from omnijax.simulation import steady_state
from omnijax.simulation._bulk.steady import (
    plan_steady,
    steady_bulk_obstacle,
    steady_figures,
    steady_gradients,
    steady_margins,
)
from omnijax.vibration import contact_load

SHAPES = {"gated": laws.GatedSine(), "half": laws.HalfSine(), "rollers": laws.Rollers()}
ROWS = jnp.array([[0.35, 1.2e5, 0.0], [0.8, 6e5, 20000.0], [0.0, 3e5, 700.0], [0.12, 9e4, 1100.0]])


def _make(rig, w):
    def varied(r):
        return (r.wheels.roundness, r.wheels.contact.stiffness, r.wheels.contact.damping)

    def make(x):
        values = tuple(jnp.full(rig.size, 1.0) * v for v in x)
        return eqx.tree_at(varied, rig, values), jnp.asarray(w), jnp.full(rig.size, 0.1)

    return make


def _rig(layout, *names):
    rig = machine(layout)
    return eqx.tree_at(lambda r: r.profiles, rig, tuple(SHAPES[name] for name in names))


def test_figures_and_margins_are_those_of_each_design():
    """Strongly coupled, three profiles, one wheel backwards, one at rest, one design round."""
    make, model = _make(_rig(ORTHOGONAL, "gated", "rollers", "half"), (7.0, 0.0, -3.0)), "coupled"
    plan = plan_steady(make, ROWS, model)
    rms, peak = steady_figures(make, ROWS, plan)
    normal, slip = steady_margins(make, ROWS, plan)
    for i, row in enumerate(ROWS):
        one, speeds, angles = make(row)
        want = steady_state(one, speeds, model=model, angles=angles)
        assert abs(rms[i] - want.rms) <= 1e-6 * want.rms
        assert abs(peak[i] - want.peak) <= 1e-6 * want.peak
        load = contact_load(one, speeds, model, angles)
        scale = 1e-3 * (1 + abs(float(load.least.min())))
        assert abs(normal[i] - load.least.min()) < scale
        assert abs(slip[i] - load.slip_margin.min()) < scale


@pytest.fixture(scope="module")
def sloped():
    """(make, rows, plan, values, slopes) of two designs: one program for all that looks at it."""
    make = _make(_rig(ORTHOGONAL, "gated", "gated", "gated"), (0.7, 1.2, -0.31))
    rows = jnp.asarray([[0.8, 6e5, 900.0], [0.12, 9e4, 1100.0]])
    plan = plan_steady(make, rows, "coupled")
    return make, rows, plan, *steady_gradients(make, rows, plan)


def test_gradients_agree_with_differences(sloped):
    make, rows, plan, values, slopes = sloped
    for column in range(3):
        move = jnp.zeros_like(rows).at[:, column].set(1e-4 * rows[:, column])
        up, down = steady_figures(make, rows + move, plan), steady_figures(make, rows - move, plan)
        for name, high, low in zip(("rms", "peak"), up, down, strict=True):
            want = (high - low) / (2 * move[:, column])
            scale = np.abs(np.asarray(values[name] / rows[:, column]))
            assert np.all(np.abs(np.asarray(slopes[name][:, column] - want)) < 1e-6 * scale), name


def test_forward_and_reverse_mode_agree(sloped):
    """Reverse by `steady_gradients`; forward through one steady state at a time."""
    make, rows, _, _, slopes = sloped

    def figures(x):
        rig, speeds, angles = make(x)
        found = steady_state(rig, speeds, model="coupled", angles=angles)
        return {"rms": found.rms, "peak": found.peak}

    forward = jax.jit(jax.jacfwd(figures))(rows[0])
    for name, slope in forward.items():
        np.testing.assert_allclose(slopes[name][0], slope, rtol=1e-9 if name == "rms" else 1e-6)


def test_obstacles_are_said():
    assert "orthogonal" in str(steady_bulk_obstacle(machine(SKEW)))
    angle = np.linspace(0, 2 * np.pi / 14, 8, endpoint=False)
    table = laws.TableShape.fit(angle, 1e-4 * np.sin(14 * angle), 2 * np.pi / 14)
    rig = eqx.tree_at(lambda r: r.profiles, machine(ORTHOGONAL), (table,) * 3)
    assert "no sum of sinusoids" in str(steady_bulk_obstacle(rig))


def test_decoupled_figures_agree_with_the_closed_form_in_c():
    """The `paper` model of the benchmark: C's search on 8192 points a segment."""
    library = _c.compiled("elastic")
    if library is None:
        pytest.skip("no C compiler")
    rows = problem.designs(6, 120.0)

    def make(row):
        return ours.rig(row), jnp.asarray(problem.SPEEDS), jnp.zeros(3)

    plan = plan_steady(make, rows, "paper")
    found = np.stack(steady_figures(make, jnp.asarray(rows), plan), axis=-1)
    assert problem.error(found, _c.steady(library, rows, 8192)) < 1e-8
