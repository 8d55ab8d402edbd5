"""Hertz contact, and every law of the library under one contract."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from omnijax import laws
from omnijax.laws import ContactSignal, _hertz

pytestmark = pytest.mark.brief

FORCES = jnp.array([1.0, 30.0, 400.0])
RADIUS, MODULUS = 0.0713, 4e8


def test_hertz_identities():
    depth = _hertz.approach(FORCES, RADIUS, MODULUS)
    np.testing.assert_allclose(_hertz.normal_force(depth, RADIUS, MODULUS), FORCES, rtol=1e-13)
    closed = (9 * FORCES**2 / (16 * RADIUS * MODULUS**2)) ** (1 / 3)
    np.testing.assert_allclose(depth, closed, rtol=1e-13)
    a = _hertz.patch_radius(FORCES, RADIUS, MODULUS)
    np.testing.assert_allclose(
        _hertz.peak_pressure(FORCES, RADIUS, MODULUS) * 2 * jnp.pi * a**2 / 3, FORCES, rtol=1e-13
    )
    slope = jax.vmap(jax.grad(lambda d: _hertz.normal_force(d, RADIUS, MODULUS)))(depth)
    np.testing.assert_allclose(_hertz.tangent_stiffness(FORCES, RADIUS, MODULUS), slope, rtol=1e-13)
    np.testing.assert_allclose(_hertz.spin_lever(FORCES, RADIUS, MODULUS), 3 * jnp.pi * a / 16)


def test_hertz_without_contact_has_finite_gradients():
    for function in (_hertz.patch_radius, _hertz.peak_pressure, _hertz.approach):
        value, slope = jax.value_and_grad(lambda n, f=function: f(n, RADIUS, MODULUS))(0.0)
        assert value == 0.0 and np.isfinite(slope)


def test_hertz_law_is_tangent_to_the_linear_spring():
    signal = ContactSignal(*(jnp.asarray(x) for x in (0.0, 0.0, 2e5, 100.0, 150.0, RADIUS)))
    law = laws.ContactHertz()

    def force(deflection):
        return law(signal._replace(deflection=deflection))

    assert float(force(0.0)) == 0.0
    assert abs(float(jax.grad(force)(0.0))) < 1e-6 * 2e5
    # once the contact is gone its force is the lost preload, whatever the distance
    reach = 1.5 * 150.0 / 2e5
    assert float(force(2 * reach) + 2e5 * 2 * reach) == pytest.approx(150.0)
    modulus = float(law.effective_modulus(signal))
    depth = _hertz.approach(150.0, RADIUS, modulus)
    assert float(depth) == pytest.approx(reach)


def _signal(law):
    one = jnp.asarray(1.0)
    vector = jnp.array([0.3, -0.5, 0.7])
    return {
        "contact": ContactSignal(
            3e-5 * one, 2e-3 * one, 2e5 * one, 1e2 * one, 90 * one, 0.07 * one
        ),
        "mount": laws.MountSignal(2e-5 * one, 1e-3 * one, 1e6 * one, 60 * one),
        "separation": -5.0 * one,
        "shaft": laws.ShaftSignal(0.4 * one, 1.3 * one, 0.2 * one, 0.3 * one),
        "actuator": laws.ActuatorSignal(0.2 * one, 0.4 * one, 1.3 * one),
        "command": 0.37 * one,
        "radius": 0.07 * one,
        "rolling": laws.RollingSignal(0.02 * one, -0.01 * one, 120 * one, 0.9 * one),
        "sphere": laws.BodySignal(vector, jnp.eye(3), 5 * one, jnp.array([0, 0.3, -9.8])),
        "platform": 0.37 * one,
        "kinematics": 1.3 * one,
        "surface": vector / jnp.linalg.norm(vector),
        "sensor": laws.SensorSignal(
            jnp.linspace(0, 1, 101), jnp.sin(jnp.linspace(0, 9, 303)).reshape(101, 3)
        ),
        "shape": 0.21 * one,
    }[law.port]


def _example(law):
    """A law with every parameter non-zero."""
    values = {
        name: (jnp.array([0.2, 0.5, -0.4]) if p.shape else jnp.asarray(0.013))
        for name, p in law.parameters.items()
    }
    special = {
        "damaged-roller": {"roller": jnp.asarray(0.0), "profile": laws.GatedSine()},
        "mount-backlash": {"gap": jnp.asarray(5e-6)},
        "contact-hertz": {"exponent": jnp.asarray(1.5), "modulus": jnp.asarray(1e8)},
        "contact-relaxation": {"K1": jnp.asarray(1e4), "tau": jnp.asarray(0.05)},
        "sensor-delay": {"delay": jnp.asarray(0.0137)},
        "stribeck": {"torque": jnp.asarray(0.013), "speed": jnp.asarray(1.3)},
    }
    return law(**(values | special.get(law.id, {})))


def _call(law, signal):
    if law.port == "shape":
        gap = laws.Gap(*(jnp.asarray(x) for x in (1.22, 0.0758, 14.0, 0.6)))
        return law(signal, gap)
    return law(signal, law.initial() + 0.01) if law.initial() is not None else law(signal)


def _flat(value):
    return jnp.concatenate([jnp.ravel(x) for x in jax.tree.leaves(value)])


@pytest.mark.parametrize("law", laws.EFFECTS.values(), ids=lambda law: law.id)
def test_law_contract(law):
    example, signal = _example(law), _signal(law)
    value = _flat(_call(example, signal))
    assert jnp.all(jnp.isfinite(value)) and jnp.any(value != 0), "a non-zero amplitude is an effect"
    compiled, rounding = _flat(eqx.filter_jit(_call)(example, signal)), 1e-15 * jnp.abs(value).max()
    np.testing.assert_allclose(compiled, value, rtol=1e-12, atol=rounding)
    squares = eqx.filter_grad(lambda x: jnp.sum(_flat(_call(x, signal)) ** 2))
    gradient = eqx.filter_jit(squares)(example)
    assert all(jnp.all(jnp.isfinite(g)) for g in jax.tree.leaves(gradient))
    if law.port != "shape" and example.initial() is None:
        double = example + example
        np.testing.assert_allclose(_flat(double(signal)), 2 * value, rtol=1e-12)
        np.testing.assert_allclose(_flat(sum([example, example])(signal)), 2 * value, rtol=1e-12)
    linear = [name for name, p in law.parameters.items() if p.linear]
    if linear:
        none = eqx.tree_at(
            lambda x: [getattr(x, n) for n in linear], example, replace_fn=jnp.zeros_like
        )
        assert jnp.all(_flat(_call(none, signal)) == 0), "zero amplitude is no effect"
    assert law.formula and law.places and law.port in laws.PORTS
    assert set(law.parameters) <= set(laws.field_names(law))


def test_laws_of_different_ports_do_not_add():
    with pytest.raises(ValueError, match="different ports do not add: contact, mount"):
        _ = laws.ContactCubic(jnp.asarray(1.0)) + laws.MountCubic(jnp.asarray(1.0))
