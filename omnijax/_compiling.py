"""How programs are compiled: by how much they will be used, and told to whoever waits."""

import enum
import functools
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import jax
from jax.core import Tracer

from ._waiting import told

# The older of XLA's two code generators (jaxlib 0.10 has both) takes two thirds of the time of the
# new one, and its programs of one run or of a few dozen designs are as fast.
OLDER = version("jaxlib").startswith("0.10.")
QUICK: Any = {"xla_cpu_use_fusion_emitters": False} if OLDER else {}
# Where a machine has vectors of 512 bits, loops over designs use them whole: 10 to 15 % faster in
# bulk (values and gradients), compiled in the same time.  XLA's own choice is half of that.
WIDE: Any = {"xla_cpu_prefer_vector_width": 512}
# A short program costs a quarter less where its code is not parted for several threads.
SHORT = 1000  # lines of StableHLO
# Without optimisation a program in bulk is compiled in a third of the time (values of three unlike
# wheels: 2.3 for 7.4 s; with gradients 9 for 23) and is four to five times slower (170 us a design
# for 38; 930 for 180).
PLAIN: Any = {"xla_backend_optimization_level": 0}


class Effort(enum.IntEnum):
    """What a program is worth to the compiler."""

    LEAST = 0  # it runs on few designs
    QUICK = 1
    MOST = 2  # it runs on very many


def on_cpu() -> bool:
    """Whether programs run on a CPU, where none is asked for."""
    return jax.default_backend() == "cpu"


def compiler_options(effort: Effort, lines: int) -> Any:
    """Options of the compiler for a program of so many lines of StableHLO."""
    if effort == Effort.MOST:
        return WIDE
    options = WIDE | QUICK | ({"xla_cpu_parallel_codegen_split_count": 1} if lines < SHORT else {})
    return options | PLAIN if effort == Effort.LEAST else options


def quick_jit(function: Callable) -> Callable:
    """`jax.jit` of a function of arrays, compiled by `QUICK` at the first call of each shape."""
    jitted, programs = jax.jit(function, compiler_options=QUICK), {}

    @functools.wraps(function)
    def run(*args):
        leaves, tree = jax.tree.flatten(args)
        if any(isinstance(x, Tracer) for x in leaves):
            return function(*args)
        key = (tree, *((jax.numpy.shape(x), jax.numpy.result_type(x)) for x in leaves))
        if key not in programs:
            lowered = jitted.lower(*args)  # done anew in every process: only the rest is kept
            with told():
                programs[key] = lowered.compile()
        return programs[key](*args)

    return run
