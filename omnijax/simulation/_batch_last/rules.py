"""Operations on elements, shapes and indices of arrays whose last axis is the batch."""

from collections.abc import Callable, Sequence
from typing import Any

import jax.numpy as jnp
from jax import lax

from .._logarithm import logarithm
from .._sincos import sincos
from .values import Call, Rule, Value


def _elementwise(call: Call) -> list[Value]:
    arrays = []
    for value in call.inputs:
        array = jnp.asarray(value.array)
        arrays.append(array[..., None] if array.ndim and not value.batched else array)
    shape = jnp.broadcast_shapes(*(x.shape for x in arrays))
    return call.bound(*(jnp.broadcast_to(x, shape) for x in arrays))


def _on_leading_axes(call: Call) -> list[Value]:
    """Operations whose parameters count axes from the front; a last batch axis changes none."""
    return call.bound(*call.wholes())


def _sine(part: int) -> Rule:
    def rule(call: Call) -> list[Value]:
        x = call.inputs[0].array  # XLA's own calls libm once a number
        return [Value(sincos(x)[part], True)] if x.dtype == float else _elementwise(call)

    return rule


def _log(call: Call) -> list[Value]:
    x = call.inputs[0].array  # XLA's own calls libm once a number
    return [Value(logarithm(x), True)] if x.dtype == float else _elementwise(call)


def _one(change: Callable[[Any, dict[str, Any], int], Any]) -> Rule:
    """The rule of an operation on one array."""

    def rule(call: Call) -> list[Value]:
        return [Value(change(call.inputs[0].array, call.params, call.size), True)]

    return rule


def _broadcast_in_dim(x, params, size):
    shape, axes = params["shape"], params["broadcast_dimensions"]
    return lax.broadcast_in_dim(x, (*shape, size), (*axes, len(shape)))


def _reshape(x, params, size):
    return lax.reshape(x, (*params["new_sizes"], size))


def _transpose(x, params, size):
    return lax.transpose(x, (*params["permutation"], x.ndim - 1))


def _slice(x, params, size):
    strides = params["strides"]
    strides = None if strides is None else (*strides, 1)
    return lax.slice(x, (*params["start_indices"], 0), (*params["limit_indices"], size), strides)


def _indexed_alike(indices: Sequence[Value]) -> bool:
    """Whether every design is indexed alike."""
    return not any(value.batched for value in indices)


def _with_all(starts: Sequence[Value]) -> list:
    """Where a slice begins, of all designs; jax asks for indices of one type."""
    arrays = [start.array for start in starts]
    return [*arrays, jnp.zeros_like(arrays[0])]


def _dynamic_slice(call: Call) -> list[Value] | None:
    x, *starts = call.inputs
    if not _indexed_alike(starts):
        return None
    sizes = (*call.params["slice_sizes"], call.size)
    return [Value(lax.dynamic_slice(x.array, _with_all(starts), sizes), True)]


def _dynamic_update_slice(call: Call) -> list[Value] | None:
    x, update, *starts = call.inputs
    if not _indexed_alike(starts):
        return None
    whole = lax.dynamic_update_slice(x.whole(call.size), update.whole(call.size), _with_all(starts))
    return [Value(whole, True)]


def _gather(call: Call) -> list[Value] | None:
    x, indices = call.inputs
    if not _indexed_alike([indices]):
        return None
    numbers = call.params["dimension_numbers"]
    last = len(call.equation.outvars[0].aval.shape)
    numbers = numbers._replace(offset_dims=(*numbers.offset_dims, last))
    sizes = (*call.params["slice_sizes"], call.size)
    return call.bound(x.array, indices.array, dimension_numbers=numbers, slice_sizes=sizes)


def _scatter(call: Call) -> list[Value] | None:
    x, indices, updates = call.inputs
    if not _indexed_alike([indices]):
        return None
    numbers, update = call.params["dimension_numbers"], updates.whole(call.size)
    numbers = numbers._replace(update_window_dims=(*numbers.update_window_dims, update.ndim - 1))
    return call.bound(x.whole(call.size), indices.array, update, dimension_numbers=numbers)


ELEMENTWISE = """
    abs acos add and asin atan atan2 cbrt ceil clamp convert_element_type copy cosh div eq erf exp
    exp2 expm1 floor ge gt integer_pow is_finite le log1p logistic lt max min mul ne neg
    nextafter not or pow rem round rsqrt select_n sign sinh sqrt square stop_gradient sub tan tanh
    xor
"""
LEADING = """
    argmax argmin concatenate cummax cummin cumprod cumsum reduce_and reduce_max reduce_min
    reduce_or reduce_prod rev sort split squeeze stack
"""
RULES: dict[str, Rule] = {
    **dict.fromkeys(ELEMENTWISE.split(), _elementwise),
    **dict.fromkeys(LEADING.split(), _on_leading_axes),
    **dict.fromkeys(("scatter", "scatter-add", "scatter_add"), _scatter),
    "sin": _sine(0),
    "cos": _sine(1),
    "log": _log,
    "broadcast_in_dim": _one(_broadcast_in_dim),
    "reshape": _one(_reshape),
    "transpose": _one(_transpose),
    "slice": _one(_slice),
    "dynamic_slice": _dynamic_slice,
    "dynamic_update_slice": _dynamic_update_slice,
    "gather": _gather,
}
