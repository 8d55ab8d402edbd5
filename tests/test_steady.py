"""Steady states against long exact runs, harmonic sums and known single-contact results."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import ANY_SPEEDS, ORTHOGONAL, SKEW, drawn_machine, machine
from seeds import drawn_anew
from tiers import tiered

from omnijax import InputError, laws
from omnijax.rig import set_parameter, up
from omnijax.simulation import propagate, simulate, speeds, steady_state
from omnijax.vibration import (
    STEADY_METRICS,
    SteadyRun,
    evaluate,
    steady_metrics,
    weighted_acceleration,
)

pytestmark = [pytest.mark.long, pytest.mark.brief, ANY_SPEEDS]


def _harmonic(rig, w, count=6000):
    """RMS of |dR| of the `paper` model by Parseval: 2x2 transfer functions, sampled shape."""
    total, n = 0.0, rig.size
    for i in range(n):
        wheels = jax.tree.map(lambda x, i=i: np.asarray(x)[i], rig.wheels)
        gap = jax.tree.map(lambda x, i=i: x[i], rig.gaps)
        size = 1 << 18
        angle = jnp.arange(size) / size * gap.pitch
        rho = np.fft.rfft(np.asarray(jax.vmap(lambda a, i=i, g=gap: rig.profiles[i](a, g))(angle)))
        s = 1j * abs(w[i]) * 2 * np.pi / float(gap.pitch) * np.arange(count)
        kappa = wheels.contact.stiffness + wheels.contact.damping * s
        sigma = wheels.mount.stiffness + wheels.mount.damping * s
        a, b = 1 / float(rig.sphere.mass), 1 / wheels.mass
        one = s**2 + a * (kappa + wheels.closure.stiffness)
        two = s**2 + b * (kappa + sigma)
        line = kappa * (a * s**2 + a * b * sigma) / (one * two - a * b * kappa**2)
        line = line * rho[:count] / size
        total += np.abs(line[0]) ** 2 + 2 * np.sum(np.abs(line[1:]) ** 2)
    return np.sqrt(total)


@pytest.mark.full  # in the gate long runs, and C: test_steady_bulk
def test_rms_agrees_with_thousands_of_harmonics():
    """Undamped, damped and overdamped contacts, by one program."""
    rigs = [machine(ORTHOGONAL, contact_damping=damping) for damping in (0.0, 120.0, 20000.0)]
    w = (0.4, 1.2, -0.7)
    several = jax.tree.map(lambda *x: jnp.stack(x), *rigs)
    figures = eqx.filter_jit(
        lambda rigs: jax.lax.map(lambda rig: steady_state(rig, w, model="paper"), rigs)
    )(several)
    for rig, rms in zip(rigs, figures.rms, strict=True):
        assert abs(float(rms) / _harmonic(rig, w) - 1) < 1e-6
    # along axes at right angles the suprema come together in the long run
    together = np.asarray(figures.peak) / np.linalg.norm(figures.peak_component, axis=1)
    np.testing.assert_allclose(together, 1, rtol=0, atol=1e-9)


@pytest.mark.full  # in the gate every metric of drawn rigs, below
def test_agrees_with_a_long_run():
    rig, w = machine(SKEW), np.array([0.9, 2.1, -1.4])
    state = steady_state(rig, w)
    ts = jnp.linspace(0.0, 300.0, 150_001)[100_000:]
    tail = propagate(rig, speeds(w, initial_angle=jnp.asarray(w * ts[0])), ts[:20_001])
    settled = np.asarray(tail.dR)[4000:]
    size = np.linalg.norm(settled, axis=1)
    assert size.max() < float(state.peak) * (1 + 1e-9)  # a supremum: reached only in the long run
    assert size.max() > 0.9 * float(state.peak)
    assert abs(np.sqrt(np.mean(size**2)) / float(state.rms) - 1) < 0.03


@pytest.mark.full  # in the gate: test_extremes
def test_suprema_among_a_thousand_hardly_damped_oscillations():
    rig, w = machine(ORTHOGONAL), jnp.array([0.124, -0.108, -0.3115])
    for path, value in (
        ("contact.stiffness", [779936.1224, 906076.7251, 685539.6767]),
        ("contact.damping", [441.9673, 11.6667, 237.8142]),
        ("mount.damping", [104.0304, 3.744, 935.6238]),
        ("wheel.roundness", [0.7218, 0.9098, 0.3146]),
    ):
        rig = set_parameter(rig, path, jnp.asarray(value))
    found, fine = (steady_state(rig, w, grid_bits=b) for b in (None, 13))
    for name in ("peak", "elastic_peak", "peak_component"):  # 512 places miss them by over 1e-5
        np.testing.assert_allclose(getattr(found, name), getattr(fine, name), rtol=1e-9)


def _top(size):
    """The maximum of a period's samples, by a parabola: they may lie beside it by half a step."""
    k = int(np.argmax(size))
    left, mid, right = size[k - 1], size[k], size[(k + 1) % len(size)]
    return mid + (right - left) ** 2 / (8 * (2 * mid - left - right))


