"""Every law's formula against `formulas.py`; `python -m tests.mutants` shows what these hold."""

import math
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from formulas import (
    DEPTH,
    GAP,
    GAPS,
    PITCH,
    PROFILES,
    TABLE,
    TANH_2,
    contact,
    mount,
    rolling,
    shaft,
)

from omnijax import laws
from omnijax.laws import _hertz as hertz
from omnijax.simulation import ramp, sample_times, speeds, step, table
from omnijax.simulation._drives import as_times


def applied(law, port, signal):
    """What a law returns, flat."""
    if port == "shape":
        value = law(jnp.asarray(signal), GAPS)
    else:
        value = law(signal if hasattr(signal, "_fields") else jnp.asarray(signal, float))
    return np.concatenate([np.ravel(x) for x in jax.tree.leaves(value)])


def made(name, parameters):
    """The law of an effect with its parameters as arrays."""
    return laws.EFFECTS[name](**{k: jnp.asarray(v, float) for k, v in parameters.items()})


def check_law(name):
    cases = [(*case[:2], np.ravel(np.asarray(case[2], float))) for case in TABLE[name]]
    size = max(np.abs(expected).max() for *_, expected in cases)
    for parameters, (port, signal), expected in cases:
        law = made(name, parameters)
        assert law.port == port
        found = applied(law, port, signal)
        assert found.shape == expected.shape
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * size)


def check_profile(name):
    for angle, expected in PROFILES[name]:
        law = laws.PROFILES[name]()
        assert float(law(jnp.asarray(angle), GAPS)) == pytest.approx(expected, abs=1e-14), angle


def check_damaged_roller():
    """Gap 2 of 10 alone, from 4 pi/10 on, modulo a turn: rho (1 + s)."""
    law = laws.DamagedRoller(jnp.asarray(2.0), jnp.asarray(0.5), laws.GatedSine())
    assert law.port == "shape"
    for turn in (0.0, 2 * math.pi, -2 * math.pi):
        for gap in range(10):
            angle = jnp.asarray(turn + gap * PITCH + GAP / 4)
            expected = -0.5 * DEPTH if gap == 2 else 0.0
            assert float(law(angle, GAPS)) == pytest.approx(expected, abs=1e-14)
    wave = laws.DamagedRoller(jnp.asarray(2.0), jnp.asarray(0.5), laws.ContinuousSine())
    for inside in (0.1, 0.9, 1.1, 1.6):  # a profile that goes on behind the gap is as it was there
        angle = jnp.asarray(2 * PITCH + inside * GAP)
        expected = 0.5 * float(wave.profile(angle, GAPS)) * (inside < 1)
        assert float(wave(angle, GAPS)) == pytest.approx(expected, abs=1e-14)


def check_relaxation():
    """K1 (delta - z) with dz/dt = (delta - z)/tau, z = 0 at rest."""
    law = made("contact-relaxation", {"K1": 3e4, "tau": 0.02})
    assert law.port == "contact"
    signal = contact(5e-5, rate=0.1)[1]
    assert float(law.initial()) == 0.0
    assert float(law(signal, jnp.asarray(2e-5))) == pytest.approx(0.9)
    assert float(law(signal)) == pytest.approx(1.5)
    assert float(law.rate(signal, jnp.asarray(2e-5))) == pytest.approx(1.5e-3)


def check_lag():
    """x - u acts beside u, with dx/dt = (u - x)/tau."""
    law = made("actuator-lag", {"tau": 0.02})
    assert law.port == "actuator"
    signal = laws.ActuatorSignal(*map(jnp.asarray, (0.8, 0.0, 0.0)))
    assert float(law(signal, jnp.asarray(0.5))) == pytest.approx(-0.3)
    assert float(law.rate(signal, jnp.asarray(0.5))) == pytest.approx(15.0)


