"""Loops that XLA shall compile into one function of machine code.

On CPUs XLA runs a program kernel by kernel, some 50 ns each beside what it works out, and a loop of
small kernels waits for that a good part of the time.  XLA itself makes one kernel of a loop over a
kilobyte or less, by an attribute of the call that it puts there; another call may have it too.
"""

from collections.abc import Callable, Iterator
from contextvars import ContextVar
from importlib.metadata import version
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.experimental.xla_metadata import set_xla_metadata
from jax.extend.core import ClosedJaxpr, Jaxpr

from .._compiling import on_cpu

# XLA breaks off, process and all, where it finds a call other than it makes them itself, so only
# versions that the tests have run with are asked
KNOWN = version("jaxlib").startswith("0.10.")
_ATTRIBUTES = {"inlineable": "false", "xla_cpu_small_call": "true"}
# what XLA writes out itself; it may leave the rest (sums, maxima of real numbers, scatter, LAPACK,
# ...) to libraries
_NAMES = """
    abs acos acosh add and asin asinh atan atan2 atanh bitcast_convert_type broadcast_in_dim cbrt
    ceil clamp complex concatenate cond conj convert_element_type copy cos cosh custom_jvp_call
    custom_vjp_call div dynamic_slice dynamic_update_slice eq exp exp2 expm1 floor gather ge gt imag
    integer_pow iota is_finite jit le le_to log log1p logistic lt lt_to max min mul ne neg not or
    pad pjit pow real reduce_and reduce_max reduce_min reduce_or rem reshape rev round rsqrt scan
    select_n shift_right_arithmetic sign sin sinh slice split sqrt square squeeze stack
    stop_gradient sub tan tanh transpose while xor
"""
_WRITTEN_OUT = frozenset(_NAMES.split())
_INSIDE = ContextVar("one_kernel", default=False)


def one_kernel(f: Callable, *args):
    """f(*args), on CPUs as one kernel: a quarter less time for loops over some 64 designs.

    It runs on one core.  What XLA leaves to libraries cannot stand in it: where f holds that, it
    is called as it is.  Kernels in it are parts of it.
    """
    if _INSIDE.get() or not is_asked():
        return f(*args)

    @jax.jit
    def called(moving):
        f, args = eqx.combine(moving, still)
        used = sum(jnp.real(jnp.ravel(x)[0]).astype(float) for x in jax.tree.leaves(moving))
        return f(*args), used

    token = _INSIDE.set(True)
    try:
        closed = eqx.filter_closure_convert(f, *args)
        moving, still = eqx.partition(jax.tree.map(_known, (closed, args)), _is_traced)
        written_out = _written_out(called.trace(moving).jaxpr.jaxpr)
    finally:
        _INSIDE.reset(token)
    if not written_out:
        return f(*args)
    # all that a kernel is given has to be used there: XLA would put constants into it
    moving = jax.lax.optimization_barrier(moving)
    return jax.lax.optimization_barrier(set_xla_metadata(called(moving), **_ATTRIBUTES))[0]


def is_asked() -> bool:
    """Whether XLA here is asked for kernels of our own."""
    return KNOWN and on_cpu()


def _is_traced(x) -> bool:
    return isinstance(x, Tracer)


def _known(x):
    """An array of no elements as such: it is known."""
    return np.zeros(x.shape, x.dtype) if _is_traced(x) and x.size == 0 else x


def _written_out(jaxpr: Jaxpr) -> bool:
    """Whether XLA leaves nothing of a traced function to libraries."""
    for equation in jaxpr.eqns:
        name = equation.primitive.name
        if name not in _WRITTEN_OUT:
            return False
        if name in ("reduce_max", "reduce_min"):
            x: Any = equation.invars[0].aval
            if jnp.issubdtype(x.dtype, jnp.inexact):
                return False
        if not all(map(_written_out, _inside(equation.params))):
            return False
    return True


def _inside(params: dict) -> Iterator[Jaxpr]:
    """The functions in the parameters of an operation."""
    for value in params.values():
        for x in value if isinstance(value, tuple | list) else (value,):
            if isinstance(x, ClosedJaxpr):
                yield x.jaxpr
            elif isinstance(x, Jaxpr):
                yield x
