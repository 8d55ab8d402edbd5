"""Gradients of the exact paths: forward, reverse and differences, at kinks and moving edges."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import ORTHOGONAL, SKEW, machine

from omnijax.simulation._bulk.contact import Contact, approach, poles, residues
from omnijax.simulation._bulk.pole_pair import exponential
from omnijax.simulation._exact.constant import constant_response
from omnijax.simulation._steady.steady import steady_state

W = jnp.array([0.4, 5.2, -1.3])
PLACES = lambda r: (  # noqa: E731
    r.wheels.roundness,
    r.wheels.contact.stiffness,
    r.wheels.contact.damping,
    r.wheels.radius,
    r.sphere.radius,
    r.sphere.mass,
)


def _figures(rig):
    """(x -> figures, x0): x scales every parameter of `PLACES` about the rig's own."""
    base = PLACES(rig)
    sizes = [int(np.size(b)) for b in base]

    def changed(x):
        parts = jnp.split(x, np.cumsum(sizes)[:-1])
        new = tuple(b * p.reshape(jnp.shape(b)) for b, p in zip(base, parts, strict=True))
        return eqx.tree_at(PLACES, rig, new)

    return changed, jnp.ones(sum(sizes))


def _steady_figures(x, changed):
    s = steady_state(changed(x), W, harmonics=4, grid_bits=7)
    return jnp.stack([s.rms, s.peak, s.rms_elastic, s.peak_elastic, s.rms_acceleration])


def _run_figures(x, changed):
    zero = jnp.zeros(3)
    ts = jnp.array([0.0, 0.031, 0.32, 0.33])  # 0.031 s: the fast wheel is near a gap's end
    y = constant_response(changed(x), W, zero, zero, ts, "coupled", None, 20).state
    return y[1:, :3].reshape(-1)


@pytest.mark.parametrize("figures", [_steady_figures, _run_figures])
def test_forward_reverse_and_differences_agree(figures):
    changed, x = _figures(machine(SKEW))
    f = jax.jit(lambda x: figures(x, changed))
    forward = np.asarray(jax.jit(jax.jacfwd(lambda x: figures(x, changed)))(x))
    reverse = np.asarray(jax.jit(jax.jacrev(lambda x: figures(x, changed)))(x))
    scale = np.abs(forward).max(axis=1, keepdims=True)
    assert np.all(np.abs(forward - reverse) < 1e-9 * scale)
    h = 2e-5  # error h^4 f^(5)/30 of the five-point rule against rounding 1e-15/h
    for i in (0, 1, 3, 7, 9, 12, 13):
        step = jnp.zeros_like(x).at[i].set(h)
        four = [np.asarray(f(x + k * step)) for k in (-2, -1, 1, 2)]
        difference = (four[0] - 8 * four[1] + 8 * four[2] - four[3]) / (12 * h)
        assert np.all(np.abs(difference - forward[:, i]) < 2e-6 * scale[:, 0]), i


def test_critical_damping_and_round_wheels_have_finite_gradients():
    """C such that two poles of the isolated contact meet; equal wheels make poles coincide."""
    meets = 2 * np.sqrt(188208.0 / (1 / 5.0 + 1 / 0.25))
    for damping, eta in ((meets, 0.4), (0.0, 0.0)):
        rig = machine(ORTHOGONAL, scale=0.0, contact_damping=damping, roundness=eta)
        changed, x = _figures(rig)
        slope = jax.jit(jax.jacrev(lambda x, c=changed: _run_figures(x, c)))(x)
        assert np.all(np.isfinite(slope))


def test_pole_pairs_are_smooth_where_they_meet():
    u, t = -30.0, 0.07
    f = lambda D: jnp.stack(exponential(u, D, t))  # noqa: E731
    slopes = [np.asarray(jax.jacfwd(f)(D)) for D in (-1e-6, 0.0, 1e-6)]
    assert np.all(np.isfinite(slopes)) and np.ptp(slopes, axis=0).max() < 1e-9
    for D in (-400.0, -2.0, 0.0, 3.0, 250.0):
        h = 1e-4 * max(abs(D), 1.0)
        want = (np.asarray(f(D + h)) - np.asarray(f(D - h))) / (2 * h)
        assert np.allclose(jax.jacfwd(f)(D), want, rtol=1e-6, atol=1e-12)


def test_residues_give_the_transfer_function():
    """Sum over pole pairs of (weight)/(s - pole) is x/rho of the contact, at any damping."""
    for damping in (0.0, 120.0, 423.0, 20000.0):
        numbers = (0.2, 4.0, 0.1, 188208.0, damping, 1e6, 50.0, 1e4)
        p = Contact(*(jnp.full((1, 1), v) for v in numbers))
        roots = poles(p)
        r = residues(roots, approach(p, jnp.ones((1, 1)), jnp.zeros((1, 1))))
        s = 37.0 + 210.0j
        a, b, g, K, C, k, c, Kc = numbers
        kappa, sigma, h = K + C * s, k + c * s, a * b + a * g + b * g
        one, two = s**2 + a * kappa + (a + g) * Kc, s**2 + b * kappa + (b + g) * sigma
        want = kappa * (a * s**2 + h * sigma)
        want = want / (one * two - (a * kappa - g * sigma) * (b * kappa - g * Kc))
        u, D = np.asarray(roots.u)[:, 0, 0], np.asarray(roots.D)[:, 0, 0]
        e, f = np.asarray(r.u)[:, 0, 0], np.asarray(r.v)[:, 0, 0]
        have = np.sum((f * (s - u) + e) / ((s - u) ** 2 - D))
        assert abs(have / want - 1) < 1e-10
