"""Steady states on the modal form against those one by one, and gradients against differences."""

import sys
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import ANY_SPEEDS, ORTHOGONAL, SKEW, drawn_machine, machine
from seeds import drawn_anew
from test_modal import KINDS, alike_machine, beside, cone, hidden, maker, points_of, varied

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import _c
from benchmarks import _omnijax as ours
from benchmarks import _problem as problem
from omnijax import laws
from omnijax.simulation import Operating, modal_steady_obstacle, steady_state
from omnijax.simulation._modal._long_run import supremum
from omnijax.simulation._modal.batch import FEW
from omnijax.simulation._steady import sphere
from omnijax.vibration import (
    BULK_STEADY_METRICS,
    SteadyRun,
    contact_load,
    long_run_metrics,
    steady_metric,
)

pytestmark = [pytest.mark.long, ANY_SPEEDS]
BOTH = ("rms", "peak")


@pytest.mark.full
def test_figures_and_margins_are_those_of_each_design():
    """Drawn designs: a wheel at rest, wheels backwards, a force, a damaged roller, runout."""
    rng = drawn_anew("wheels and operating points")
    rig, model = hidden(machine(cone(rng, 2))), "paper"
    n, rows = rig.size, points_of(rig, rng, count=4)
    found = long_run_metrics(maker(rig), rows, BOTH, model=model)
    assert found.held.all()
    for i, row in enumerate(rows[:2]):
        speeds, force, angles = row[:n], row[n : n + 3], row[n + 3 :]
        want = steady_state(rig, speeds, model=model, angles=angles, force=force, harmonics=1)
        assert abs(found.values[i, 0] / want.rms - 1) < 2e-7
        assert abs(found.values[i, 1] / want.peak - 1) < 1e-6
        load = contact_load(rig, jnp.asarray(speeds), model, angles, force)
        for bound, exact in ((found.normal, load.least), (found.slip, load.slip_margin)):
            least = float(exact.min())
            assert np.sign(bound[i]) == np.sign(least)
            assert bound[i] < least + 1e-3 * (1 + abs(least))


@pytest.mark.full
@pytest.mark.parametrize("name", ["tripod, alike"])
def test_gradients_are_the_slopes_between_designs(name):
    """Six numbers, at equal wheels too, whose poles are exactly degenerate; sixth order."""
    rig, model = KINDS[name]
    row, h = np.ones(6), 1e-3
    near = (row + h * np.array([-3, -2, -1, 1, 2, 3])[:, None] * np.eye(6)[:, None]).reshape(-1, 6)
    values = long_run_metrics(varied(rig), near, BOTH, model=model).values.reshape(6, 6, 2)
    expected = np.einsum("dkm,k->md", values, np.array([-1, 9, -45, 45, -9, 1]) / (60 * h))
    found = long_run_metrics(varied(rig), row[None], BOTH, model=model, gradient=True)
    assert found.slopes is not None
    scale = np.abs(expected).max(axis=1, keepdims=True)
    error = np.abs(found.slopes[0] - expected) / scale
    assert np.all(error < [[1e-7], [1e-5]]), error


@pytest.mark.full
@pytest.mark.parametrize("names", [("rms",), BOTH], ids=["rms", "both"])
def test_figures_and_gradients_where_poles_meet(names):
    """Critical damping of drawn rigs and distances down to none from it."""
    rng = drawn_anew("damping at which poles meet")
    make = varied(alike_machine(rng))

    def figures(make, rows):
        return long_run_metrics(make, rows, names, gradient=True)

    for row in rng.uniform(0.8, 1.2, (2, 6)):
        errors = [np.abs(x) for x in beside(make, row, figures)]
        assert errors[0].max() < 1e-10, errors
        assert max(x.max() for x in errors[1:]) < 1e-6, errors


