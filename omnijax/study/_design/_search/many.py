"""Figures of many designs at once, and what is made of them, with slopes by the chain rule."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ...._compiling import quick_jit
from ..._batches import in_batches, value_and_jacobian
from ..._problem import FigureRows, Many

WIDTH = 16  # designs at a time: one compiled program serves any number of them


def followed_by(first: Callable[..., FigureRows], made: Callable[[Any, Any], Any]) -> Many:
    """`made(x, figures)`, traced, of the figures that `first` gives of every design x (d,).

    The last variables may be ones that `first` does not depend on and gives no slopes for.
    """

    def with_slopes(row):
        x, figures, slopes = row

        def moved(step):
            def there(value, slope):
                return value + slope @ step[: slope.shape[-1]]

            return made(x + step, jax.tree.map(there, figures, slopes))

        return value_and_jacobian(moved)(jnp.zeros(len(x)))

    plain = quick_jit(jax.vmap(lambda row: made(*row)))
    sloped = quick_jit(jax.vmap(with_slopes))

    def many(x: np.ndarray, gradient: bool) -> FigureRows:
        rows = first(x, gradient=gradient)
        if not gradient:
            return FigureRows(in_batches(plain, (x, rows.values), WIDTH))
        return FigureRows(*in_batches(sloped, (x, rows.values, rows.slopes), WIDTH))

    return many