def check_dual_row():
    """No shape; the contact is half a spacing to one side, to the other half a pitch later.

    It is on the second row (-) for the quarter pitch each side of the first row's mid-gap.
    """
    law = laws.DualRow(jnp.asarray(0.03))
    assert float(law(jnp.asarray(0.2), GAPS)) == 0.0
    middle, reach = GAP / 2, PITCH / 4
    second = [middle, middle + PITCH, middle - reach + 1e-3, middle + reach - 1e-3]
    first = [middle - reach - 1e-3, middle + reach + 1e-3]
    for angle, side in [*((a, -1) for a in second), *((a, 1) for a in first)]:
        assert float(law.lateral(jnp.asarray(angle), GAPS)) == pytest.approx(side * 0.015)
    for turn in (-PITCH, 0.0, 3 * PITCH):  # the switch next to an angle: a quarter from the middles
        for end in (-1, 1):
            at = turn + middle + end * reach
            for apart in (-0.9 * reach, 1e-3, 0.9 * reach):
                assert float(law.switch(jnp.asarray(at + apart), GAPS)) == pytest.approx(at)


def check_table_shape():
    """A spline through samples of a smooth periodic curve is that curve to its fourth order."""

    def curve(angle):
        return 1e-4 * np.cos(2 * np.pi * angle / PITCH - 0.4)

    theta = np.linspace(0.02, 0.02 + PITCH, 64, endpoint=False)
    law = laws.TableShape.fit(theta, curve(theta), PITCH)
    for angle in (0.001, 0.3, 1.0, -0.2, 3 * PITCH + 0.11, PITCH - 1e-3, PITCH - 0.011):
        assert float(law(jnp.asarray(angle), GAPS)) == pytest.approx(float(curve(angle)), abs=5e-10)


def rho_of(pieces, angle):
    """The shape that pieces of one period tell at an angle in it."""
    return float(laws.value(pieces, *laws.piece_at(pieces, jnp.asarray(angle))))


def check_pieces(name):
    """Each profile as pieces: the numbers worked out by hand, and its own at other angles.

    For the other sense of turning the pieces run backwards; padding changes no number.
    """
    if name == "table":
        waves = 1e-4 * np.cos(2 * np.pi * np.linspace(0, 1, 7, endpoint=False) - 0.4)
        law = laws.TableShape.fit(PITCH * np.linspace(0, 1, 7, endpoint=False), waves, PITCH)
    else:
        law = laws.PROFILES[name]()
    pieces = laws.shape_pieces(law, GAPS)
    period = float(np.sum(pieces.width))
    assert period == pytest.approx(GAP if name == "continuous-sine" else PITCH, rel=1e-14)
    inside = period * np.array([0.003, 0.07, 0.19, 0.31, 0.39, 0.41, 0.77, 0.994])
    expected = [float(law(jnp.asarray(angle), GAPS)) for angle in inside]
    if name in PROFILES:
        angles, numbers = zip(*PROFILES[name], strict=True)
        inside, expected = [*inside, *np.mod(angles, period)], [*expected, *numbers]
    back, (count, size) = laws.mirrored(pieces), pieces.polynomial.shape
    wide = laws.padded(pieces, count + 2, size + 1, pieces.sine.shape[1] + 1)
    assert wide.polynomial.shape == (count + 2, size + 2) and wide.width.shape == (count + 2,)
    assert wide.sine.shape == (count + 2, pieces.sine.shape[1] + 1) == wide.frequency.shape
    for angle, rho in zip(inside, expected, strict=True):
        near([rho_of(one, angle) for one in (pieces, wide)], [rho, rho], rtol=1e-10)
        near(rho_of(back, period - angle), rho, rtol=1e-10)


