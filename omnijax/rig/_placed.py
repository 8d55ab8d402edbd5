"""Laws at the wheels: where each acts, and the sum of all at one port."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool

from .._errors import InputError
from ..laws import AbstractLaw

NUMBERS = (jax.Array, np.ndarray, np.number, int, float)  # what a law may give


class Placed(eqx.Module):
    """A law and where it acts: the wheels' indices (none for sphere, platform and sensors)."""

    law: AbstractLaw
    place: str = eqx.field(static=True)
    wheels: tuple[int, ...] = eqx.field(static=True, default=())

    @property
    def group(self) -> str:
        """The output group that a law at a sensor reads, whole or a channel of it: dR, theta..."""
        return self.place.split("_")[0]


def stands_twice(law: str, place: str) -> str:
    """The sentence on a law that a rig has twice at one place: no file or path tells them apart."""
    return f"`effect.{law}.{place}` stands twice: a rig file has one block an effect and place."


def without_preload(law: str, place: str, preloads: Mapping[str, float | None]) -> list[str]:
    """A sentence on each wheel that a law with its tangent at the preload finds unloaded.

    `preloads` in N by the wheel's name, None where it is not known.
    """
    if law != "contact-hertz":
        return []
    return [
        f"`effect.{law}.{place}` needs a preload, but `wheel.{name}.closure.preload` is 0."
        for name, preload in preloads.items()
        if place in {"all", name} and preload == 0
    ]


def take_wheels(values: Any, wheels: Sequence[int], size: int) -> Any:
    """Rows of `values` (leading axis the wheel) at `wheels`; all of them cost no gather."""
    if tuple(wheels) == tuple(range(size)):
        return values
    index = jnp.asarray(wheels)
    return jax.tree.map(lambda x: x[index], values)


def put_wheels(whole: Any, wheels: Sequence[int], values: Any) -> Any:
    """`whole` (n, ...) with `values` in its rows at `wheels`; all of them cost no scatter."""
    if tuple(wheels) == tuple(range(len(whole))):
        return values
    return whole.at[jnp.asarray(wheels)].set(values)


class Acting(eqx.Module):
    """A law and the wheels on which it acts: their indices, or a mask (n,) of numbers.

    Indices evaluate the law on its own wheels alone, so that another wheel's numbers cannot spoil
    a gradient.  A mask lets one compiled program serve the law at every place.
    """

    law: AbstractLaw
    wheels: tuple[int, ...] = eqx.field(static=True, default=())
    mask: Bool[Array | np.ndarray, " n"] | None = None

    def total(self, signals: Any, memory: Any, zero: Any, size: int) -> tuple[Any, Any]:
        """The law's outputs on per-wheel `signals`, one entry a wheel, and its memory's rate."""
        remembers = memory is not None
        if self.mask is None:
            signals = take_wheels(signals, self.wheels, size)
        law = partial(_numbers_of, self.law)
        if remembers:
            value = jax.vmap(law)(signals, memory)
            rate = jax.vmap(partial(law_rate, self.law))(signals, memory)
        else:
            value, rate = jax.vmap(law)(signals), None

        self._check(value, zero)

        def spread(z, v):
            if self.mask is not None:
                return jnp.where(self.mask, v, 0.0 * z)
            return put_wheels(jnp.zeros(size) + z, self.wheels, z + v)

        return jax.tree.map(spread, zero, value), rate

    def _check(self, value: Any, zero: Any) -> None:
        """`InputError` where a law gives something else than the numbers of its port."""
        same = jax.tree.structure(value) == jax.tree.structure(zero)
        if not same or any(jnp.ndim(v) != 1 for v in jax.tree.leaves(value)):
            given = jax.tree.map(lambda v: jnp.shape(v)[1:], value)
            raise InputError(
                f"law `{self.law.id}` must return {_numbers(zero)} at its port `{self.law.port}`, "
                f"but returns {given} (shapes)."
            )

    def rest(self, size: int) -> Any:
        """Rest states of the law's memory, one entry a wheel on which it is evaluated."""
        count = len(self.wheels) if self.mask is None else size
        z = law_memory(self.law)
        return jax.tree.map(lambda x: jnp.broadcast_to(x, (count, *jnp.shape(x))), z)


