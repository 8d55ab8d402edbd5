"""Recursions against those of scipy; runs that are near a fit."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from omnijax.diagnosis import Point, RigModel
from omnijax.diagnosis._recursion import BLOCK, recursion


@pytest.mark.parametrize("samples", [1, 2, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK])
@pytest.mark.parametrize("dtype", [float, complex])
def test_recursions_are_those_of_a_filter(samples, dtype):
    rng = np.random.default_rng(samples)
    x = rng.normal(size=(samples, 3)).astype(dtype)
    keep = [dtype(0.9), dtype(-0.3), dtype(1.0)]
    if dtype is complex:
        x += 1j * rng.normal(size=x.shape)
        keep = [k * complex(np.exp(0.4j)) for k in keep]
    y = x.copy()
    recursion(keep, y)
    for k, one in enumerate(keep):
        known = lfilter([1.0], [1.0, -one], x[:, k])
        np.testing.assert_allclose(y[:, k], known, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("moved", "near"), [(0.05, True), (0.15, False)])
def test_runs_are_based_near_a_fit_within_a_part_of_its_errors(moved, near):
    errors = np.array([0.2, 1e-3])
    fit = SimpleNamespace(point=Point(np.array([0.3, moved * 1e-3])), covariance=np.diag(errors**2))
    begun = Point(np.array([0.3, 0.0]))

    def based_near(about: Point | None, rolls: bool) -> bool:
        model = SimpleNamespace(_about=about, machine=SimpleNamespace(rolls=rolls))
        return RigModel.based_near(model, fit)  # pyright: ignore[reportArgumentType]

    assert based_near(begun, rolls=False) is near
    assert not based_near(begun, rolls=True)
    assert not based_near(None, rolls=False)
