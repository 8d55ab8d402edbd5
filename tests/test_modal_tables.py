"""Wheels with a measured table in the modal core, on machines drawn anew."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn_rigs import any_table
from machines import ANY_SPEEDS, drawn_machine, machine, operating_at
from seeds import drawn_anew
from tiers import tiered

from omnijax import laws
from omnijax.simulation import (
    figures_obstacle,
    modal_figures,
    modal_obstacle,
    propagate,
    speeds,
)
from omnijax.simulation._modal._tables.response import (
    PolesAlone,
    decay_at,
    knots_of,
    moving,
    response_at,
)
from omnijax.simulation._modal.table_signals import table_signals
from omnijax.vibration import METRICS, evaluate, run_metrics

pytestmark = [pytest.mark.brief, ANY_SPEEDS]

DURATION, STEP = 0.4, 0.002
FURTHER = ("rms", "sphere_acceleration_rms", "lift_off_margin")


def tabled(rng, n: int, **changes):
    """`n` unlike wheels, the first and some others with tables of a pitch or of a turn."""
    rig = drawn_machine(rng, n, **changes)
    profiles = list(rig.profiles)
    for i in range(n):
        if i == 0 or rng.random() < 0.5:
            profiles[i] = any_table(rng, float(rig.wheels.rollers[i]), 2e-4)
    return eqx.tree_at(lambda r: r.profiles, rig, tuple(profiles))


def with_effects(rig, rng):
    """A contact that relaxes slowly, a floor that shakes, and runout where the table is a turn."""
    law = laws.ContactRelaxation(jnp.asarray(5e4), jnp.asarray(float(rng.uniform(0.02, 20.0))))
    rig = rig.add(law, rig.names[-1])
    size, frequency, phase = map(jnp.asarray, (0.4, 7.0, 0.3))
    floor = laws.FloorVibration(size, frequency, phase, jnp.array([0.2, 1.0, 0.4]))
    rig = rig.add(floor, "platform")
    turns = (i for i, p in enumerate(rig.profiles) if getattr(p, "whole_turn", False))
    for i in turns:
        rig = rig.add(laws.WheelRunout(jnp.asarray(4e-5), jnp.asarray(0.7)), rig.names[i])
    return rig


def rows_of(rng, n: int, count: int, still: bool = False) -> np.ndarray:
    """Speeds, forces and start angles."""
    speed = rng.uniform(0.3, 12.0, (count, n)) * rng.choice([-1.0, 1.0], (count, n))
    if still:
        speed[0, 0] = 0.0
    return np.column_stack([speed, rng.normal(0, 20.0, (count, 3)), rng.uniform(-4, 4, (count, n))])


@pytest.mark.parametrize("number", tiered(range(3), bool))
def test_figures_are_those_of_propagated_runs(number):
    rng = drawn_anew(f"figures of tables {number}")
    rig = tabled(rng, int(rng.integers(3, 6)))
    rig = with_effects(rig, rng) if number != 1 else rig
    assert modal_obstacle(rig) is None
    rows, n = rows_of(rng, rig.size, 2, still=True), rig.size
    names = tuple(METRICS)
    every = run_metrics(eqx.Partial(operating_at, rig), rows, names, duration=DURATION, step=STEP)
    ts = jnp.linspace(0, DURATION, round(DURATION / STEP) + 1)
    for row, values in zip(rows, every.values, strict=True):
        run = propagate(rig, speeds(row[:n], row[n : n + 3], row[n + 3 :]), ts)
        expected = evaluate(run, rig, names)
        np.testing.assert_allclose(values, list(expected.values()), rtol=1e-9, atol=1e-15)


def scaled(rig, row):
    """Contact's stiffness and damping scaled by the first two numbers, then as `operating_at`."""
    contact = rig.wheels.contact
    rig = eqx.tree_at(
        lambda r: (r.wheels.contact.stiffness, r.wheels.contact.damping),
        rig,
        (contact.stiffness * row[0], contact.damping * row[1]),
    )
    return operating_at(rig, row[2:])