@pytest.mark.full
def test_wheels_whose_profiles_have_no_edges():
    """Figures of each design, and slopes along a drawn direction of all numbers of a row."""
    rng = drawn_anew("wheels without edges")
    rig, h = machine(cone(rng, 2), profile=laws.ContinuousSine()), 1e-6
    row = points_of(rig, rng, count=1, still=False)[0]
    along = row * rng.normal(size=len(row))
    rows = np.stack([row, row + h * along, row - h * along])
    found = long_run_metrics(maker(rig), rows, BOTH, model="paper", gradient=True)
    assert found.slopes is not None
    want = steady_state(rig, row[:2], model="paper", angles=row[5:], force=row[2:5], harmonics=1)
    np.testing.assert_allclose(found.values[0], [want.rms, want.peak], rtol=1e-7)
    rise = (found.values[1] - found.values[2]) / (2 * h)
    np.testing.assert_allclose(found.slopes[0] @ along, rise, rtol=1e-5)


@pytest.mark.full
@pytest.mark.parametrize(
    "layout", [pytest.param(cone, id="two"), pytest.param(ORTHOGONAL, id="orthogonal")]
)
def test_metrics_are_those_of_each_design(layout):
    """Values and slopes of some of the table, against those one by one."""
    rng = drawn_anew("metrics and designs")
    rig = machine(cone(rng, 2) if layout is cone else layout)
    make, model = varied(rig), "paper" if rig.size == 2 else "coupled"
    drawn = rng.permutation(BULK_STEADY_METRICS[:-2])[:1].tolist()
    names, rows = ("slip_margin", *drawn), rng.uniform(0.8, 1.2, (3, 6))
    found = long_run_metrics(make, rows, names, model=model, gradient=True)
    assert found.slopes is not None

    @jax.jit
    def one(row):
        at = make(row)
        run = SteadyRun(at.rig, at.speeds, at.angles, model, force=at.force)
        return jnp.stack([steady_metric(run, name) for name in names])

    slopes = jax.jit(jax.jacfwd(one))
    for row, values, by_row in zip(rows, found.values, found.slopes, strict=True):
        np.testing.assert_allclose(values, one(row), rtol=1e-9, err_msg=str(names))
        expected = np.asarray(slopes(row))
        size = np.abs(expected).max(axis=1, keepdims=True)
        np.testing.assert_allclose(
            by_row / size, expected / size, rtol=0, atol=1e-5, err_msg=str(names)
        )


@pytest.mark.full
def test_every_metric_of_a_rig_with_effects_is_that_of_each_design():
    """A damaged roller, runout, a floor that shakes: several signals a phase."""
    rng = drawn_anew("wheels and designs")
    make, rows = varied(hidden(machine(cone(rng, 2)))), rng.uniform(0.8, 1.2, (3, 6))
    found = long_run_metrics(make, rows, BULK_STEADY_METRICS, model="paper").values

    @jax.jit
    def one(row):
        at = make(row)
        run = SteadyRun(at.rig, at.speeds, at.angles, "paper", force=at.force)
        return jnp.stack([steady_metric(run, name) for name in BULK_STEADY_METRICS])

    for row, values in zip(rows, found, strict=True):
        np.testing.assert_allclose(values, one(row), rtol=1e-6)


@pytest.mark.full
def test_more_starts_find_no_higher_supremum(monkeypatch):
    """Unlike wheels, whose sums have several maxima of nearly the same length."""
    rng = drawn_anew("wheels and speeds")
    rig = drawn_machine(rng, int(rng.integers(4, 7)))
    rows = rng.uniform(2, 9, (64, rig.size)) * rng.choice([-1, 1], rig.size)

    def make(speeds):
        return Operating(rig, speeds, jnp.zeros(3), jnp.zeros(rig.size))

    peak = long_run_metrics(make, rows, ("peak",)).values
    monkeypatch.setattr(supremum, "DIRECTIONS", sphere(128, 3)[:64])
    for name, value in {"_MASK": 127, "KEPT": 16, "AGAIN": 6, "EXCHANGES": 3, "CLOSE": 0.9}.items():
        monkeypatch.setattr(supremum, name, value)
    more = long_run_metrics(make, rows, ("peak",), total=FEW + 1).values  # another program
    np.testing.assert_allclose(peak, more, rtol=1e-6)


