"""Mean squares of the long run in closed form, and their derivatives by poles and signals.

The response phi of a pole to one unit of a phase's column obeys dphi/dt = lambda phi + rho, and
phi_i phi_j comes back to where it began, so

    mean(phi_i phi_j) = -(R_i + R_j)/(lambda_i + lambda_j),    R_i = mean(rho phi_i)

All that is asked of a signal is R at every pole and the means of rho and of its square.  Phases run
independently: variances add up, means add up first.

Wheels at rest accelerate nothing: of an acceleration sum w phi + D rho + E drho/dt under the rho of
a wheel, D is sum w/lambda.  It is sum (w/lambda) psi + E drho/dt, psi the response to drho/dt,
whose squares do not cancel where rho is slow beside the poles, as those of the three parts do.  A
floor takes the machine with it.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from .._poles import PolePairs
from ..arithmetic import Pair, materialised, product, summed
from ..gradient import Slopes, seen
from ..lanes import Lanes
from ..signals import CONSTANT, Signals
from ..system import Layout
from .moments import Moments, moments_of, rates_of
from .phases import (
    PhaseCycle,
    Phases,
    columns_of,
    constant,
    cycle_of,
    of_each,
    phases_of,
    wide,
)
from .pulled import PulledBack, with_pull_back

LEAST_DECAY = 1e-7  # over a period: what keeps the mean square of an undamped mode finite


class LongRunMeans(NamedTuple):
    """Means over the periods of all phases, and the way back from their derivatives."""

    modes: PolePairs  # that decay
    kind: Float[Array, "p c"]  # of all pairs, the design's own first
    rates: bool  # of drho/dt in the place of rho
    phases: list[Moments]
    back: PulledBack | None

    def pulled(self, bars: list[Moments]) -> tuple[list[Pair], Signals]:
        """Derivatives of every R by its pole, (p, s, c), and of sums of all means by the signals.

        `bars`: what the sums (m) are of, each with that leading axis.
        """
        assert self.back is not None
        return self.back(self.kind, bars)


def means_of(
    g: Lanes, layout: Layout, rates: bool, gradient: bool, more: PolePairs | None = None
) -> LongRunMeans:
    """Of the designs' pairs and then `more`; `rates`: of drho/dt in the place of rho."""
    groups = phases_of(layout)

    def cycle_under(signals: Signals, phases: Phases) -> PhaseCycle:
        cycle = cycle_of(signals, layout, phases)
        return rates_of(cycle, of_wheels(layout, phases)) if rates else cycle

    cycles = [cycle_under(g.signals, phases) for phases in groups]
    m = own = damped(g.modes, cycles)
    if more is not None:
        kind, l0, l1 = (
            jnp.concatenate(x) for x in ((m.kind, more.kind), (m.l0, more.l0), (m.l1, more.l1))
        )
        m = m._replace(kind=kind, l0=l0, l1=l1)

    if not gradient:
        each = [materialised(moments_of, wide(m), x) for x in cycles]
        return LongRunMeans(own, m.kind, rates, each, None)

    def of_group(phases: Phases):
        def of(pole: Pair, signals: Signals) -> Moments:
            return moments_of(
                wide(m)._replace(l0=pole[0], l1=pole[1]), cycle_under(signals, phases)
            )

        return of

    def unit(part: Moments) -> Moments:
        none = jax.tree.map(jnp.zeros_like, part)
        one = jnp.ones_like(part.work[0])
        return none._replace(work=(one, jnp.where(m.kind[:, None] > 0, 0.0, one)))

    each, back = with_pull_back(
        [of_group(phases) for phases in groups], groups, [of_each(m, cycle) for cycle in cycles],
        g.signals, unit, lambda part: part.work,
    )  # fmt: skip
    return LongRunMeans(own, m.kind, rates, materialised(lambda x: x, each), back)


def of_wheels(layout: Layout, phases: Phases) -> Bool[np.ndarray, "s 1"]:
    """Which of the phases are those of wheels."""
    return np.array([column < layout.wheels for column in columns_of(layout, phases)])[:, None]


