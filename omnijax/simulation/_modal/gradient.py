"""Gradients of RMS and peak by divided differences: no derivative of an eigenvector.

The response x_o = sum_l c_o^T phi_l(A) b_l is linear in functions phi_l that are analytic in the
poles.  A figure whose derivative by x_o(t) is g_o(t) therefore changes by

    sum_ol sum_ij c_oi (V^-1 dA V)_ij b_jl Psi_ol[l_i, l_j]

with Psi_ol(z) = sum_t g_o(t) phi_l(z, t) and the divided difference

    Psi[x, y] = (Psi(x) - Psi(y))/(x - y),    Psi' where the poles are as good as equal,

finite for any basis of a degenerate space.  Here are Psi and Psi' of every pair, and the figure's
derivatives by what the signals are made of; `pull_back` goes on to the matrices.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .blocks import (
    LENGTH,
    Operands,
    State,
    Tables,
    forced,
    materialised,
    particular,
    product,
    row_signal,
    run,
)
from .moment import Moment, Pair, moment
from .poles import Eigen, Modes
from .signals import Signals
from .system import Design, Layout, System
from .transient import Lanes, hermite_peak, outputs_at

ROWS = 3  # outputs that the figures are made of: dR


class Slopes(NamedTuple):
    """Derivatives of a square of a figure; batch last."""

    psi: Pair  # (o, s + 1, p, c), the start last
    rate: Pair  # the same of dPsi/dlambda
    signals: Signals
    direct: Float[Array, "s o c"]


def _along_poles(m: Modes, function):
    """function(m) and its derivative by every pole."""
    one = jnp.ones_like(m.l0), jnp.where(m.kind > 0, 0.0, 1.0)
    return jax.jvp(lambda x, y: function(m._replace(l0=x, l1=y)), (m.l0, m.l1), one)


def _ends(a: Pair, b: Pair) -> Pair:
    """Rows of a, then the one row b."""
    first, second = (jnp.concatenate([x, y[None]]) for x, y in zip(a, b, strict=True))
    return first, second


def _outer(m: Modes, weight: Pair, function: Pair) -> list[Array]:
    """(o, p, c) times (s, p, c)."""
    return list(product(m.kind, [w[:, None] for w in weight], [f[None] for f in function]))


def peak_slopes(g: Lanes, layout: Layout, best, step, count) -> tuple[Array, Slopes]:
    """Square of the refined peak and its derivatives."""
    times = jnp.stack([jnp.clip(best + i, 0, count - 1) for i in (-1, 0, 1)]) * step
    m = g.modes

    def seen(signals, time):
        return outputs_at(g, layout, moment(m, signals, layout, time))

    x, v = jax.lax.map(lambda t: seen(g.signals, t), times)
    top, back = jax.vjp(lambda x, v: hermite_peak(x, v, times, step), x, v)
    weights = back(jnp.ones_like(top))

    def one(total, at):
        time, gx, gv = at

        def psi(m: Modes):
            now: Moment = moment(m, g.signals, layout, time)
            pole = _ends(now.pole, now.decay)
            turned = product(m.kind, (m.l0, m.l1), pole)
            level = jnp.concatenate([now.level, 0.0 * now.level[:1]])[:, None]
            level = level, jnp.where(m.kind > 0, 0.0, level)
            return [
                gx[:, None, None] * p + gv[:, None, None] * (t + r)
                for p, t, r in zip(pole, turned, level, strict=True)
            ]

        def along(signals):
            x, v = seen(signals, time)
            return jnp.sum(gx * x + gv * v)

        value, rate = _along_poles(m, psi)
        now = moment(m, g.signals, layout, time)
        direct = gx * now.level[:, None] + gv * now.slope[:, None]
        part = Slopes(tuple(value), tuple(rate), jax.grad(along)(g.signals), direct)
        return jax.tree.map(jnp.add, total, part), None

    start = _nothing(g, layout)
    return top, jax.lax.scan(one, start, (times, *weights))[0]


def _nothing(g: Lanes, layout: Layout) -> Slopes:
    pairs, lanes = g.modes.l0.shape
    count = len(layout.kinds)
    psi = jnp.zeros((ROWS, count + 1, pairs, lanes))
    signals = jax.tree.map(jnp.zeros_like, g.signals)
    return Slopes((psi, psi), (psi, psi), signals, jnp.zeros((count, ROWS, lanes)))


class _Sums(NamedTuple):
    """What the blocks of a run add up to, for the derivatives of the mean square."""

    psi: Pair
    rate: Pair
    signals: Signals
    wave: tuple[Array, Array]  # (o, v, k, c): sums of x cos and x sin over each piece


def mean_square_slopes(g: Lanes, layout: Layout, step, count) -> Slopes:
    """Derivatives of the mean of |dR|^2 over the samples."""
    m = g.modes
    of = np.repeat(np.arange(len(layout.kinds)), [kind.waves for kind in layout.kinds])
    columns = np.array([kind.column for kind in layout.kinds])
    parts = materialised(
        lambda m, signals, direct, slope: forced(m, signals, direct, slope, layout),
        m, g.signals, g.direct, g.slope,
    )  # fmt: skip
    number = jnp.arange(LENGTH, dtype=float)[:, None]
    b = m.b0[columns], m.b1[columns]

    def gather(total: _Sums, op: Operands, t: Tables, s: State) -> _Sums:
        def outputs(op, t):
            rows = [row_signal(op, t, o) for o in range(ROWS)]
            return jnp.stack([jnp.where(number < op.count, x, 0.0) for x in rows])

        x = materialised(outputs, op, t)  # (o, k, c)
        later = x * number * step

        def summed(x, table):
            return jnp.stack([jnp.sum(x[o][:, None] * table, axis=0) for o in range(ROWS)])

        u, du = ((summed(y, t.T0), summed(y, t.T1)) for y in (x, later))
        w, dw = ([summed(y, table) for table in (t.cosine, t.sine)] for y in (x, later))
        time = s.done * step

        def free(m: Modes, signals: Signals):
            now = moment(m, signals, layout, time)
            return now.free, now.decay, now.into

        (value, decay, into), rate = _along_poles(m, lambda m: free(m, g.signals))
        whole, drift = _ends(value, decay), _ends(rate[0], rate[1])
        psi = _outer(m, u, whole)
        turned = [x + y for x, y in zip(_outer(m, du, whole), _outer(m, u, drift), strict=True)]
        # by the signals: through the free parts, and through the phases of the sinusoids
        back = jax.vjp(lambda sig: (free(m, sig)[0], free(m, sig)[2]), g.signals)[1]
        q = product(m.kind, (m.c0[:ROWS], jnp.where(m.kind > 0, -m.c1[:ROWS], m.c1[:ROWS])), u)
        q = product(m.kind, [jnp.sum(x, axis=0) for x in q], b)
        cotangent = q[0], jnp.where(m.kind > 0, -q[1], q[1])
        phase = into[of] * g.signals.rate  # (v, c), at the block's begin
        sn, cs = jnp.sin(phase), jnp.cos(phase)
        w = w[0] * cs - w[1] * sn, w[1] * cs + w[0] * sn  # of x cos, x sin
        dw = dw[0] * cs - dw[1] * sn, dw[1] * cs + dw[0] * sn
        piece = moment(m, g.signals, layout, time).piece[of]
        here = jnp.arange(parts.cosine.shape[2])[:, None] == piece[:, None]  # (v, k, c)
        fa, fb = (jnp.sum(jnp.where(here, f[:ROWS], 0.0), axis=2) for f in parts[:2])
        swing = jnp.sum(fb * w[0] - fa * w[1], axis=0)  # d(square)/d(phase)
        late = jnp.sum(fb * dw[0] - fa * dw[1], axis=0)
        by_into = jax.ops.segment_sum(swing * g.signals.rate, of, len(layout.kinds))
        signals = jax.tree.map(jnp.add, total.signals, back((cotangent, by_into))[0])
        signals = signals._replace(rate=signals.rate + swing * into[of] + late)
        waves = [
            y + jnp.where(here, x[:, :, None], 0.0) for y, x in zip(total.wave, w, strict=True)
        ]
        return _Sums(
            (total.psi[0] + psi[0], total.psi[1] + psi[1]),
            (total.rate[0] + turned[0], total.rate[1] + turned[1]),
            signals,
            (waves[0], waves[1]),
        )

    none = _nothing(g, layout)
    wave = jnp.zeros((ROWS, *parts.cosine.shape[1:]))
    start = _Sums(none.psi, none.rate, none.signals, (wave, wave))
    sums = run(m, g.signals, parts, layout, step, count, gather, start)
    return _with_waves(g, layout, sums, of, 2 / count)


def _with_waves(g: Lanes, layout: Layout, sums: _Sums, of, factor) -> Slopes:
    """Adds the sinusoids' own parts: by the poles, by their amplitudes and rates, directly."""
    m, signals = g.modes, g.signals
    one = jnp.ones_like(m.l0), jnp.where(m.kind > 0, 0.0, 1.0)
    count = len(layout.kinds)

    def psi(m: Modes):
        unit = m._replace(b0=one[0][None], b1=one[1][None], c0=m.c0[:0], c1=m.c1[:0])
        rate = signals.rate[:, None, None]
        parts = signals.cosine[:, :, None], signals.sine[:, :, None]
        a, b = particular(unit, one, rate, *parts)
        (cos_, sin_), found = sums.wave, []
        for x, y in zip(a, b, strict=True):  # (v, k, p, c) with (o, v, k, c)
            each = jnp.einsum("ovkc,vkpc->ovpc", cos_, x) + jnp.einsum("ovkc,vkpc->ovpc", sin_, y)
            found.append(jnp.stack([jnp.sum(each[:, of == s], axis=1) for s in range(count)], 1))
        return found

    def amplitudes(signals):
        found = forced(m, signals, g.direct, g.slope, layout)
        return found.cosine[:ROWS], found.sine[:ROWS]

    value, rate = _along_poles(m, psi)
    own = jax.vjp(amplitudes, signals)[1](sums.wave)[0]
    pad = ((0, 0), (0, 1), (0, 0), (0, 0))
    level = sums.wave[0] * signals.cosine + sums.wave[1] * signals.sine  # (o, v, k, c)
    direct = jax.ops.segment_sum(jnp.swapaxes(jnp.sum(level, axis=2), 0, 1), of, count)
    found = Slopes(
        (sums.psi[0] + jnp.pad(value[0], pad), sums.psi[1] + jnp.pad(value[1], pad)),
        (sums.rate[0] + jnp.pad(rate[0], pad), sums.rate[1] + jnp.pad(rate[1], pad)),
        jax.tree.map(jnp.add, sums.signals, own),
        direct,
    )
    return jax.tree.map(lambda x: factor * x, found)


