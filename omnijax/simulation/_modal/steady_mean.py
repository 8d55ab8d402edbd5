"""Mean squares of the long run in closed form, and their derivatives by poles and signals.

The response phi of a pole to one unit of a phase's column obeys dphi/dt = lambda phi + rho, and
phi_i phi_j comes back to where it began, so

    mean(phi_i phi_j) = -(R_i + R_j)/(lambda_i + lambda_j),    R_i = mean(rho phi_i)

All that is asked of a signal is R at every pole, the mean of rho and that of its square.  Phases
run independently: variances add up, means add up first.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from .arithmetic import Pair, materialised, stored
from .gradient import ROWS, Slopes, along_poles, of_psi
from .moments import Moments, moments_of
from .phases import PhaseCycle, columns_of, constant, cycle_of, phases_of
from .poles import PolePairs
from .signals import CONSTANT, Signals
from .system import Layout
from .transient import Lanes

LEAST_DECAY = 1e-7  # over a period: what keeps the mean square of an undamped mode finite


class _Phase(NamedTuple):
    """Phases of like kinds with every eigenvalue (q) by itself, both of a pair."""

    moments: Moments
    shown: Complex[Array, "o q s c"]  # what an output shows of what the column gives
    work: Complex[Array, "q s c"]
    direct: Float[Array, "o s c"]
    mean: Float[Array, "o s c"]


def _both(m: PolePairs, a: Pair) -> Complex[Array, "... q c"]:
    """Values at all eigenvalues from those of pairs, the pairs' first ones before the second."""
    k = m.kind > 0 if a[0].ndim == m.kind.ndim else m.kind[:, None] > 0
    one = jax.lax.complex(a[0], jnp.where(k, a[1], 0.0))
    two = jax.lax.complex(jnp.where(k, a[0], a[1]), jnp.where(k, -a[1], 0.0))
    return jnp.concatenate([one, two])


def pairs_of(m: PolePairs, x: Complex[Array, "o q s c"]) -> Pair:
    """Values of pairs, (o, s, p, c), from those at all eigenvalues."""
    count = len(m.kind)
    k, x = m.kind > 0, jnp.moveaxis(x, 1, 2)
    return x[:, :, :count].real, jnp.where(k, x[:, :, :count].imag, x[:, :, count:].real)


def _damped(m: PolePairs, cycles: list[PhaseCycle]) -> PolePairs:
    """Poles that decay a little over every period."""
    longest = jnp.max(jnp.concatenate([cycle.period for cycle in cycles]), axis=0)
    least = -LEAST_DECAY / longest
    second = jnp.where(m.kind > 0, m.l1, jnp.minimum(m.l1, least))
    return m._replace(l0=jnp.minimum(m.l0, least), l1=second)


def _phase(m: PolePairs, pole, layout: Layout, cycle: PhaseCycle, columns, direct) -> _Phase:
    """`pole` (q, c): all eigenvalues."""
    moments = materialised(moments_of, m, cycle)
    k = m.kind > 0
    c0, c1 = m.c0[:ROWS], m.c1[:ROWS]
    c = jnp.where(k, 0.5, 1.0) * c0, jnp.where(k, -0.5, 1.0) * c1
    c = jnp.stack([_both(m, (c[0][o], c[1][o])) for o in range(ROWS)])
    b = jnp.swapaxes(jnp.stack([_both(m, (m.b0[i], m.b1[i])) for i in columns]), 0, 1)
    shown, D = c[:, :, None] * b, jnp.moveaxis(direct[columns], 1, 0)
    mean = (D - jnp.sum(shown / pole[:, None], axis=1).real) * moments.level
    return _Phase(moments, shown, _both(m, moments.work), D, mean)


class MeanSquare(NamedTuple):
    """The mean of |dR|^2 and what its derivatives are made of."""

    value: Float[Array, " c"]
    phases: list[_Phase]
    kernels: list[Complex[Array, "q s c"]]  # derivatives by `_Phase.work`
    total: Float[Array, "o c"]  # m, mean of dR
    pole: Complex[Array, "q c"]