class PhaseMoments(NamedTuple):
    """Phases of like kinds with every eigenvalue (q) by itself, both of a pair."""

    moments: Moments
    shown: Complex[Array, "o q s c"]  # what an output shows of what the column gives
    work: Complex[Array, "q s c"]
    direct: Float[Array, "o s c"]  # by what the moments are those of: rho, or drho/dt
    slope: Float[Array, "o s c"]  # by drho/dt
    mean: Float[Array, "o s c"]
    rated: Bool[np.ndarray, "s 1"]  # the phases whose moments are those of drho/dt


def both_of(m: PolePairs, a: Pair) -> Complex[Array, "... q c"]:
    """Values at all eigenvalues from those of pairs, the pairs' first ones before the second."""
    k = m.kind > 0 if a[0].ndim == m.kind.ndim else m.kind[:, None] > 0
    one = jax.lax.complex(a[0], jnp.where(k, a[1], 0.0))
    two = jax.lax.complex(jnp.where(k, a[0], a[1]), jnp.where(k, -a[1], 0.0))
    return jnp.concatenate([one, two])


def by_pairs(m: PolePairs, by: Complex[Array, "... q s c"]) -> Pair:
    """Derivatives by pairs of a sum's real part whose terms are `by` times values at all
    eigenvalues.
    """
    k, (one, two) = m.kind[:, None] > 0, jnp.split(by, 2, axis=-3)
    return (
        one.real + jnp.where(k, two.real, 0.0),
        jnp.where(k, two.imag - one.imag, two.real),
    )


def pairs_of(m: PolePairs, x: Complex[Array, "o q s c"]) -> Pair:
    """Values of pairs, (o, s, p, c), from those at all eigenvalues."""
    count = len(m.kind)
    k, x = m.kind > 0, jnp.moveaxis(x, 1, 2)
    return x[:, :, :count].real, jnp.where(k, x[:, :, :count].imag, x[:, :, count:].real)


def damped(m: PolePairs, cycles: list[PhaseCycle]) -> PolePairs:
    """Poles that decay a little over every period."""
    longest = jnp.max(jnp.concatenate([cycle.period for cycle in cycles]), axis=0)
    least = -LEAST_DECAY / longest
    second = jnp.where(m.kind > 0, m.l1, jnp.minimum(m.l1, least))
    return m._replace(l0=jnp.minimum(m.l0, least), l1=second)


def _phase(
    g: Lanes, m: PolePairs, pole, moments: Moments, columns, rows: np.ndarray, rated: np.ndarray
) -> PhaseMoments:
    """`pole` (q, c): all eigenvalues."""
    k = m.kind > 0
    work = moments.work[0][: len(k)], moments.work[1][: len(k)]
    c = jnp.where(k, 0.5, 1.0) * m.c0[rows], jnp.where(k, -0.5, 1.0) * m.c1[rows]
    c = jnp.stack([both_of(m, (c[0][o], c[1][o])) for o in range(len(rows))])
    b = jnp.swapaxes(jnp.stack([both_of(m, (m.b0[i], m.b1[i])) for i in columns]), 0, 1)
    D, slope = (jnp.moveaxis(x[columns][:, rows], 1, 0) for x in (g.direct, g.slope))
    shown = c[:, :, None] * b
    over = shown / pole[:, None]
    mean = jnp.where(rated, 0.0, (D - jnp.sum(over, axis=1).real) * moments.level)
    shown, direct = jnp.where(rated, over, shown), jnp.where(rated, slope, D)
    return PhaseMoments(moments, shown, both_of(m, work), direct, slope, mean, rated)


class MeanSquares(NamedTuple):
    """Means of the squares of some outputs and what their derivatives are made of."""

    value: Float[Array, "o c"]
    phases: list[PhaseMoments]
    kernels: list[Complex[Array, "o q s c"]]  # derivatives by `PhaseMoments.work`
    total: Float[Array, "o c"]  # mean of the outputs
    modes: PolePairs  # that decay
    pole: Complex[Array, "q c"]