def check_places():
    """Ends of pieces, pieces of no width, and Chebyshev's interpolation."""
    round_wheel = laws.Gap(GAPS.sphere_radius, GAPS.wheel_radius, GAPS.rollers, jnp.asarray(0.0))
    for name in ("gated-sine", "half-sine", "continuous-sine", "rollers"):
        pieces = laws.shape_pieces(laws.PROFILES[name](), round_wheel)
        near(float(np.sum(pieces.width)), PITCH)
        assert rho_of(pieces, 0.3) == 0.0
    pieces = laws.Pieces(jnp.array([1.0, 0.0, 2.0]), *[jnp.zeros((3, 1))] * 4)
    for angle, index, v in ((0.0, 0, 0), (0.5, 0, 0.5), (1.0, 2, 0), (2.5, 2, 0.75), (3.0, 2, 1)):
        at, place = laws.piece_at(pieces, jnp.asarray(angle))
        assert (int(at), float(place)) == (index, v)
    near(laws.chebyshev_nodes(2), [math.sqrt(0.75), 0, -math.sqrt(0.75)])
    near(laws.to_powers(3) @ (2 - laws.chebyshev_nodes(3) ** 3), [2, 0, 0, -1])
    assert laws.to_powers(3).shape == (4, 4)


def check_sums():
    """Laws of one port add, whichever of them remembers."""
    cubic, slow = (
        made("contact-cubic", {"K3": 2e12}),
        made("contact-relaxation", {"K1": 3e4, "tau": 0.02}),
    )
    both, signal, z = cubic + slow, contact(3e-5)[1], jnp.asarray(1e-5)
    assert float(both(signal, (None, z))) == pytest.approx(0.054 + 0.6)
    assert float(both.rate(signal, (None, z))[1]) == pytest.approx(1e-3)


def check_generic():
    """The further laws of other machines' shafts and mounts."""
    quadratic, uneven, drag, spring, loaded = laws.GENERIC.values()
    near(quadratic(k2=jnp.asarray(3e9))(mount(-2e-5, 0.4)[1]), 1.2)
    near(uneven(b=jnp.asarray(0.2))(shaft(0.7, -3.0, 0.9)[1]), -0.6)
    near(uneven(b=jnp.asarray(0.2))(shaft(0.7, 3.0, 0.9)[1]), -0.6)
    near(drag(D=jnp.asarray(0.2))(shaft(0.7, -3.0, 0.9)[1]), 1.8)
    near(drag(D=jnp.asarray(0.2))(shaft(0.7, 3.0, 0.9)[1]), -1.8)
    near(spring(k=jnp.asarray(0.2))(shaft(0.7, -3.0, 0.9)[1]), -0.14)
    loaded, half = loaded(kappa=jnp.asarray(0.2), width=jnp.asarray(6.0)), math.tanh(0.5)
    for speed, load, friction in ((-3.0, 0.9, 0.162), (3.0, -0.9, -0.162)):
        near(loaded(laws.ShaftSignal(0.7, speed, 2.0, load)), friction * half)


def near(found, expected, rtol=1e-12):
    np.testing.assert_allclose(found, expected, rtol=rtol, atol=1e-15)


def check_hertz():
    """Eqs. 12-31 at a = 1 mm, R' = 0.05 m: N = 4 E' a^3/(3 R'), E' = 3 MPa -> N = 0.08 N."""
    a, radius, modulus, force = 1e-3, 0.05, 3e6, 0.08
    for found, expected in (
        (hertz.effective_radius(1.2, 0.06), 0.072 / 1.26),
        (hertz.effective_modulus(1e6, 0.5, 3e6, 0.0), 1 / (0.75e-6 + 1e-6 / 3)),
        (hertz.effective_modulus(3e6, 0.0, 1e6, 0.5), 1 / (0.75e-6 + 1e-6 / 3)),
        (hertz.patch_radius(force, radius, modulus), a),
        (hertz.peak_pressure(force, radius, modulus), 1.5 * force / (math.pi * 1e-6)),
        (hertz.approach(force, radius, modulus), 2e-5),
        (hertz.normal_force(2e-5, radius, modulus), force),
        (hertz.tangent_stiffness(force, radius, modulus), 6e3),
        (hertz.spin_lever(force, radius, modulus), 3e-3 * math.pi / 16),
    ):
        near(found, expected)
    for function in (hertz.patch_radius, hertz.peak_pressure, hertz.normal_force):
        assert float(function(-1.0, radius, modulus)) == 0.0
    law = laws.HertzResistance(*map(jnp.asarray, (radius, modulus, 2.0, 0.01)))
    found = law(rolling(0.02, -0.02, force, 0.5)[1])
    turn = 3 * math.pi / 16 * 0.5 * force * a * TANH_2
    near(np.array(found), (2 * a * force * TANH_2, -turn, 2 * a * force * TANH_2))
    # E' = 0.75 c/sqrt(R') with c = N0/d0^1.5, here d0 = 1.5 * 160/2.4e5 = 1 mm, R' = 0.07 m
    signal = contact(stiffness=2.4e5, preload=160.0)[1]
    near(laws.ContactHertz().effective_modulus(signal), 120 / 1e-3**1.5 / math.sqrt(0.07))


