"""Measured wheel profiles as people write them: closing rows, few digits, doubled rows."""

import math
import tomllib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import tables
from seeds import drawn_anew

from omnijax import (
    evaluate,
    laws,
    sensitivity,
    set_parameter,
    simulate,
    speeds,
    steady_state,
    sweep,
)
from omnijax.dynamics import wheel_shape
from omnijax.rig import InputError, get_parameter, parameter_paths, parse_rig, rig_text
from omnijax.study._file.cases import quantity_of
from omnijax.study._file.read import Reader

pytestmark = pytest.mark.brief

ROLLERS = 14
PLACES = 5001


def rig_of(theta, rho):
    """The Atlas rig with this table on its first wheel."""
    table = {"theta": [float(x) for x in theta], "rho": [float(x) for x in rho]}
    return parse_rig(tables((("wheel", 0, "profile"), "table"), (("wheel", 0, "table"), table)))


@eqx.filter_jit
def _shapes(rig, angles):
    return jax.vmap(lambda a: wheel_shape(rig, jnp.full(rig.size, a))[0])(angles)


def spline_of(rig, angles):
    """The first wheel's shape at these angles, by one program a rig."""
    return np.asarray(_shapes(rig, jnp.asarray(np.resize(angles, PLACES))))[: len(angles)]


@pytest.mark.parametrize("seed", range(6))
def test_a_closing_row_of_few_digits_is_the_first_row(seed):
    rng = np.random.default_rng(seed)
    period = 2 * math.pi / (ROLLERS if seed % 2 else 1)
    rows, digits = int(rng.integers(24, 120)), int(rng.integers(5, 9))
    exact = np.linspace(0, period, rows + 1) + rng.choice([0.0, 1e-3 * period / rows, 0.4])
    phase = rng.uniform(0, 2 * math.pi, 3)
    wave = sum(
        1e-4 / k * np.sin(2 * math.pi * k * exact / period + p) for k, p in enumerate(phase, 1)
    )
    noise = rng.normal(size=rows + 1) * 2e-7  # so that the ends differ
    theta = [float(f"{x:.{digits}g}") for x in exact]
    rig = rig_of(theta, wave + noise)
    between = spline_of(rig, np.linspace(0, 2 * math.pi, PLACES))
    assert np.abs(between).max() < 1.05 * np.abs(wave).max() + 1e-5
    shown = spline_of(rig, exact[:-1])
    assert shown == pytest.approx(wave[:-1], abs=3e-6)
    assert spline_of(rig, exact[:1] + period) == pytest.approx(shown[:1], abs=1e-9)


def test_a_spline_has_no_jump_wherever_its_rows_begin():
    """A first row below 0, or just above it, left the cubic of the piece before in one piece."""
    rng = drawn_anew("where rows begin")
    period = 2 * math.pi / ROLLERS
    for _ in range(200):
        rows = int(rng.integers(5, 14))
        first = rng.choice([-0.3, -1e-4, 0.0, 1e-4, 5e-3, 0.3]) * rng.uniform(0.5, 1)
        theta = (np.arange(rows) + np.append(first, rng.uniform(-0.3, 0.3, rows - 1))) * (
            period / rows
        )
        shape = laws.TableShape.fit(theta, rng.normal(size=rows), period)
        length, c = np.diff(shape.knots), np.asarray(shape.coefficients).T
        for order in range(3):  # value, slope and half the curvature at the ends of the pieces
            factors = [math.comb(k, order) for k in range(order, 4)]
            powers = length[:, None] ** np.arange(4 - order)
            ends = np.sum(powers * factors * c[order:].T, axis=1)
            np.testing.assert_allclose(
                ends, np.roll(c[order], -1), rtol=0, atol=1e-9 * np.abs(c[order]).max()
            )