def mean_squares(g: Lanes, layout: Layout, rows: np.ndarray, means: LongRunMeans) -> MeanSquares:
    """The long run's means of the squares of the outputs `rows`.

    Accelerations where the means are of rates, else outputs that show nothing of drho/dt.
    """
    m = means.modes
    pole = both_of(m, (m.l0, m.l1))
    parts = [
        _phase(
            g, m, pole, part, columns_of(layout, phases), rows,
            of_wheels(layout, phases) & means.rates,
        )
        for part, phases in zip(means.phases, phases_of(layout), strict=True)
    ]  # fmt: skip
    total = constant(m, layout, rows, g.direct) + sum(jnp.sum(part.mean, axis=1) for part in parts)
    value, kernels = total * total, []
    for part in parts:
        kernel = kernel_of(pole, part.shown) + 2 * part.direct[:, None] * part.shown
        square = jnp.sum(kernel * part.work, axis=1).real
        square = square + part.direct**2 * part.moments.square
        value = value + jnp.sum(square - part.mean**2, axis=1)
        kernels.append(kernel)
    return MeanSquares(jnp.maximum(value, 0.0), parts, kernels, total, m, pole)


def kernel_of(pole: Complex[Array, "q c"], shown: Complex[Array, "o q s c"]):
    """Derivatives (o, q, s, c) of the mean of (sum shown phi)^2 by R."""
    between = (1 / (pole[:, None] + pole))[:, :, None]  # (q, q, 1, c)
    return -2 * shown * jnp.stack([jnp.sum(w * between, axis=1) for w in shown])


def against(pole, shown, work, z, at_z, slope):
    """Twice the mean of (sum shown phi) phi_z, (o, z, s, c), and its derivative by z.

    `pole` (q, c), `shown` (o, q, s, c), `work` (q, s, c): all R; `z` (z, c) other poles, `at_z`
    (z, s, c) their R and `slope` its derivative by z.
    """
    between = (1 / (z[:, None] + pole))[:, :, None]  # (z, q, 1, c)
    sums = (at_z[:, None] + work) * between  # (z, q, s, c)
    turn = (sums - slope[:, None]) * between
    value, by = (jnp.stack([jnp.sum(w * x, axis=1) for w in shown]) for x in (sums, turn))
    return -2 * value, 2 * by


def mean_slopes(
    g: Lanes, layout: Layout, rows: np.ndarray, means: LongRunMeans, mean: MeanSquares,
    weight: Float[Array, "m o c"],
) -> Slopes:  # fmt: skip
    """Derivatives of sums of mean squares, times `weight`."""
    m, pole, w = mean.modes, mean.pole, weight[:, :, None]
    slopes, signals = means.pulled(
        [_bar(m, pole, mean, *x, w) for x in zip(mean.phases, mean.kernels, strict=True)]
    )
    psi = Psi.none(g, layout, len(rows))
    for phases, part, own in zip(phases_of(layout), mean.phases, slopes, strict=True):
        R, S, slope = part.work, part.moments.square, both_of(m, own)
        more = 2 * (mean.total[:, None] - part.mean)  # (o, s, c); the level of rates is 0
        value, turned = against(pole, part.shown, R, pole, R, slope)
        level = more[:, None] * (part.moments.level / pole[:, None])  # (o, q, s, c)
        value = value + 2 * part.direct[:, None] * R - level
        turned = turned + 2 * part.direct[:, None] * slope + level / pole[:, None]
        direct = jnp.sum(part.shown * R, axis=1).real + part.direct * S
        direct, rate = 2 * direct + more * part.moments.level, None
        if means.rates:  # by w from those by w/lambda, and nothing by D, which w and lambda give
            over = value / pole[:, None]
            turned = jnp.where(part.rated, (turned - over) / pole[:, None], turned)
            value, rate = (jnp.where(part.rated, x, y) for x, y in ((over, value), (direct, 0.0)))
            direct = jnp.where(part.rated, 0.0, direct)
        psi = psi.put(phases.first(layout), m, value, turned, direct, rate)
    for i, kind in enumerate(layout.kinds):
        if kind.phase == CONSTANT:
            held = (-2 * mean.total[:, None] / pole)[:, :, None]
            moved = (2 * mean.total[:, None] / pole**2)[:, :, None]
            psi = psi.put((i,), m, held, moved, 2 * mean.total[:, None])
    return psi.weighted(g, layout, rows, weight, signals)


