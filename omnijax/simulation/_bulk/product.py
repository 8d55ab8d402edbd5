"""Products of numbers over two different pairs' units, p + q j' with p, q over the first unit."""

from typing import NamedTuple

from .pole_pair import Pair, inverse, scaled, times


class Product(NamedTuple):
    """A number p + q j' with p, q in the first pair's numbers and j' the second pair's unit."""

    p: Pair
    q: Pair


def product_inverse(p: Pair, q: Pair, D, G) -> Product:
    """1/(p + q j') for p, q over D and j'^2 = G."""
    square, cross = times(p, p, D), times(q, q, D)
    below = inverse(Pair(square.u - G * cross.u, square.v - G * cross.v), D)
    return Product(times(p, below, D), scaled(-1.0, times(q, below, D)))


def form(a: Pair, b: Pair, K: Product):
    """Output of a b K for a over the first unit and b over the second: both units' coefficient."""
    return a.u * b.u * K.q.v + a.v * b.u * K.q.u + a.u * b.v * K.p.v + a.v * b.v * K.p.u