CASES = ((0.0, 0, 0), (20000.0, 0, 0), (300.0, 1, 0), (0.0, 0, 1))  # damping, round, at rest


@pytest.fixture(scope="module")
def drawn():
    """(rig of 2 to 5 unlike wheels, model, states): those of `CASES`, then with one wheel turning.

    One program: with numbers known ahead each case would have its own.
    """
    rng = drawn_anew("steady figures")
    n = int(rng.integers(2, 6))
    base, model = drawn_machine(rng, n, laws.GatedSine()), "paper" if n < 3 else "coupled"
    rigs, turning = [], []
    for damping, round_, still in CASES:
        rig = eqx.tree_at(
            lambda r: (r.wheels.contact.damping, r.wheels.roundness),
            base,
            (jnp.full(n, damping), (1.0 - round_) * base.wheels.roundness),
        )
        rigs.append(rig)
        turning.append((1 - still) * rng.uniform(0.3, 7, n) * rng.choice([-1, 1], n))
    every = [*rigs, base], [*turning, np.array([2.0] + [0.0] * (n - 1))]
    stacked = jax.tree.map(lambda *x: jnp.stack(x), *every[0]), jnp.asarray(every[1])
    alike = eqx.filter_jit(
        lambda several: jax.lax.map(lambda one: steady_state(*one, model=model), several)
    )
    return base, model, alike(stacked)


@pytest.mark.full
def test_one_turning_wheel_reaches_its_supremum(drawn):
    """With one wheel in motion the motion is periodic: every figure is reached exactly."""
    rig, model, states = drawn
    state = jax.tree.map(lambda x: x[-1], states)
    period = float(rig.gaps.pitch[0]) / 2.0
    start = round(12 / period) * period  # transients have died away
    ts = jnp.concatenate([jnp.zeros(1), start + period * jnp.arange(4096) / 4096])
    run = propagate(rig, speeds([2.0] + [0.0] * (rig.size - 1)), ts, model=model)
    dR = np.asarray(run.dR)[1:]
    size = np.linalg.norm(dR, axis=1)
    assert abs(np.sqrt(np.mean(size**2)) / float(state.rms) - 1) < 1e-6
    assert abs(_top(size) / float(state.peak) - 1) < 1e-6
    assert np.allclose(np.ptp(dR, axis=0), state.peak_to_peak, rtol=2e-6)
    assert np.allclose(dR.mean(axis=0), state.mean, atol=1e-6 * size.max())
    lines = np.fft.fft(dR, axis=0)[:8] * 2 / len(dR)
    assert np.allclose(lines[1:], state.spectrum[0, 1:8], atol=1e-7 * size.max())
    rollers = float(rig.wheels.rollers[0])
    assert np.allclose(state.order[0, :3], [0, rollers, 2 * rollers])


@pytest.mark.full  # in the gate: test_steady_bulk, test_propagation
def test_drawn_rigs_have_finite_and_ordered_figures(drawn):
    """Contacts undamped or overdamped; round or resting wheels rest."""
    _, _, states = drawn
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(states))
    assert np.all(np.asarray(states.peak_component) <= states.peak[:, None] * (1 + 1e-9))
    for rms, peak, (_, round_, still) in zip(states.rms, states.peak, CASES, strict=False):
        if still or round_:
            assert peak < 1e-15
        else:
            assert 1e-7 < rms < peak < 20 * rms


def test_runout_and_damage_count_over_the_whole_turn():
    def one(severity):
        damaged = laws.DamagedRoller(jnp.asarray(3.0), jnp.asarray(severity))
        rig = machine(SKEW).add(damaged, "w1")
        return steady_state(rig, (0.5, 0.0, 0.0), harmonics=16, grid_bits=7)

    plain, damaged = one(0.0), one(0.8)  # one program
    assert float(damaged.order[0, 1]) == 1
    assert np.max(np.abs(plain.spectrum[0, 1:14])) < 1e-9 * np.max(np.abs(plain.spectrum[0, 14]))
    grown = float(damaged.rms) ** 2 / float(plain.rms) ** 2
    assert 1 + 1.5 / 14 < grown < 1 + 3.0 / 14  # one gap in 14 has (1.8)^2 = 3.24 times the power


@pytest.mark.full
def test_weighted_acceleration_counts_every_harmonic_of_a_slow_turn():
    """Against one whole turn of a run: 64 harmonics of it end at 20 Hz, 25 % too little."""
    runout = laws.WheelRunout(jnp.asarray(5e-5), jnp.asarray(0.3))
    rig = machine(SKEW, gravity=[0.0, 0.0, -9.81]).add(runout, "w1")
    speed, angle = jnp.asarray((2.0, 0.0, 0.0)), jnp.zeros(3)
    of_long_run = jax.jit(lambda w: SteadyRun(rig, w, angle, "coupled").weighted())(speed)
    turn = math.pi * np.arange(8192) / 8192
    run = propagate(rig, speeds(speed), jnp.concatenate([jnp.zeros(1), 5 * math.pi + turn]))
    weighted = weighted_acceleration(jnp.asarray(turn), run.a_sphere[1:], up(rig))
    assert float(of_long_run) == pytest.approx(float(weighted), rel=1e-4)