def law_output(law: AbstractLaw, shape: tuple[int, ...], *signals: Any) -> Any:
    """What a law gives, an array of its port's `shape`; `InputError` where it is something else."""
    value = _numbers_of(law, *signals)
    given = jax.tree.map(jnp.shape, value)
    if given != shape:
        wanted = {(): "one number", (3,): "three numbers"}.get(shape, f"an array of shape {shape}")
        raise InputError(
            f"law `{law.id}` must return {wanted} at its port `{law.port}`, but returns {given} "
            "(shapes)."
        )
    return value


def law_memory(law: AbstractLaw) -> Any:
    """A law's memory at first, None without one; `InputError` where a part of it is no number."""
    memory = law.initial()
    _check_numbers(law, memory, "from `initial`")
    return memory


def law_rate(law: AbstractLaw, signal: Any, memory: Any) -> Any:
    """The rate of a law's memory; `InputError` where it is not alike to that."""
    rate = law.rate(signal, memory)
    _check_numbers(law, rate, "from `rate`")
    given, wanted = (jax.tree.map(jnp.shape, x) for x in (rate, memory))
    if given != wanted:
        raise InputError(
            f"law `{law.id}` must return the rate of its memory from `rate`, {wanted} (shapes), "
            f"but returns {given}."
        )
    return rate


def _numbers_of(law: AbstractLaw, *signals: Any) -> Any:
    """What a law gives; `InputError` where a part of it, such as a text, is no real number."""
    value = law(*signals)
    _check_numbers(law, value, f"at its port `{law.port}`")
    return value


def _check_numbers(law: AbstractLaw, value: Any, where: str) -> None:
    """`InputError` for what is no real number in what a law returns."""
    for x in jax.tree.leaves(value):
        if not isinstance(x, NUMBERS):
            raise InputError(f"law `{law.id}` must return numbers {where}, but returns {x!r}.")
        if jnp.iscomplexobj(x):
            raise InputError(
                f"law `{law.id}` must return real numbers {where}, but returns complex ones."
            )


def _numbers(zero: Any) -> str:
    fields = getattr(zero, "_fields", None)
    return f"a {type(zero).__name__} of numbers" if fields else "one number"


def acting(placed: Sequence[Placed], size: int, masked: bool = False) -> tuple[Acting, ...]:
    """Placed per-wheel laws as `Acting`, by indices or by masks."""
    if not masked:
        return tuple(Acting(p.law, p.wheels) for p in placed)
    wheels = np.arange(size)
    return tuple(Acting(p.law, (), np.isin(wheels, p.wheels)) for p in placed)


def total_over_wheels(
    laws: Sequence[Acting], signals: Any, memory: Sequence[Any], size: int, zero: Any = 0.0
) -> tuple[Any, tuple[Any, ...]]:
    """Sum of per-wheel laws on per-wheel `signals` (n, ...), and the rates of their memories."""
    total, rates = jax.tree.map(lambda z: jnp.zeros(size) + z, zero), []
    for law, state in zip(laws, memory, strict=True):
        value, rate = law.total(signals, state, zero, size)
        total = jax.tree.map(lambda a, v: a + v, total, value)
        rates.append(rate)
    return total, tuple(rates)


def over_wheels(placed: Sequence[Placed], signals: Any, size: int, zero: Any = 0.0) -> Any:
    """Sum of per-wheel laws without memory on per-wheel `signals`, one entry a wheel."""
    laws = acting(placed, size)
    return total_over_wheels(laws, signals, (None,) * len(laws), size, zero)[0]