@pytest.mark.full  # in the gate: test_hold, in a batch
def test_what_nothing_holds_has_that_word():
    rig = machine(SKEW)
    normal = jnp.asarray(rig.wheels.normal).at[1].set(-rig.wheels.normal[0])
    normal = normal.at[2].set(rig.wheels.normal[0])

    def make(row):
        share = row[3]
        moved = eqx.tree_at(
            lambda r: r.wheels.normal, rig, (1 - share) * rig.wheels.normal + share * normal
        )
        return Operating(moved, row[:3], jnp.zeros(3), jnp.zeros(3))

    found = long_run_metrics(make, np.array([[1.0, 2.0, 3.0, 0.0], [1.0, 2.0, 3.0, 1.0]]), BOTH)
    assert found.held.tolist() == [True, False]


def test_obstacles_are_said():
    rig = machine(SKEW)
    assert modal_steady_obstacle(rig) is None
    damaged = laws.DamagedRoller(jnp.asarray(3.0), jnp.asarray(0.6))
    two = rig.add(damaged, "w1").add(damaged, "w1")
    assert "more than one damaged roller" in str(modal_steady_obstacle(two))
    assert modal_steady_obstacle(rig.add(damaged, "w1").add(damaged, "w2")) is None


NEARLY_EQUAL = [732, 664, 761, 822, 561, 874, 992, 853]  # of the benchmark's 1024 designs


def test_figures_agree_with_the_closed_form_in_c():
    """The `paper` model of the benchmark: C's search on 8192 points a segment.

    Beside drawn designs those where the two signs of a phase's contribution are nearly as large.
    """
    library = _c.compiled("elastic")
    if library is None:
        pytest.skip("no C compiler")
    rng = drawn_anew("designs of the benchmark")
    number = np.concatenate([rng.choice(1024, 56, replace=False), NEARLY_EQUAL])
    rows = problem.designs(1024, 120.0)[number]

    def make(row):
        return Operating(ours.rig(row), jnp.asarray(problem.SPEEDS), jnp.zeros(3), jnp.zeros(3))

    found = long_run_metrics(make, rows, BOTH, model="paper").values
    assert problem.error(found, _c.steady(library, rows, 8192)) < 1e-8


def test_accelerations_of_slow_wheels_and_stiff_dampers_keep_their_digits():
    """Smooth wheels accelerate the sphere as the square of their speed where all poles are fast.

    The squares of what cancels had left of a slow wheel's acceleration 0 in bulk, and fifty times
    as much one by one.
    """
    rng = drawn_anew("slow wheels")
    rig = drawn_machine(rng, 3)
    rig = eqx.tree_at(lambda r: r.profiles, rig, (laws.ContinuousSine(),) * 3)
    turning, still = rng.uniform(0.5, 2.0, 3) * [1, -1, 1], jnp.zeros(3)
    damping = rig.wheels.contact.damping

    def make(row):
        own = eqx.tree_at(lambda r: r.wheels.contact.damping, rig, row[1] * damping)
        return Operating(own, row[0] * jnp.asarray(turning), still, still)

    rows = np.array([[1e-3, 1.0], [2e-3, 1.0], [0.01, 1.0], [1.0, 3e3]])
    name = "sphere_acceleration_rms"
    values = long_run_metrics(make, rows, [name]).values[:, 0]

    @jax.jit
    def one(row):
        at = make(row)
        return steady_metric(SteadyRun(at.rig, at.speeds, at.angles, "coupled"), name)

    alone = np.array([float(one(jnp.asarray(row))) for row in rows])
    for slow in (values[:3], alone[:3]):
        np.testing.assert_allclose(slow / slow[0], [1.0, 4.0, 100.0], rtol=1e-3)
    np.testing.assert_allclose(values[2:], alone[2:], rtol=1e-5)
