"""An exponential Runge-Kutta method for dy/dt = A y + N(t, y): exact in the stiff linear part.

With e the first rows of y (those A acts on), h the step and N along the step taken as the
polynomial N0 + sum_k a_k s^k (s = 0 ... 1), the value at t0 + c h is

    e(c) = e + c h [phi_1(c h A) (A e + N0) + sum_k k! c^k phi_(k+1)(c h A) a_k]

with phi_j(z) = int_0^1 exp((1 - u) z) u^(j-1)/(j-1)! du.  On the rows without a linear part A = 0
and phi_j = 1/j!: there the method is an ordinary Runge-Kutta method.
"""

import math
from typing import ClassVar

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .phi import PHIS, TAYLOR, doubled, powers, series_weights

# Radau's points beside 0, the roots of (P4 + P5)/(1 + x): none at the end of a step, where the
# vector field may jump (a gap edge reached, a drive switched)
_RADAU = (0.13975986434378035, 0.41640956763108316, 0.7231569863618762, 0.9428958038854822)
FRACTIONS = (*_RADAU, 1.0)  # of a step, where the phi functions are kept
LEVELS = 24  # step sizes coarsest, coarsest/2, ... coarsest/2^23
# (point, stages whose N its polynomial goes through): each round of stages is good to one more
# power of h than the round before, uniformly in A
STAGES: tuple[tuple[int | None, tuple[int, ...]], ...] = (
    (None, ()),
    (1, ()),
    (1, (1,)),
    (3, (2,)),
    *((i, (2, 3)) for i in (1, 2, 3)),
    *((i, (4, 5, 6)) for i in (0, 1, 2, 3)),
)
EMBEDDED, FINAL = (4, 5, 6), (7, 8, 9, 10)
NODES = np.array([0.0 if i is None else FRACTIONS[i] for i, _ in STAGES])


def _polynomial(through: tuple[int, ...]) -> np.ndarray:
    """Weights of every stage's N in a_1 ... a_4 of the polynomial through stage 0 and `through`."""
    weights = np.zeros((PHIS - 1, len(STAGES)))
    degree = len(through)
    inverse = np.linalg.inv(NODES[list(through), None] ** np.arange(1, degree + 1))
    weights[:degree, list(through)] = inverse
    weights[:degree, 0] = -inverse.sum(axis=1)
    return weights


class LinearPart(dfx.AbstractTerm):
    """The stiff linear part A of the first rows, with its phi functions for halved step sizes.

    `phi[k, i, j]` is phi_(j+1) at `FRACTIONS[i]` of the step coarsest/2^(23-k); steps up to
    `finest` may have any size and take a Taylor series.  All by products of matrices, so repeated
    and defective eigenvalues make no difference, neither for the value nor for its derivatives.
    """

    A: Float[Array, "m m"]
    phi: Float[Array, "k c j m m"]
    powers: Float[Array, "p m m"]
    coarsest: Float[Array, ""]
    finest: Float[Array, ""]

    @classmethod
    def of(cls, A: Float[Array, "m m"], coarsest: Float[Array, ""]) -> "LinearPart":
        """Tables for steps of at most `coarsest` s."""
        size = jax.lax.stop_gradient(jnp.max(jnp.sum(jnp.abs(A), axis=0)))
        finest = jnp.minimum(2 / jnp.maximum(size, 1e-6), coarsest)
        shortest = coarsest * 2.0 ** (1 - LEVELS)

        def levels(fraction):
            z = fraction * shortest * A
            phi = jnp.tensordot(series_weights(), powers(z), 1)
            return jax.lax.scan(doubled, (z @ phi[0], phi), None, length=LEVELS)[1]

        phi = jax.vmap(levels, out_axes=1)(jnp.asarray(FRACTIONS))
        return cls(A, phi, powers(finest * A), coarsest, finest)

    def at(self, step: Float[Array, ""]) -> Float[Array, "c j m m"]:
        """phi_1, phi_2, ... at `FRACTIONS` of a step: one of the table's or a short one."""
        level = jnp.round(jnp.log2(step / self.coarsest)).astype(int) + LEVELS - 1
        level = jnp.clip(level, 0, LEVELS - 1)
        order = np.arange(TAYLOR + 1)
        weights = np.asarray(FRACTIONS)[:, None, None] ** order * series_weights()

        def series(_):
            return jnp.tensordot(weights * (step / self.finest) ** order, self.powers, 1)

        short = step <= self.finest * (1 + 1e-9)
        return jax.lax.cond(short, series, lambda _: self.phi[level], None)

    def vf(self, t, y, args):
        m = self.A.shape[0]
        return jnp.concatenate([self.A @ y[:m], jnp.zeros_like(y[m:])])

    def contr(self, t0, t1, **kwargs):
        return t1 - t0

    def prod(self, vf, control):
        return vf * control


class Exponential(dfx.AbstractSolver):
    """Exponential Runge-Kutta method of order 5 with an embedded one of order 4, eleven stages.

    Terms: `MultiTerm(LinearPart, ODETerm of the remainder N)`; y is one flat vector.  No order is
    lost where |h A| is large: every stage's error is a power of h times derivatives of N.
    """

    term_structure: ClassVar = dfx.MultiTerm[tuple[LinearPart, dfx.ODETerm]]
    interpolation_cls: ClassVar = dfx.LocalLinearInterpolation

    def order(self, terms):
        return 5

    def init(self, terms, t0, t1, y0, args):
        return None

    def func(self, terms, t0, y0, args):
        linear, remainder = terms.vf(t0, y0, args)
        return linear + remainder

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        wrapped, remainder = terms.terms  # diffrax wraps each term (direction of time)
        linear: LinearPart = getattr(wrapped, "term", wrapped)
        h, m = jnp.asarray(t1 - t0), linear.A.shape[0]
        phi, slope = linear.at(h), linear.A @ y0[:m]
        factorial = np.array([math.factorial(j) for j in range(PHIS + 1)], float)

        def integral(i, c, first, coefficients):  # c [phi_1 first + sum k! c^k phi_(k+1) a_k]
            scaled = coefficients * (factorial[1:PHIS] * c ** np.arange(1, PHIS))[:, None]
            scaled = jnp.concatenate([first[None], scaled])
            elastic = jnp.einsum("jab,jb->a", phi[i], scaled[:, :m])
            return c * jnp.concatenate([elastic, (1 / factorial[1:]) @ scaled[:, m:]])

        def value(i, c, rest, weights):
            first = rest[0].at[:m].add(slope)
            return y0 + h * integral(i, c, first, weights @ rest)

        def stage(rest, x):
            number, i, c, weights = x
            y = value(i, c, rest, weights)
            return rest.at[number].set(remainder.vf(t0 + c * h, y, args)), None

        index = np.array([i or 0 for i, _ in STAGES])
        weights = np.stack([_polynomial(through) for _, through in STAGES])
        every = (np.arange(len(STAGES)), index, NODES, weights)
        every = jax.tree.map(jnp.asarray, every)
        rest, _ = jax.lax.scan(stage, jnp.zeros((len(STAGES), y0.size)), every)
        y1 = value(4, 1.0, rest, _polynomial(FINAL))
        differing = _polynomial(FINAL) - _polynomial(EMBEDDED)
        error = h * integral(4, 1.0, jnp.zeros_like(y0), differing @ rest)
        return y1, error, {"y0": y0, "y1": y1}, None, dfx.RESULTS.successful