def check_signal():
    """A polygon through (0, 0), (1, 2), (3, -2), held before and after."""
    signal = table([0.0, 1.0, 3.0], [[0.0], [2.0], [-2.0]])
    at = [-1.0, 0.0, 0.5, 1.0, 2.0, 3.0, 5.0]
    near([float(signal(t)[0]) for t in at], [0, 0, 1, 2, 0, -2, -2])
    near([float(signal.rate(t)[0]) for t in at], [0, 2, 2, -2, -2, 0, 0])
    near([float(signal.integral(t)[0]) for t in at], [0, 0, 0.25, 1, 2, 1, -3])
    assert float(table([0.0, 1.0], [[3.0], [4.0]]).integral(-2.0)[0]) == -6.0
    twice = signal + table([0.5, 1.5], [[1.0], [2.0]])
    near([float(twice(t)[0]) for t in (0.0, 1.0, 2.0, 4.0)], [1, 3.5, 2, 0])
    near([float(twice.rate(t)[0]) for t in (0.2, 0.7, 1.2, 2.0)], [2, 3, -1, -2])
    near([float(ramp(1.0, 3.0, 5.0, 6.0)(t)[0]) for t in (0, 1, 2, 3, 4)], [5, 5, 5.5, 6, 6])
    near([float(step(1.0, 5.0, 6.0)(t)[0]) for t in (0, 0.999, 1, 2)], [5, 5, 6, 6])
    drive = speeds(signal, initial_angle=[0.7])
    near(drive.angle(2.0, 0.5), [0.7 + 2 - 0.25])
    near(speeds([3.0]).angle(2.0, 0.5), [4.5])
    near(sample_times(0.01, 400.0), [0.0, 0.0025, 0.005, 0.0075, 0.01])
    near(as_times("4 ms"), [0.0, 0.002, 0.004])
    near(as_times([0.0, 0.3, 1.0]), [0.0, 0.3, 1.0])
    with pytest.raises(ValueError, match=r"does at row 2 \(0.5 s\)"):
        table([0.0, 1.0, 0.5], [[0.0], [1.0], [2.0]])


OTHERS = {
    "generic": check_generic,
    "hertz": check_hertz,
    "signals in time": check_signal,
    "damaged-roller": check_damaged_roller,
    "contact-relaxation": check_relaxation,
    "actuator-lag": check_lag,
    "dual-row": check_dual_row,
    "table": check_table_shape,
    "sums": check_sums,
    "pieces": check_places,
} | {f"pieces of {name}": partial(check_pieces, name) for name in (*PROFILES, "table")}


CHECKS = (
    {name: partial(check_law, name) for name in TABLE if name in laws.EFFECTS}
    | {name: partial(check_profile, name) for name in PROFILES}
    | OTHERS
)


@pytest.mark.parametrize("name", list(CHECKS))
def test_by_hand(name):
    CHECKS[name]()


def test_every_effect_and_profile_has_numbers():
    assert set(laws.EFFECTS) | set(laws.PROFILES) <= set(CHECKS)