def _bar(m: PolePairs, pole, mean: MeanSquares, part: PhaseMoments, kernel, w) -> Moments:
    """Derivatives of mean squares times w (m, o, 1, c) by what a phase's means are."""
    gain = part.direct - jnp.sum(part.shown / pole[:, None], axis=1).real
    more = jnp.where(part.rated, 0.0, 2 * (mean.total[:, None] - part.mean) * gain)
    work = by_pairs(m, jnp.sum(w[:, :, None] * kernel, axis=1))
    return Moments(work, jnp.sum(w * more, axis=1), jnp.sum(w * part.direct**2, axis=1))


class Psi(NamedTuple):
    """Psi of `gradient` for some outputs (o), at every pair, of every signal and the start (s).

    With its derivative by the poles, and derivatives by what goes straight to the outputs.
    """

    value: Pair  # (o, s + 1, p, c)
    turned: Pair
    direct: Float[Array, "o s c"]
    rate: Float[Array, "o s c"]

    @classmethod
    def none(cls, g: Lanes, layout: Layout, rows: int) -> "Psi":
        """Of outputs that nothing is asked of."""
        pairs, lanes = g.modes.l0.shape
        pair, flat = (jnp.zeros((rows, len(layout.columns) + n, *shape, lanes))
                      for n, shape in ((1, (pairs,)), (0, ())))  # fmt: skip
        return cls((pair, pair), (pair, pair), flat, flat)

    def put(self, numbers, m: PolePairs, value, turned, direct, rate=None) -> "Psi":
        """With these signals' own, at all eigenvalues."""
        at = np.array(numbers)

        def own(known: Pair, x) -> Pair:
            first, second = (y.at[:, at].set(z) for y, z in zip(known, pairs_of(m, x), strict=True))
            return first, second

        return Psi(
            own(self.value, value),
            own(self.turned, turned),
            self.direct.at[:, at].set(direct),
            self.rate if rate is None else self.rate.at[:, at].set(rate),
        )

    def weighted(self, g: Lanes, layout: Layout, rows: np.ndarray, weight, signals) -> Slopes:
        """Derivatives of sums of figures of the outputs `rows`, times `weight` (m, o, c)."""
        m = g.modes
        b = m.given([*layout.columns, -1])
        own = [x[:, None] for x in seen(m.kind, (m.c0[rows], m.c1[rows]))]

        def shown(x: Pair) -> Pair:
            first, second = (
                summed(weight[:, :, None, None] * y[None], 1) for y in product(m.kind, own, x)
            )
            return first, second

        def given(x: Pair) -> Pair:
            each = (summed(y, 1) for y in product(m.kind, b, x))  # (o, p, c)
            first, second = (_on_rows(weight[:, :, None] * y, rows, layout) for y in each)
            return first, second

        def straight(x):
            return jnp.moveaxis(_on_rows(weight[:, :, None] * x, rows, layout), 1, 2)

        return Slopes(
            shown(self.value),
            shown(self.turned),
            given(self.value),
            given(self.turned),
            signals,
            straight(self.direct),
            straight(self.rate),
        )


def _on_rows(x: Float[Array, "m o ..."], rows: np.ndarray, layout: Layout):
    """Of all outputs that figures are made of."""
    return jnp.zeros((len(x), layout.rows, *x.shape[2:])).at[:, rows].set(x)
