"""Mean squares of outputs of the long run behind linear filters, in closed form.

Behind a filter H(s) = sum h_j/(s - mu_j) the response of a pole z is that of z itself and of all
poles of the filter, H(s)/(s - z) = H(z)/(s - z) + sum h_j/(mu_j - z)/(s - mu_j).  So an output
sum_i w_i/(s - lambda_i) + D0 + D1 s = G(s) shows w_i H(lambda_i) of its own poles and h_j G(mu_j)
of the filter's, and nothing of rho goes straight through.  No filter lets a constant pass.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from .._poles import PolePairs
from ..gradient import Slopes
from ..lanes import Lanes
from ..system import Layout
from .mean import (
    LongRunMeans,
    MeanSquares,
    Psi,
    against,
    both_of,
    by_pairs,
    kernel_of,
)
from .moments import Moments
from .phases import phases_of


class FilterPoles(NamedTuple):
    """Filters of one output each by their poles above the real axis, which all have in common."""

    pole: Complex[Array, " p"]  # 1/s
    residue: Complex[Array, "o p"]

    def pairs(self, like: PolePairs) -> PolePairs:
        """The poles as pairs."""
        one = jnp.ones((len(self.pole), like.l0.shape[-1]))
        pole = self.pole[:, None]
        return like._replace(kind=one, l0=one * pole.real, l1=one * pole.imag)

    @property
    def both(self) -> tuple[Complex[Array, " j"], Complex[Array, "o j"]]:
        """All poles and residues."""
        return (
            jnp.concatenate([self.pole, self.pole.conj()]),
            jnp.concatenate([self.residue, self.residue.conj()], axis=1),
        )


class FilteredPhase(NamedTuple):
    """What phases of like kinds show behind the filters, of all poles; the design's own first."""

    shown: Complex[Array, "o q s c"]
    work: Complex[Array, "q s c"]
    kernel: Complex[Array, "o q s c"]


class FilteredSquares(NamedTuple):
    """Means of the squares behind the filters."""

    value: Float[Array, "o c"]
    phases: list[FilteredPhase]
    pole: Complex[Array, "q c"]


def filtered_squares(mean: MeanSquares, filters: FilterPoles) -> FilteredSquares:
    """Of the outputs that `mean` is of, which was made of means of the filters' poles too."""
    mu, h = filters.both
    own = mean.pole
    pole = jnp.concatenate([own, jnp.broadcast_to(mu[:, None], (len(mu), own.shape[-1]))])
    between = 1 / (own - mu[:, None, None])  # (j, q, c)
    through = jnp.sum(h[:, :, None, None] * between, axis=1)[:, :, None]  # H(lambda), (o, q, 1, c)
    m, value, parts = filters.pairs(mean.modes), 0.0, []
    for part in mean.phases:
        first, second = (x[-len(m.kind) :] for x in part.moments.work)
        seen = -jnp.sum(part.shown[:, None] * between[:, :, None], axis=2)  # (o, j, s, c)
        seen = seen + part.direct[:, None] + part.slope[:, None] * mu[:, None, None]
        shown = jnp.concatenate([part.shown * through, h[:, :, None, None] * seen], axis=1)
        work = jnp.concatenate([part.work, both_of(m, (first, second))])
        kernel = kernel_of(pole, shown)
        value = value + jnp.sum(jnp.sum(kernel * work, axis=1).real, axis=1)
        parts.append(FilteredPhase(shown, work, kernel))
    return FilteredSquares(jnp.maximum(value, 0.0), parts, pole)


def filtered_slopes(
    g: Lanes, layout: Layout, rows: np.ndarray, means: LongRunMeans, mean: MeanSquares,
    behind: FilteredSquares, filters: FilterPoles, weight: Float[Array, "m o c"],
) -> Slopes:  # fmt: skip
    """Derivatives of sums of these, times `weight`."""
    mu, h = filters.both
    count, own = len(mean.pole), mean.pole
    m, filter_pairs = mean.modes, filters.pairs(mean.modes)
    between = 1 / (own - mu[:, None, None])  # (j, q, c)
    h_ = h[:, :, None, None]
    through = jnp.sum(h_ * between, axis=1)[:, :, None]
    bent = -jnp.sum(h_ * between**2, axis=1)[:, :, None]

    def bar(part: FilteredPhase) -> Moments:
        by = jnp.sum(weight[:, :, None, None] * part.kernel, axis=1)  # (m, q, s, c)
        each = by_pairs(m, by[:, :count]), by_pairs(filter_pairs, by[:, count:])
        first, second = (jnp.concatenate(x, axis=1) for x in zip(*each, strict=True))
        none = jnp.zeros_like(first[:, 0])
        return Moments((first, second), none, none)

    slopes, signals = means.pulled([bar(part) for part in behind.phases])
    psi = Psi.none(g, layout, len(rows))
    for phases, part, known in zip(phases_of(layout), behind.phases, slopes, strict=True):
        slope = both_of(m, (known[0][: len(m.kind)], known[1][: len(m.kind)]))
        every = jnp.concatenate([slope, 0.0 * part.work[count:]])
        whole, by = against(behind.pole, part.shown, part.work, behind.pole, part.work, every)
        at_mu = h[:, :, None, None] * whole[:, count:]  # (o, j, s, c)
        whole, by = whole[:, :count], by[:, :count]
        over = at_mu[:, :, None] * between[:, :, None]  # (o, j, q, s, c)
        value = through * whole - jnp.sum(over, axis=1)
        turned = bent * whole + through * by + jnp.sum(over * between[:, :, None], axis=1)
        direct, rate = (jnp.sum(x, axis=1).real for x in (at_mu, at_mu * mu[:, None, None]))
        psi = psi.put(phases.first(layout), m, value, turned, direct, rate)
    return psi.weighted(g, layout, rows, weight, signals)
