"""Least normal force and slip margin of many runs, for statuses, beside RMS and peak of |dR|.

With the platform's motion y = -(M_s x + m Delta)/M_T, along each normal

    N - N0 = K' x + M_s ((1 - M_s/M_T) x'' - (m/M_T) Delta'') - F        F = coupling drho/dt

so a free part of N is the same combination of those of x and Delta, each '' a factor lambda^2, and
inside a gap each '' a factor -nu^2.  The drive force at contact i is f_i = sum_j gain_ij drho_j/dt:
every wheel's drho/dt is one more sinusoid beside the directions.
"""

import functools
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._exact import rows_of
from .contact import Contact, Poles, deflection
from .design import Design, Layout
from .modes import Modes, modes
from .periodic_load import Grip
from .pole_pair import Pair, plus, scaled, times
from .samples import over_blocks, square_of

Rows = TypeVar("Rows")


def _squared(u, D) -> Pair:
    root = Pair(u, jnp.ones_like(u))
    return times(root, root, D)


def _free_load(x: Pair, mount: Pair, lam: Poles, contact: Contact) -> Pair:
    """Free part of the load from those of x and Delta."""
    a, share = contact.sphere, _share(contact)
    curved = plus(scaled((1 - share) / a, x), scaled(-share / contact.wheel, mount))
    return plus(scaled(contact.closure, x), times(curved, _squared(lam.u, lam.D), lam.D))


def _share(contact: Contact) -> Float[Array, "a c"]:
    """M_s/M_T."""
    a, b, g = contact.sphere, contact.wheel, contact.platform
    return b * g / (a * b + a * g + b * g)


def _of_rows(x: Rows, index) -> Rows:
    return jax.tree.map(lambda v: rows_of(v, index), x)


def with_load(design: Design, layout: Layout) -> Modes:
    """Closed form of x, then of the load N - N0, then of every wheel's drho/dt; `load_layout`."""
    x, mount = modes(design, layout), modes(design, layout, deflection)
    sets = np.array(layout.sets)
    pair, wheel = sets[np.array(layout.axis)], np.array(layout.wheel)
    contact, lam = _of_rows(design.contact, pair), _of_rows(x.roots, pair)
    depth = jnp.where(design.wheel.passage > 0, design.wheel.depth, 0.0)
    slope = -depth * x.rate  # drho/dt = slope cos
    nu, a, share = rows_of(x.rate, wheel), contact.sphere, _share(contact)
    fa, fb = (
        contact.closure * f - nu**2 * ((1 - share) / a * f - share / contact.wheel * g)
        for f, g in zip(x.forced, mount.forced, strict=True)
    )
    fb = fb - design.coupling * rows_of(slope, wheel)
    J = _free_load(x.J, mount.J, lam, contact)
    none = jnp.zeros((2, *slope.shape))
    whole = _of_rows(x.roots, sets), _of_rows(design.contact, sets)
    initial = _free_load(x.initial, mount.initial, *whole)
    return Modes(
        x.roots,
        Pair(*(jnp.concatenate([*z, none], axis=1) for z in zip(x.J, J, strict=True))),
        (
            jnp.concatenate([x.forced[0], fa, 0 * slope]),
            jnp.concatenate([x.forced[1], fb, slope]),
        ),
        x.rate,
        Pair(*(jnp.concatenate(z, axis=1) for z in zip(x.initial, initial, strict=True))),
    )


def load_layout(layout: Layout) -> Layout:
    """`layout` with a direction more for each load, and every wheel's drho/dt beside them."""
    n, wheels = layout.directions, tuple(range(len(layout.edges)))
    return layout._replace(
        axis=layout.axis + tuple(n + a for a in layout.axis) + tuple(2 * n + j for j in wheels),
        wheel=layout.wheel * 2 + wheels,
        directions=2 * n,
        sets=layout.sets * 2 + (0,) * len(wheels),
    )


def samples_and_margins(design: Design, grip: Grip, layout: Layout, gram=None):
    """Sum and largest of |dR|^2 over the samples, and the least N and mu N - |f|; (c,) each."""
    n = layout.directions

    def gather(totals, x, block, counts):
        normal = [x[n + i] + grip.preload[i] for i in range(n)]
        slips = [
            grip.friction[i] * normal[i] - jnp.abs(_drive(grip, x[2 * n :], i)) for i in range(n)
        ]
        seen = block >= 0 if counts is None else counts
        low = [jnp.where(seen, _minimum(values), jnp.inf) for values in (normal, slips)]
        square, total, least = jnp.where(seen, square_of(x[:n], gram), 0.0), *totals
        return (
            jax.lax.complex(total.real + square, jnp.maximum(total.imag, square)),
            jax.lax.complex(jnp.minimum(least.real, low[0]), jnp.minimum(least.imag, low[1])),
        )

    none = jnp.zeros((layout.length, design.wheel.depth.shape[-1]))
    start = jax.lax.complex(none, none), jax.lax.complex(none + jnp.inf, none + jnp.inf)
    m = with_load(design, layout)
    total, least = over_blocks(gather, start, m, design.wheel, load_layout(layout))
    lowest = jnp.min(least.real, axis=0), jnp.min(least.imag, axis=0)
    return jnp.sum(total.real, axis=0), jnp.max(total.imag, axis=0), *lowest


def _drive(grip: Grip, rates: list[Array], i: int) -> Array:
    """Drive force at contact i."""
    return functools.reduce(
        jnp.add, (grip.gain[i * len(rates) + j] * rate for j, rate in enumerate(rates))
    )


def _minimum(values: list[Array]) -> Array:
    return functools.reduce(jnp.minimum, values)
