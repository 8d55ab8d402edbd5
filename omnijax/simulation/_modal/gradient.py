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

from .arithmetic import Pair
from .poles import Eigen, PolePairs
from .signals import Signals
from .system import Layout, LinearDesign, System
from .transient import ROWS


class Slopes(NamedTuple):
    """Derivatives of a square of a figure; batch last."""

    psi: Pair  # (o, s + 1, p, c), the start last
    rate: Pair  # the same of dPsi/dlambda
    signals: Signals
    direct: Float[Array, "s o c"]


def half_root(square):
    """d sqrt(x)/dx, zero where nothing moves."""
    return jnp.where(square > 0, 0.5 / jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)


def along_poles(m: PolePairs, function):
    """function(m) and its derivative by every pole."""
    one = jnp.ones_like(m.l0), jnp.where(m.kind > 0, 0.0, 1.0)
    return jax.jvp(lambda x, y: function(m._replace(l0=x, l1=y)), (m.l0, m.l1), one)


def pull_back(
    design: LinearDesign, pairs: Eigen, slopes: Slopes, layout: Layout, span
) -> tuple[System, Signals]:
    """Derivatives by the matrices and the signals of a batch, from those by poles and residues."""
    system = design.system
    columns = np.array([kind.column for kind in layout.kinds])
    total = system.column.shape[1]
    place = np.append(columns, total)  # the start comes last

    def whole(pair: Pair):  # (o, s, p, c) -> (c, o, l, m) of every eigenvalue
        first, second = (jax.ops.segment_sum(jnp.moveaxis(x, 1, 0), place, total + 1) for x in pair)
        k = pairs.kind.T
        one = jax.lax.complex(first, jnp.where(k, second, 0.0))
        two = jax.lax.complex(jnp.where(k, first, second), jnp.where(k, -second, 0.0))
        one = jnp.einsum("lopc,cpm->colm", one, pairs.first)
        return one + jnp.einsum("lopc,cpm->colm", two, pairs.second)

    psi, rate = whole(slopes.psi), whole(slopes.rate)
    c, b, V = pairs.output[:, :ROWS], pairs.input, pairs.vector
    left = jnp.einsum("coi,coli,cjl->cij", c, psi, b)
    right = jnp.einsum("coi,colj,cjl->cij", c, psi, b)
    flat = jnp.einsum("coi,coli,cjl->cij", c, rate, b)
    flat = 0.5 * (flat + jnp.einsum("coi,colj,cjl->cij", c, rate, b))
    gap = pairs.value[:, :, None] - pairs.value[:, None, :]
    damping = jnp.abs(pairs.value.real)
    near = jnp.abs(gap) < 1e-5 * (1 / span + jnp.maximum(damping[:, :, None], damping[:, None]))
    M = jnp.where(near, flat, (left - right) / jnp.where(near, 1.0, gap))
    back = pairs.inverse
    A = jnp.einsum("cia,cij,cbj->cab", back, M, V).real
    inputs = jnp.einsum("cia,coi,coli->cla", back, c, psi).real
    shown = jnp.einsum("cbi,cil,coli->cob", V, b, psi).real
    outputs = system.C.shape[1]
    direct = jax.ops.segment_sum(slopes.direct, columns, total)  # (l, o, c)
    direct = jnp.pad(jnp.moveaxis(direct, -1, 0), ((0, 0), (0, 0), (0, outputs - ROWS)))
    matrices = System(
        A,
        inputs[:, :total],
        jnp.pad(shown, ((0, 0), (0, outputs - ROWS), (0, 0))),
        direct,
        jnp.zeros_like(system.rate),
        inputs[:, total],
    )
    return matrices, jax.tree.map(lambda x: jnp.moveaxis(x, -1, 0), slopes.signals)
