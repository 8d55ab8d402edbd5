"""The paper's case: what it gives, and the ranges over which its claims are judged."""

from collections.abc import Mapping
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.stats import qmc

from ..rig import Rig, get_parameter, load_rig, put_parameter

SPEEDS = (0.1, 1.2, 0.3)  # rad/s, the elastic cases
MULTIPLES = (1, 12, 3)  # of their common 0.1 rad/s
TORQUE = (0.1, 0.2, 0.3)  # N m, the ideal case
FORCE = (0.1, 0.2, 0.3)  # N
DAMPING = (0.0, 8500.0, 20000.0)  # N s/m
ROUNDNESS = (0.1, 0.2, 0.3, 0.4, 0.4485, 0.5, 0.6, 0.7, 0.8, 0.9)
STIFFNESS = tuple(188208.0 * np.geomspace(0.1, 10.0, 7))  # N/m
SENSITIVITY_DAMPING = (120.0, 8500.0, 20000.0)  # N s/m; the chosen one in place of 0


class PaperRange(NamedTuple):
    """The range of a parameter that the paper does not give, sampled on a logarithmic scale."""

    path: str
    symbol: str
    unit: str
    low: float
    high: float


RANGES = (
    PaperRange("wheel.mount.stiffness", "k", "N/m", 2e5, 2e7),
    PaperRange("wheel.mount.damping", "c", "N s/m", 10.0, 1000.0),
    PaperRange("wheel.closure.stiffness", "K'", "N/m", 1e3, 5e4),
    PaperRange("sphere.inertia", "I_s", "kg m²", 0.4 * 5 * 1.22**2, 2 / 3 * 5 * 1.22**2),
    PaperRange("wheel.inertia", "I_w", "kg m²", 2e-4, 2e-3),
)


def baseline(rig: str = "atlas") -> Rig:
    """The rig of the paper's section 3.1."""
    return load_rig(rig)


def changed(rig: Rig, values: Mapping[str, Float[Array, ""] | float]) -> Rig:
    """`rig` with the parameters of `values`, traced or not."""
    for path, value in values.items():
        rig = put_parameter(rig, path, value)
    return rig


def samples(rig: Rig, count: int, seed: int) -> dict[str, Float[Array, " s"]]:
    """The rig's own values, then `count` points of a scrambled Sobol sequence over `RANGES`."""
    own = [float(np.ravel(_own(rig, r.path))[0]) for r in RANGES]
    sobol = qmc.Sobol(len(RANGES), seed=seed)  # pyright: ignore[reportCallIssue]
    unit = sobol.random_base2(max(count - 1, 1).bit_length())[:count]
    low, high = (np.log([getattr(r, end) for r in RANGES]) for end in ("low", "high"))
    points = np.vstack([own, np.exp(low + unit * (high - low))])
    return {r.path: jnp.asarray(points[:, i]) for i, r in enumerate(RANGES)}


def gap_depths(rig: Rig) -> Float[np.ndarray, " eta"]:
    """Depth (m) of the first wheel's gaps at every ratio of `ROUNDNESS`."""

    def depth(eta: float) -> float:
        gaps = eqx.tree_at(lambda g: g.roundness, rig.gaps, np.full(rig.size, eta))
        return float(np.asarray(gaps.depth)[0])

    return np.array([depth(eta) for eta in ROUNDNESS])


def _own(rig: Rig, path: str):
    return np.asarray(get_parameter(rig, path))
