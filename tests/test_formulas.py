"""Every law's formula against `formulas.py`; `python -m tests.mutants` shows what these hold."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from formulas import DEPTH, GAP, GAPS, PITCH, PROFILES, TABLE, contact

from omnijax import laws


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


def check_table_shape():
    """A spline through samples of a smooth periodic curve is that curve to its fourth order."""

    def curve(angle):
        return 1e-4 * np.cos(2 * np.pi * angle / PITCH - 0.4)

    theta = np.linspace(0.02, 0.02 + PITCH, 64, endpoint=False)
    law = laws.TableShape.fit(theta, curve(theta), PITCH)
    for angle in (0.001, 0.3, 1.0, -0.2, 3 * PITCH + 0.11):
        assert float(law(jnp.asarray(angle), GAPS)) == pytest.approx(float(curve(angle)), abs=5e-10)


def check_sums():
    """Laws of one port add, whichever of them remembers."""
    cubic, slow = (
        made("contact-cubic", {"K3": 2e12}),
        made("contact-relaxation", {"K1": 3e4, "tau": 0.02}),
    )
    both, signal, z = cubic + slow, contact(3e-5)[1], jnp.asarray(1e-5)
    assert float(both(signal, (None, z))) == pytest.approx(0.054 + 0.6)
    assert float(both.rate(signal, (None, z))[1]) == pytest.approx(1e-3)


OTHERS = {
    "damaged-roller": check_damaged_roller,
    "contact-relaxation": check_relaxation,
    "actuator-lag": check_lag,
    "dual-row": check_dual_row,
    "table": check_table_shape,
    "sums": check_sums,
}


@pytest.mark.parametrize("name", [name for name in TABLE if name in laws.EFFECTS])
def test_law_by_hand(name):
    check_law(name)


@pytest.mark.parametrize("name", list(PROFILES))
def test_profile_by_hand(name):
    check_profile(name)


@pytest.mark.parametrize("name", list(OTHERS))
def test_by_hand(name):
    OTHERS[name]()


def test_every_effect_and_profile_has_numbers():
    assert set(laws.EFFECTS) <= set(TABLE) | set(OTHERS)
    assert set(laws.PROFILES) <= set(PROFILES) | set(OTHERS)