@pytest.mark.parametrize("count", tiered([1, 3], (3).__eq__))  # rigs
def test_every_steady_metric_is_that_of_a_long_run(count):
    """20 s after 3 s on drawn rigs, every figure that a steady state offers, under a force.

    The ratios of the wheels' speeds are no fractions of small numbers, so that lines lie apart and
    mean squares over the record err by up to 1/(2 pi N), N periods of two lines' difference.  Its
    40 000 samples meet places where all phases come together to a few per cent, from below.  A
    record that is no whole number of periods leaks into the weighted band, which of 40 drawn rigs
    made 5 %, and 14 % of one later (one whole turn of one wheel: see above).  `smooth_peak` of a
    steady state takes exponentials for powers: up to 3 % more.
    """
    rng, n = drawn_anew("every steady metric"), 3
    ts = jnp.concatenate([jnp.zeros(1), jnp.arange(3.0, 23.0, 1 / 1999.7)])

    @jax.jit
    def both(rig, turning, force, angle):
        run = simulate(rig, speeds(turning, force, angle), ts)
        run = jax.tree.map(lambda x: x[1:] if jnp.shape(x)[:1] == ts.shape else x, run)
        said = steady_metrics(rig, turning, STEADY_METRICS, force=force, angles=angle)
        return said, evaluate(run, rig, STEADY_METRICS)

    for _ in range(count):
        rig = drawn_machine(rng, n, rollers=14, gravity=[0.0, 0.0, -9.81])
        rig = eqx.tree_at(lambda r: r.profiles, rig, (laws.GatedSine(),) * n)
        turning = rng.permutation([1.0, 1.272, 1.618]) * rng.uniform(15, 25)
        turning = turning * rng.choice([-1, 1], n)
        said, long = both(rig, turning, rng.uniform(-30, 30, n), rng.uniform(0, 6, n))
        for name in STEADY_METRICS:
            ratio = float(long[name]) / float(said[name])
            if "rms" in name:
                assert abs(ratio - 1) < 3e-3, (name, ratio)
            elif name == "sphere_weighted_acceleration":
                assert -0.02 < ratio - 1 < 0.25, ratio
            elif name == "smooth_peak":
                assert -0.03 < ratio - 1 < 0.02, ratio
            elif "margin" in name:  # a force of one wheel: from above
                spread = abs(float(long["lift_off_margin"])) + 150.0
                gap = float(long[name]) - float(said[name])
                assert -1e-9 * spread < gap < 0.05 * spread, (name, gap, spread)
            else:
                assert 0.92 < ratio < 1 + 1e-6, (name, ratio)


def test_refusal_says_why():
    rig = machine(SKEW).add(laws.LiftOff(), "all")
    with pytest.raises(ValueError, match=r"lift-off.*not linear"):
        steady_state(rig, (0.1, 0.2, 0.3))
    with pytest.raises(ValueError, match="`speeds` must have 3 entries"):
        steady_state(machine(SKEW), (0.1, 0.2))
    speeds = (0.1, 0.2, 0.3)
    for wrong, says in (  # two angles of three wheels went through without a word
        ({"speeds": (0.1, 0.2, np.inf)}, "`speeds` must be finite, but is inf"),
        ({"angles": (0.1, 0.2)}, "`angles` must have 3 entries"),
        ({"angles": "1 deg, 2 N, 0"}, "`angles` must be a number in rad"),
        ({"force": ["1 N", "0", "1 m"]}, "`force` must be a number in N"),
        ({"sharpness": 0}, r"`sharpness` must lie in \(0, inf\), but is 0"),
        ({"sharpness": -4.0}, r"`sharpness` must lie in \(0, inf\), but is -4"),
        ({"harmonics": -1}, r"`harmonics` must be a whole number in \[0, inf\), but is -1"),
        ({"harmonics": 2.5}, "`harmonics` must be a whole number"),
        ({"harmonics": "8"}, "`harmonics` must be a whole number"),
        ({"grid_bits": 7.0}, "`grid_bits` must be a whole number"),
        ({"angles": (0.1, 0.2, np.nan)}, "`angles` must be finite"),
        ({"force": (1.0, 2.0)}, "`force` must have 3 entries"),
        ({"force": (1.0, 2.0, np.inf)}, "`force` must be finite"),
    ):
        with pytest.raises(InputError, match=says):
            steady_state(machine(SKEW), **({"speeds": speeds} | wrong))
