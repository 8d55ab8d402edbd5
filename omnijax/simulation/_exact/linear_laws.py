"""Laws at contacts and mounts that say they are linear, and whether they are.

With x = (deflection, rate, memory) and F(x) = (tension, rate of the memory), such a law is its
Jacobian at rest, F(x) = J x: that is all that a closed form sees of it.  So F is held against J x
at signals from 1e-9 to 1 of every unit, one component at a time and all together, for the law's own
numbers and for drawn ones, since a study may vary them.
"""

from functools import lru_cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float

from ..._errors import InputError
from ...dynamics import ELASTIC_PORTS
from ...laws import EFFECTS, AbstractLaw, ContactSignal, MountSignal, Parameter, of_library
from ...rig import Rig, file_of, law_memory, law_output, law_rate
from .._signals import is_traced

ROUNDING = 1e-9  # of the sum of |J| |x|: more is no rounding
SIZES = 10.0 ** np.arange(-9, 1)  # of signals, in m, m/s and the memory's unit
DRAWS = 3  # of the law's numbers, beside its own
WHEEL = (2e5, 100.0, 150.0, 0.07)  # what signals hold beside: N/m, N s/m, and a contact's N and m
GROWTH = 1e-8  # of the largest pole: what grows more slowly is undamped, to rounding
SINGULAR = 1e-12  # least singular value, of the largest, of rates that settle a memory


class LawTrial(NamedTuple):
    """What signals tell of a law."""

    linear: bool
    settles: bool  # whether one value of the memory has no rate at rest


def says_linear(law: AbstractLaw) -> bool:
    """Whether the law's own class says `linear = True`; one above it speaks of its own formula."""
    return vars(type(law)).get("linear") is True


def may_grow(rig: Rig) -> bool:
    """Whether a user's law may feed the motion: those of the library only store and lose energy."""
    return any(
        not of_library(placed.law, EFFECTS) for port in ELASTIC_PORTS for placed in rig.at(port)
    )


def linear_obstacle(law: AbstractLaw) -> str | None:
    """Why closed forms do not take a law that says it is linear, in words; None where they do.

    Those of the library are linear; of one whose numbers are traced drawn numbers are tried.
    Raises `InputError` for one that is not linear.
    """
    if of_library(law, EFFECTS):
        return None
    leaves, tree = jax.tree.flatten(law)
    own = None if is_traced(leaves) else tuple(np.asarray(x, float).tobytes() for x in leaves)
    trial = _tried(type(law), tree, tuple(map(np.shape, leaves)), own)
    if not trial.linear:
        raise InputError(
            f"law `{law.id}`{_of_file(law)} says that it is linear, but what it returns is not "
            "proportional to deflection, rate and memory: take `linear = True` out of it, or "
            "correct the formula."
        )
    return None if trial.settles else f"the memory of law `{law.id}` comes to no rest by itself"


def _of_file(law: AbstractLaw) -> str:
    try:
        return f" of {file_of(type(law))[0]}"
    except InputError:  # its class came from no file
        return ""


@lru_cache(maxsize=256)
def _tried(
    kind: type[AbstractLaw], tree: Any, shapes: tuple[tuple[int, ...], ...],
    own: tuple[bytes, ...] | None,
) -> LawTrial:  # fmt: skip
    """The trial of a law of this class; `own`: its numbers, None where they are not known."""
    rng = np.random.default_rng(0)
    given = None
    if own is not None:
        given = [np.frombuffer(x).reshape(shape) for x, shape in zip(own, shapes, strict=True)]
    some = [_drawn(rng, kind, tree, shapes, given) for _ in range(DRAWS)]
    every = some if given is None else [given, *some]
    numbers = [np.stack(x) for x in zip(*every, strict=True)]
    beside = np.array(WHEEL) * rng.lognormal(size=(len(every), len(WHEEL)))
    with jax.ensure_compile_time_eval():  # a caller may be traced
        size = _memory(tree.unflatten(every[0]))[0].size
        tried = _held_against(tree, numbers, beside, _signals(rng, 2 + size))
        good, finite, rates = map(np.asarray, tried)
    drawn = (good | ~finite)[len(every) - DRAWS :]  # numbers that do not go together tell nothing
    settles = True
    if given is not None and size:
        values = np.linalg.svd(rates[0], compute_uv=False)
        settles = bool(values[-1] > SINGULAR * values[0])
    return LawTrial(bool(drawn.all() and (given is None or good[0])), settles)


def _drawn(rng: np.random.Generator, kind, tree, shapes, given) -> list[np.ndarray]:
    """Numbers of the size of those `given`, or of 1, within the ranges of their parameters."""
    paths = jax.tree_util.tree_flatten_with_path(tree.unflatten(range(len(shapes))))[0]
    numbers = []
    for (path, i), shape in zip(paths, shapes, strict=True):
        known = kind.parameters.get(getattr(path[0], "name", ""), Parameter(""))
        size = np.ones(shape) if given is None else np.where(given[i] == 0, 1.0, given[i])
        if np.isfinite([known.low, known.high]).all():
            numbers.append(rng.uniform(known.low, known.high, shape))
        else:
            numbers.append(np.clip(size * rng.lognormal(size=shape), known.low, known.high))
    return numbers


def _signals(rng: np.random.Generator, count: int) -> Float[np.ndarray, "s x"]:
    """Signals of every size: of one component alone, and of all."""
    size = SIZES[:, None, None]
    each = np.stack([size * np.eye(count), -size * np.eye(count), size * np.ones((count, count))])
    return (each * rng.uniform(-1, 1, each.shape)).reshape(-1, count)


def _memory(law: AbstractLaw) -> tuple[Array, Any]:
    """The memory as one vector, and the way back."""
    flat, unravel = ravel_pytree(jax.tree.map(lambda x: jnp.asarray(x, float), law_memory(law)))
    return flat, unravel


@partial(jax.jit, static_argnums=0)
def _held_against(
    tree: Any, numbers: list[Array], beside: Float[Array, "d 4"], signals: Float[Array, "s x"]
) -> tuple[Bool[Array, " d"], Bool[Array, " d"], Float[Array, "d z z"]]:
    """Whether each draw is linear, and finite, and the memory's rates by itself."""

    def of_draw(numbers, beside):
        law = tree.unflatten(numbers)
        unravel = _memory(law)[1]
        signal = ContactSignal if law.port == "contact" else MountSignal

        def response(x):
            felt = signal(x[0], x[1], *beside[: len(signal._fields) - 2])
            if len(x) == 2:
                return jnp.reshape(law_output(law, (), felt), 1)
            memory = unravel(x[2:])
            both = law_output(law, (), felt, memory), law_rate(law, felt, memory)
            return ravel_pytree(jax.tree.map(lambda x: jnp.asarray(x, float), both))[0]

        slope = jax.jacfwd(response)(jnp.zeros(signals.shape[1]))
        given = jax.vmap(response)(signals)
        wanted, size = signals @ slope.T, jnp.abs(signals) @ jnp.abs(slope).T
        good = jnp.all(jnp.abs(given - wanted) <= ROUNDING * size)
        finite = jnp.all(jnp.isfinite(given)) & jnp.all(jnp.isfinite(slope))
        return good, finite, slope[1:, 2:]

    return jax.vmap(of_draw)(numbers, beside)