def mean_square(g: Lanes, layout: Layout) -> MeanSquare:
    """The long run's mean of |dR|^2."""
    groups = phases_of(layout)
    cycles = [cycle_of(g.signals, layout, phases) for phases in groups]
    m, direct = _damped(g.modes, cycles), g.direct[:, :ROWS]
    pole = _both(m, (m.l0, m.l1))
    parts = [
        _phase(m, pole, layout, cycle, columns_of(layout, phases), direct)
        for cycle, phases in zip(cycles, groups, strict=True)
    ]
    total = constant(m, layout, slice(0, ROWS), direct) + sum(
        jnp.sum(part.mean, axis=1) for part in parts
    )
    value, kernels = jnp.sum(total * total, axis=0), []
    between = 1 / (pole[:, None] + pole)  # (q, q, c)
    for part in parts:
        w = part.shown
        together = sum(w[o][:, None] * w[o][None] for o in range(ROWS))  # (q, q, s, c)
        kernel = -2 * jnp.sum(together * between[:, :, None], axis=1)
        kernel = kernel + 2 * jnp.sum(part.direct[:, None] * w, axis=0)
        square = jnp.sum(part.direct**2, axis=0) * part.moments.square
        square = square + jnp.sum(kernel * part.work, axis=0).real
        value = value + jnp.sum(square - jnp.sum(part.mean**2, axis=0), axis=0)
        kernels.append(kernel)
    return MeanSquare(jnp.maximum(value, 0.0), parts, kernels, total, pole)


def steady_slopes(g: Lanes, layout: Layout, mean: MeanSquare) -> Slopes:
    """Derivatives of the long run's mean of |dR|^2."""
    groups = phases_of(layout)
    cycles = [cycle_of(g.signals, layout, phases) for phases in groups]
    m = _damped(g.modes, cycles)
    pole, lanes = mean.pole, g.modes.l0.shape[-1]
    count, pairs = len(layout.kinds), len(m.kind)
    none = jnp.zeros((ROWS, count + 1, pairs, lanes))
    psi, rate, direct = (none, none), (none, none), jnp.zeros((ROWS, count, lanes))
    between = 1 / (pole[:, None] + pole)
    for phases, cycle, part in zip(groups, cycles, mean.phases, strict=True):
        R = part.work
        slope = _both(m, stored(_by_poles, m, cycle))
        more = 2 * (mean.total[:, None] - part.mean)  # (o, s, c)
        w = part.shown[:, None]  # by pole z (q), then j
        sums = R[:, None] + R[None]  # (z, j, s, c)
        b = between[:, :, None]
        value = 2 * (part.direct[:, None] * R - jnp.sum(w * (sums * b), axis=2))
        by = jnp.sum(w * ((sums * b - slope[:, None]) * b), axis=2)
        turned = 2 * (part.direct[:, None] * slope + by)
        level = part.moments.level / pole[:, None]  # (q, s, c)
        value = value - more[:, None] * level
        turned = turned + more[:, None] * level / pole[:, None]
        number = np.array(phases.first)
        psi = put(psi, number, pairs_of(m, value))
        rate = put(rate, number, pairs_of(m, turned))
        seen = jnp.sum(part.shown * R, axis=1).real + part.direct * part.moments.square
        direct = direct.at[:, number].set(2 * seen + more * part.moments.level)
    for i, kind in enumerate(layout.kinds):
        if kind.phase == CONSTANT:
            held = (-2 * mean.total[:, None] / pole)[:, :, None]
            moved = (2 * mean.total[:, None] / pole**2)[:, :, None]
            psi = put(psi, np.array([i]), pairs_of(m, held))
            rate = put(rate, np.array([i]), pairs_of(m, moved))
            direct = direct.at[:, i].set(2 * mean.total)

    def figure(signals: Signals):
        value = 0.0
        for phases, part, kernel in zip(groups, mean.phases, mean.kernels, strict=True):
            now = moments_of(m, cycle_of(signals, layout, phases))
            gain = part.direct - jnp.sum(part.shown / pole[:, None], axis=1).real
            more = 2 * jnp.sum((mean.total[:, None] - part.mean) * gain, axis=0)
            square = jnp.sum(part.direct**2, axis=0) * now.square + more * now.level
            value += jnp.sum(square) + jnp.sum((kernel * _both(m, now.work)).real)
        return value

    both = of_psi(g.modes, layout, psi, rate)
    return Slopes(*both, jax.grad(figure)(g.signals), jnp.swapaxes(direct, 0, 1))


def _by_poles(m: PolePairs, cycle: PhaseCycle) -> Pair:
    """Derivative of `Moments.work` by the poles."""
    return along_poles(m, lambda m: moments_of(m, cycle).work)[1]


def put(a: Pair, number: np.ndarray, b: Pair) -> Pair:
    """a with the signals `number` (second axis) as in b."""
    first, second = (x.at[:, number].set(y) for x, y in zip(a, b, strict=True))
    return first, second