def pull_back(
    design: Design, found: Eigen, slopes: Slopes, layout: Layout, span
) -> tuple[System, Signals]:
    """Derivatives by the matrices and the signals of a batch, from those by poles and residues."""
    system, m = design.system, found.value.shape[1]
    columns = np.array([kind.column for kind in layout.kinds])
    total = system.column.shape[1]
    place = np.append(columns, total)  # the start comes last

    def whole(pair: Pair):  # (o, s, p, c) -> (c, o, l, m) of every eigenvalue
        first, second = (jax.ops.segment_sum(jnp.moveaxis(x, 1, 0), place, total + 1) for x in pair)
        k = found.kind.T
        one = jax.lax.complex(first, jnp.where(k, second, 0.0))
        two = jax.lax.complex(jnp.where(k, first, second), jnp.where(k, -second, 0.0))
        one = jnp.einsum("lopc,cpm->colm", one, found.first)
        return one + jnp.einsum("lopc,cpm->colm", two, found.second)

    psi, rate = whole(slopes.psi), whole(slopes.rate)
    c, b, V = found.output[:, :ROWS], found.input, found.vector
    left = jnp.einsum("coi,coli,cjl->cij", c, psi, b)
    right = jnp.einsum("coi,colj,cjl->cij", c, psi, b)
    flat = jnp.einsum("coi,coli,cjl->cij", c, rate, b)
    flat = 0.5 * (flat + jnp.einsum("coi,colj,cjl->cij", c, rate, b))
    gap = found.value[:, :, None] - found.value[:, None, :]
    damping = jnp.abs(found.value.real)
    near = jnp.abs(gap) < 1e-5 * (1 / span + jnp.maximum(damping[:, :, None], damping[:, None]))
    M = jnp.where(near, flat, (left - right) / jnp.where(near, 1.0, gap))
    back = jnp.linalg.inv(V)
    A = jnp.einsum("cia,cij,cbj->cab", back, M, V).real
    inputs = jnp.einsum("cia,coi,coli->cla", back, c, psi).real
    shown = jnp.einsum("cbi,cil,coli->cob", V, b, psi).real
    states = system.A.shape[-1]
    outputs = system.C.shape[1]
    direct = jax.ops.segment_sum(slopes.direct, columns, total)  # (l, o, c)
    direct = jnp.pad(jnp.moveaxis(direct, -1, 0), ((0, 0), (0, 0), (0, outputs - ROWS)))
    matrices = System(
        A[:, :states, :states],
        inputs[:, :total, :states],
        jnp.pad(shown[..., :states], ((0, 0), (0, outputs - ROWS), (0, 0))),
        direct,
        jnp.zeros_like(system.rate),
        inputs[:, total, :states],
    )
    assert m >= states
    return matrices, jax.tree.map(lambda x: jnp.moveaxis(x, -1, 0), slopes.signals)
