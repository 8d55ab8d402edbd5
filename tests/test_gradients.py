"""Gradients of the exact paths: forward, reverse and differences, at kinks and moving edges."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import ORTHOGONAL, SKEW, machine
from tiers import tiered

from omnijax.simulation._exact.constant import constant_response
from omnijax.simulation._steady.steady import steady_state

pytestmark = pytest.mark.brief

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
    return jnp.stack([s.rms, s.peak, s.elastic_rms, s.elastic_peak, s.sphere_acceleration_rms])


def _run_figures(x, changed):
    zero = jnp.zeros(3)
    ts = jnp.array([0.0, 0.031, 0.32, 0.33])  # 0.031 s: the fast wheel is near a gap's end
    y = constant_response(changed(x), W, zero, zero, ts, "coupled", None, 20).state
    return y[1:, :3].reshape(-1)


@eqx.filter_jit
def _reverse(rig, figures):
    """One program for all rigs of as many wheels."""
    changed, x = _figures(rig)
    return jax.jacrev(lambda x: figures(x, changed))(x)


@pytest.mark.parametrize(
    "figures", tiered([_steady_figures, _run_figures], lambda f: f is _steady_figures)
)
def test_forward_reverse_and_differences_agree(figures):
    changed, x = _figures(machine(SKEW))

    @jax.jit  # one program for values and slopes
    @functools.partial(jax.jacfwd, has_aux=True)
    def both(x):
        found = figures(x, changed)
        return found, found

    forward = np.asarray(both(x)[0])
    reverse = np.asarray(_reverse(machine(SKEW), figures))
    scale = np.abs(forward).max(axis=1, keepdims=True)
    assert np.all(np.abs(forward - reverse) < 1e-9 * scale)
    h = 2e-5  # error h^4 f^(5)/30 of the five-point rule against rounding 1e-15/h
    for i in (0, 1, 3, 7, 9, 12, 13):
        step = jnp.zeros_like(x).at[i].set(h)
        four = [np.asarray(both(x + k * step)[1]) for k in (-2, -1, 1, 2)]
        difference = (four[0] - 8 * four[1] + 8 * four[2] - four[3]) / (12 * h)
        assert np.all(np.abs(difference - forward[:, i]) < 2e-6 * scale[:, 0]), i


def test_critical_damping_and_round_wheels_have_finite_gradients():
    """C such that two poles of the isolated contact meet; equal wheels make poles coincide."""
    meets = 2 * np.sqrt(188208.0 / (1 / 5.0 + 1 / 0.25))
    for damping, eta in ((meets, 0.4), (0.0, 0.0)):
        rig = machine(ORTHOGONAL, scale=0.0, contact_damping=damping, roundness=eta)
        assert np.all(np.isfinite(_reverse(rig, _run_figures)))
