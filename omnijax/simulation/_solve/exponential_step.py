"""One step h of dy/dt = A y + N(t, y) by Krogstad's exponential Runge-Kutta method (order 4).

The wheel's shape is taken out of N, since its kinks at gap edges fall inside steps: the elastic
response to it, int_0^h exp((h - s) A) B rho(theta(s)) ds, is exact for parabolas on `PIECES` parts
of the step that have rho's moments.  So the elastic state follows the shape itself, and what is
not linear in their difference sees it at each stage's angle; the rest sees it as `Passage` says.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...dynamics import Model, linear_system
from .._one_kernel import is_asked
from .passage import StepGrid
from .phi import phi_functions

HALVINGS = 2
PIECES = 2**HALVINGS  # parts of a step, each with a parabola for the shape
GRID = StepGrid.of(PIECES, 6)


class StepTables(NamedTuple):
    """Matrices of one rig for one step size; elastic part in natural units."""

    A: Float[Array, "m m"]
    half: Float[Array, "3 m m"]  # phi_1 ... phi_3 of half a step
    whole: Float[Array, "3 m m"]  # phi_1 ... phi_3 of a step
    into: Float[Array, "m n"]  # from the shape
    midway: Float[Array, "m k n"]  # elastic state after half a step, to the shape at its nodes
    response: Float[Array, "m k n"]  # the same after a step


def step_tables(model: Model, scale, step) -> StepTables:
    """The matrices for steps of `step` s, the solver's vector in natural units `scale`."""
    system = linear_system(model.translation)
    m = system.A.shape[0]
    A = system.A * scale[:m] / scale[:m, None]
    into = system.into("shape") / scale[:m, None]
    width = step / PIECES
    whole, half, *_, part = phi_functions(A, step, HALVINGS)
    parabola = width * part * np.array([1, 1, 2])[:, None, None] @ into  # to 1, u, u^2
    after = jnp.eye(m) + width * A @ part[0]
    pieces = [parabola]
    for _ in range(PIECES - 1):
        pieces.insert(0, jnp.einsum("ab,kbn->kan", after, pieces[0]))
    response, midway = jnp.concatenate(pieces), jnp.concatenate(pieces[PIECES // 2 :])
    return StepTables(
        A, half, whole, into, jnp.swapaxes(midway, 0, 1), jnp.swapaxes(response, 0, 1)
    )


def exponential_step(field, shape, tables: StepTables, rho: Float[Array, "c n"], h, t, y):
    """(state half a step later, state a step later, rate of all rows but the elastic ones there).

    `field(t, y, i)` is the rate of the scaled state y at the step's start (i = 0), middle or end,
    `shape(y)` the shape (n) in m that it sees, `rho` the parabolas' coefficients over the step.
    """
    A, (half1, half2, half3), (one, two, three), into, midway, response = tables
    m = A.shape[0]

    def split(t, y, i):  # elastic rows' remainder without the shape, and the other rows
        rate = field(t, y, i)
        return rate[:m] - A @ y[:m] - into @ shape(y), rate[m:]

    e, z = y[:m], y[m:]
    shaped = e + jnp.einsum("akn,kn->a", midway, rho[: len(rho) // 2])
    passed = e + jnp.einsum("akn,kn->a", response, rho)
    d1, z1 = split(t, y, 0)
    first = A @ e + d1

    def stage(before, row):
        (d, rate), (i, base, along, apart) = before, row
        elastic, later = base + h * (along @ first + apart @ (d - d1)), h * i / 2
        new = split(t + later, jnp.concatenate([elastic, z + later * rate]), i)
        return new, new

    rows = (
        np.array([1, 1, 2]),
        jnp.stack([shaped, shaped, passed]),
        jnp.stack([half1 / 2, half1 / 2, one]),
        jnp.stack([jnp.zeros_like(A), half2, 2 * two]),
    )
    (_, z4), ((d2, d3, d4), (z2, z3, _)) = jax.lax.scan(
        stage, (d1, z1), rows, unroll=not is_asked()
    )  # without kernels a loop waits for each of its own
    end = z + h / 6 * (z1 + 2 * z2 + 2 * z3 + z4)
    linear, square = 2 * (d2 + d3) - 3 * d1 - d4, 4 * (d1 + d4 - d2 - d3)
    new = passed + h * (one @ first + two @ linear + three @ square)
    mid = shaped + h * (half1 @ first / 2 + half2 @ linear / 4 + half3 @ square / 8)
    halfway = (z + end) / 2 + h / 8 * (z1 - z4)
    return jnp.concatenate([mid, halfway]), jnp.concatenate([new, end]), z4