@pytest.mark.parametrize("names", tiered([("peak",), FURTHER], FURTHER.__eq__))
def test_gradients_are_differences_of_figures(names):
    """By stiffness, damping, speeds and start angles."""
    rng = drawn_anew("gradients of tables")
    rig = tabled(rng, 3)
    rows = np.column_stack([np.ones((1, 2)), rows_of(rng, rig.size, 1)])
    make = eqx.Partial(scaled, rig)

    def figures(rows):
        return run_metrics(make, rows, names, duration=DURATION, step=STEP).values

    exact = run_metrics(make, rows, names, duration=DURATION, step=STEP, gradient=True)
    eye = np.eye(rows.shape[1])
    near, far = (figures(rows + h * np.concatenate([eye, -eye])) for h in (1e-5, 2e-5))
    assert exact.slopes is not None

    def slope(values, h):
        up, down = np.split(values, 2)
        return (up - down).T / (2 * h)

    expected = (4 * slope(near, 1e-5) - slope(far, 2e-5)) / 3
    size = np.abs(expected).max(axis=1, keepdims=True)
    np.testing.assert_allclose(exact.slopes[0] / size, expected / size, atol=2e-6)


def _table(rng, pieces: int):
    """Durations of pieces, and rho with its derivatives, of a spline of one period."""
    shape = any_table(rng, 14.0, 1.0)
    while len(shape.knots) - 1 < pieces:
        shape = any_table(rng, 14.0, 1.0)
    c = shape.coefficients[:pieces].T
    return jnp.diff(shape.knots)[:pieces], c * jnp.array([1.0, 1.0, 2.0, 6.0])[:, None]


@jax.jit
def responded(poles, duration, rho, time):
    """What pairs of poles make of a table at times from rest."""
    knots = knots_of(poles, duration, rho, time[-1])
    return response_at(poles, knots, time, decay_at(poles, time)).z


@pytest.mark.parametrize(
    "where", ["fast", "faster", "slow", "still", "resonant", "two real", "growing"]
)
def test_poles_respond_as_an_integrator_says(where):
    """Very fast and slow beside the pieces, at 0, beside the periods' own frequency, and real."""
    rng = drawn_anew(f"poles at tables, {where}")
    duration, rho = _table(rng, 5)
    period = float(jnp.sum(duration))
    kind, l0, l1 = {
        "fast": (1.0, -20.0 / period, 300.0 / period),
        "faster": (0.0, -1e4 / period, -2e6 / period),
        "growing": (1.0, 3.0 / period, 10.0 / period),
        "slow": (1.0, -1e-4 / period, 1e-3 / period),
        "still": (0.0, 0.0, -1e-9 / period),
        "resonant": (1.0, -1e-5 / period, 4 * np.pi / period),
        "two real": (0.0, -0.3 / period, -50.0 / period),
    }[where]
    poles = PolesAlone(*(jnp.full((1, 1), x) for x in (kind, l0, l1)))
    time = np.sort(rng.uniform(0, 6 * period, 12))
    response = responded(poles, duration, rho, time)
    node, weight = np.polynomial.legendre.leggauss(12)
    ends = np.cumsum(np.asarray(duration))

    def force(t):
        into = np.mod(t, period)
        k = np.minimum(np.searchsorted(ends, into, side="right"), len(ends) - 1)
        v, (a, b, c, d) = into - (ends - np.asarray(duration))[k], np.asarray(rho)[:, k]
        return a + v * (b + v * (c / 2 + v * d / 6))

    def integral(pole, t):
        """Of exp(pole (t - s)) force(s) from 0 to t, on pieces on which the force is smooth."""
        edges = np.concatenate([n * period + np.append(0.0, ends[:-1]) for n in range(6)])
        fine = np.concatenate([np.linspace(x, y, 80) for x, y in itertools.pairwise(edges)])
        late = t - np.geomspace(1e-3, 60, 60) / max(abs(pole), 1e-3)  # all a fast pole remembers
        fine = np.concatenate([fine, np.maximum(late, 0.0)])
        cut = np.unique(np.append(fine[fine < t], t))
        half, middle = np.diff(cut)[:, None] / 2, (cut[1:] + cut[:-1])[:, None] / 2
        s = middle + half * node
        return np.sum(weight * half * np.exp(pole * (t - s)) * force(s))

    for number, pole in enumerate([complex(l0, l1)] if kind else [l0, l1]):
        z = np.array([integral(pole, t) for t in time])
        first, second = (np.asarray(x[0]) for x in response)
        got = first + 1j * second if kind else (first, second)[number]
        np.testing.assert_allclose(got, z, atol=1e-11 * np.abs(z).max())


