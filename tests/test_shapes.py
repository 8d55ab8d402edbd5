"""Wheel shapes against their geometry, and their limits at round and all-gap wheels."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from omnijax import laws
from omnijax.laws import Gap

R, R_B, N = 1.22, 0.0758, 14.0
PERIODIC = (laws.GatedSine(), laws.HalfSine(), laws.Rollers())


def _gap(roundness):
    return Gap(*(jnp.asarray(x) for x in (R, R_B, N, roundness)))


def test_depth_of_the_papers_wheel():
    depth = float(_gap(0.4485).depth)
    assert depth == pytest.approx(4.0734e-4, rel=1e-4)
    assert np.sqrt(3) * depth == pytest.approx(7.055e-4, rel=1e-3)
    assert depth / R_B == pytest.approx(0.00537, rel=1e-3)


def test_rollers_profile_is_the_distance_of_the_centres():
    """Against a search: the closest the sphere can come without entering the roller's arcs."""
    gap = _gap(0.4485)
    edges = np.array([-1, 1]) * float(gap.width) / 2
    corners = R_B * np.stack([np.cos(edges), np.sin(edges)], 1)
    for fraction in (0.05, 0.3, 0.5, 0.8):
        at = fraction * float(gap.width)
        direction = np.array([np.cos(at - float(gap.width) / 2), np.sin(at - float(gap.width) / 2)])
        low, high = R, R + R_B + 1e-3
        for _ in range(60):  # bisection on "both corners outside the sphere"
            middle = (low + high) / 2
            free = np.all(np.linalg.norm(middle * direction - corners, axis=1) >= R)
            low, high = (low, middle) if free else (middle, high)
        rho = float(laws.Rollers()(jnp.asarray(at), gap))
        assert rho == pytest.approx(high - R - R_B, abs=1e-13)


@pytest.mark.parametrize("profile", [*PERIODIC, laws.ContinuousSine()], ids=lambda p: p.id)
@pytest.mark.parametrize("roundness", [0.0, 1e-9, 0.3, 1.0])
def test_values_and_gradients_are_finite(profile, roundness):
    angles = jnp.linspace(-1.0, 7.0, 97)

    def total(eta, angle):
        return profile(angle, _gap(eta))

    values, slopes = jax.vmap(jax.value_and_grad(total), (None, 0))(jnp.asarray(roundness), angles)
    assert jnp.all(jnp.isfinite(values)) and jnp.all(jnp.isfinite(slopes))
    if roundness == 0.0:
        assert jnp.all(values == 0)


@pytest.mark.parametrize("profile", PERIODIC, ids=lambda p: p.id)
def test_shape_is_continuous_and_periodic(profile):
    gap = _gap(0.37)
    edges = jnp.array([0.0, float(gap.width), float(gap.width) / 2])
    for edge in edges:
        left, right = profile(edge - 1e-12, gap), profile(edge + 1e-12, gap)
        np.testing.assert_allclose(left, right, atol=1e-13)
    angles = jnp.linspace(0.01, 0.4, 50)
    shape = jax.vmap(lambda a: profile(a, gap))
    np.testing.assert_allclose(shape(angles), shape(angles + 3 * gap.pitch), atol=1e-16)
    assert float(jnp.min(shape(jnp.linspace(0, 0.5, 5001)))) == pytest.approx(
        -float(gap.depth),
        rel=1e-3,  # a kink at mid-gap between two samples
    )


def test_continuous_sine_is_not_periodic_in_the_pitch():
    """Eq. 11 as printed: only an integer 1/eta makes it so (erratum 8 against 11)."""
    angle = jnp.asarray(0.1)
    for roundness, same in ((0.4485, False), (0.5, True)):
        gap = _gap(roundness)
        shifted = laws.ContinuousSine()(angle + gap.pitch, gap)
        assert bool(jnp.isclose(shifted, laws.ContinuousSine()(angle, gap), atol=1e-12)) == same


def test_table_follows_its_samples_and_is_periodic():
    theta = np.linspace(0, 2 * np.pi, 40, endpoint=False) + 0.05
    rho = 1e-4 * np.cos(3 * theta + 0.2) + 3e-5 * np.sin(theta)
    table = laws.TableShape.fit(theta, rho, 2 * np.pi)
    shape = jax.vmap(lambda a: table(a, _gap(0.3)))
    np.testing.assert_allclose(shape(jnp.asarray(theta)), rho, atol=1e-15)
    np.testing.assert_allclose(shape(jnp.asarray(theta + 4 * np.pi)), rho, atol=1e-15)
    between = np.linspace(0, 6.28, 173)
    exact = 1e-4 * np.cos(3 * between + 0.2) + 3e-5 * np.sin(between)
    np.testing.assert_allclose(shape(jnp.asarray(between)), exact, atol=3e-7)


def test_dual_row_switches_while_a_roller_carries():
    gap, row = _gap(0.45), laws.DualRow(jnp.asarray(0.03))
    angles = jnp.linspace(0, float(gap.pitch), 400, endpoint=False)
    side = jax.vmap(lambda a: row.lateral(a, gap))(angles)
    first_gap = angles < gap.width
    second_gap = jnp.mod(angles - gap.pitch / 2, gap.pitch) < gap.width
    assert jnp.all(side[first_gap] == -0.015), "on the second row while the first has its gap"
    assert jnp.all(side[second_gap] == 0.015)
    assert jnp.all(jax.vmap(lambda a: row(a, gap))(angles) == 0)