@pytest.mark.parametrize("early", [0.011, 0.05, 0.099])
@pytest.mark.parametrize("period", [2 * math.pi, 2 * math.pi / ROLLERS])
def test_a_row_just_before_the_first_is_kept(early, period):
    """A spline has a knot at angle 0; of the saved rows the last was taken for the first again, and
    a sweep gave figures of another wheel than `simulate`."""
    step = period / 26
    theta = np.arange(26) * step - early * step
    rho = 4e-5 * np.sin(2 * np.pi * theta / period) + 1e-5 * np.cos(6 * np.pi * theta / period)
    rig = rig_of(theta, rho)
    again = parse_rig(tomllib.loads(rig_text(rig)))
    np.testing.assert_array_equal(again.profiles[0].knots, rig.profiles[0].knots)
    at = np.linspace(0, 2 * np.pi, PLACES)
    shapes = [jax.vmap(lambda x, r=r: wheel_shape(r, x * jnp.ones(3))[0])(at) for r in (rig, again)]
    np.testing.assert_allclose(*shapes, rtol=0, atol=1e-18)


def test_a_table_whose_ends_differ_is_refused():
    theta = np.linspace(0, 2 * math.pi, 61)
    rho = 1e-4 * np.sin(theta)
    rho[-1] += 1e-5
    with pytest.raises(InputError, match="does not close: rho is"):
        rig_of([*theta[:-1], 6.28319], rho)


def test_rows_far_closer_than_the_others_are_refused():
    theta = np.linspace(0, 2 * math.pi, 61)[:-1].tolist()
    theta.insert(20, theta[19] + 1e-6)
    with pytest.raises(InputError, match=r"row 22 is 1e-06 rad after the one before it.*Keep one"):
        rig_of(theta, 1e-4 * np.sin(theta))


PITCH = 2 * math.pi / ROLLERS


RUNOUT = laws.WheelRunout(jnp.asarray(5e-5), jnp.asarray(0.4))
DAMAGE = laws.DamagedRoller(jnp.asarray(2.0), jnp.asarray(1.0))


def rig_of_one_pitch(*on_it):
    """The Atlas rig with a measured pitch on its first wheel, and laws there."""
    theta = np.linspace(0, PITCH, 13)
    wave = 5e-5 * np.sin(2 * math.pi * theta / PITCH) + 2e-5 * np.cos(4 * math.pi * theta / PITCH)
    rig = rig_of(theta, wave)
    for law in on_it:
        rig = rig.add(law, "w1")
    return rig


@pytest.mark.full
def test_a_measured_pitch_with_laws_is_the_same_when_it_is_traced():
    """With both laws at once, each of which moves the figures by more than they may differ."""
    rig, speed, names = rig_of_one_pitch(RUNOUT, DAMAGE), [5.0, 3.0, 4.0], ("rms", "peak")
    run = evaluate(simulate(rig, speeds(speed), duration=0.5, rate=400), rig, names)
    steady, asked = steady_state(rig, speed), {"parameters": ["sphere.mass"]}
    for path in ("effect.wheel-runout.w1.amplitude", "effect.damaged-roller.w1.severity"):
        without = steady_state(set_parameter(rig, path, 0.0), speed)
        assert abs(without.rms / steady.rms - 1) > 1e-6
    traced = sensitivity(rig, speed, names, duration=0.5, rate=400, **asked)
    assert traced.figures == pytest.approx(np.array([run[name] for name in names]), rel=1e-9)
    traced = sensitivity(rig, speed, names, **asked)
    assert traced.figures == pytest.approx(np.array([steady.rms, steady.peak]), rel=1e-9)


def test_rollers_of_a_measured_pitch_cannot_change():
    rig = rig_of_one_pitch(RUNOUT)
    known = [info.path for info in parameter_paths(rig)]
    assert "wheel.w2.rollers" in known
    assert not {"wheel.rollers", "wheel.w1.rollers"} & set(known)
    assert float(get_parameter(rig, "wheel.w1.rollers")) == ROLLERS
    for path in ("wheel.rollers", "wheel.w1.rollers"):
        with pytest.raises(InputError, match=f"`{path}` cannot change: the measured profile of w1"):
            set_parameter(rig, path, 15)
    with pytest.raises(InputError, match="cannot change"):
        sweep(rig, {"wheel.w1.rollers": [12, 14]}, "rms", drive=[5.0, 3.0, 4.0])
    read = Reader()
    assert quantity_of(read, rig, "wheel.rollers", "variable.path") is None
    (said,) = read.problems
    assert said.startswith("`variable.path`: `wheel.rollers` cannot change")