def test_a_pole_that_grows_without_bound_in_a_period_is_right_before():
    """What overflows later is not asked for."""
    rng = drawn_anew("growth in a period")
    duration, rho = _table(rng, 5)
    growth = 1e6 / float(duration[0])  # so that a piece ends beyond all numbers
    poles = PolesAlone(*(jnp.full((1, 1), x) for x in (1.0, growth, 10.0)))
    until = 2 / growth
    time = jnp.asarray([0.5 * until, until])
    z = responded(poles, duration, rho, time)
    expected = rho[0, 0] * (np.exp(growth * np.asarray(time)) - 1) / growth
    np.testing.assert_allclose(z[0][0], expected, rtol=1e-3)


def test_slopes_by_the_period_hold_where_samples_fall_on_its_ends():
    rng = drawn_anew("samples on ends of periods")
    shape = any_table(rng, 14.0, 1.0)
    period = float(shape.knots[-1])
    duration = jnp.diff(shape.knots)
    rho = shape.coefficients.T * jnp.array([1.0, 1.0, 2.0, 6.0])[:, None]
    time = period / 50 * jnp.arange(301)
    poles = PolesAlone(*(jnp.full((1, 1), x / period) for x in (period, -0.3, 4.0)))
    weights = jnp.asarray(rng.normal(size=(2, 301)))

    def figure(scale, fixed=True):
        slower = rho * scale ** -jnp.arange(4.0)[:, None]
        knots = knots_of(poles, duration * scale, slower, time[-1], fixed)
        z = response_at(poles, knots, time, decay_at(poles, time), fixed).z
        return jnp.sum(weights * jnp.concatenate(z))

    h, value = 1e-6, jax.jit(figure)
    expected = (value(1 + h) - value(1 - h)) / (2 * h)
    for fixed in (True, False):
        slope = jax.jit(jax.grad(figure), static_argnums=1)(1.0, fixed)
        np.testing.assert_allclose(slope, expected, rtol=1e-5)


def test_a_start_just_below_a_whole_turn_is_on_the_table():
    table = any_table(drawn_anew("start below a turn"), 14.0, 1.0)
    rig = eqx.tree_at(lambda r: r.profiles, machine(), (table, laws.HalfSine(), laws.HalfSine()))
    for speed in (2.0, -2.0, 0.0):
        at = [
            table_signals(rig, [0], jnp.array([speed, 1.0, 1.0]), jnp.array([angle, 0.0, 0.0]))
            for angle in (-1e-17, 0.0)
        ]
        np.testing.assert_allclose(at[0].rho[0, 0, 0], at[1].rho[0, 0, 0], rtol=1e-9)
        np.testing.assert_allclose(at[0].rho[0, 0, 0], table.coefficients[0, 0], rtol=1e-9)


def test_poles_that_are_fixed_move_as_those_that_are_not():
    """Both ways along a piece, their values and their derivatives by time, table and start."""
    rng = drawn_anew("fixed poles")
    kind = jnp.asarray(rng.integers(0, 2, (4, 1)).astype(float))
    l0, l1 = (jnp.asarray(-(10.0 ** rng.uniform(-2, 3, (4, 1)))) for _ in range(2))
    v, rho = jnp.asarray(rng.uniform(0, 0.2, 7)), jnp.asarray(rng.normal(size=(4, 7)))
    z = tuple(jnp.asarray(x) for x in rng.normal(size=(2, 4, 7)))
    weights = rng.normal(size=(2, 2, 4, 7))

    def figure(fixed):
        def of(z, v, rho):
            every = moving(fixed)(kind, l0, l1, z, v, rho)
            each = zip(weights, every, strict=True)
            return sum(jnp.sum(w * jnp.stack(x)) for w, x in each)

        return jax.jit(jax.value_and_grad(of, argnums=(0, 1, 2)))(z, v, rho)

    for x, y in zip(*(jax.tree.leaves(figure(fixed)) for fixed in (True, False)), strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-8, atol=1e-9)


def test_figures_of_tables_are_read_from_runs():
    rig = tabled(drawn_anew("obstacles of tables"), 3)
    reason = "wheel w1's profile is a table, whose runs are read sample by sample"
    assert figures_obstacle(rig) == reason
    with pytest.raises(ValueError, match=reason):
        rows = rows_of(np.random.default_rng(0), 3, 1)
        modal_figures(eqx.Partial(operating_at, rig), rows, duration=DURATION, step=STEP)
