"""Laws of one kind at one place as one: a rig file has one block an effect and place."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from ._actuators import MotorGain
from ._base import AbstractLaw
from ._measurement import SensorGain
from ._torques import Cogging, MotorRipple

IN_SERIES = ("actuator", "sensor")  # ports where a law takes up what the former left
LINES = (MotorRipple, Cogging)
GAINS = (MotorGain, SensorGain)


def joined(first: AbstractLaw, second: AbstractLaw) -> AbstractLaw | None:
    """One law whose output is that of both together, `first + second`; None where there is none.

    Lines of torque are one `cogging`, the strongest first.  Of other laws sizes add, where they are
    of one kind, their other numbers are equal and neither takes up what the other left; of waves
    (one size and a `phase`) as phasors.  Gains g and h in series are one of g + h + g h.
    """
    if isinstance(first, LINES) and isinstance(second, LINES):
        return _cogging(first, second)
    if type(first) is not type(second):
        return None
    if isinstance(first, GAINS):
        return _gain(first, second)
    sizes = [key for key, parameter in first.parameters.items() if parameter.linear]
    known = all(getattr(law, k) is not None for law in (first, second) for k in sizes)
    if first.port in IN_SERIES or not sizes or not known:
        return None
    whole = _phasor if "phase" in first.parameters and len(sizes) == 1 else _sum
    return whole(first, second, sizes)


def _gain(first: Any, second: Any) -> AbstractLaw:
    """A gain after another."""
    return type(first)(first.g + second.g + first.g * second.g)


def _having(law: Any, keys: Sequence[str], values: Sequence[Any]) -> Any:
    """A law with other numbers."""
    return eqx.tree_at(lambda x: [getattr(x, k) for k in keys], law, values)


def _sum(first: Any, second: Any, sizes: Sequence[str]) -> AbstractLaw | None:
    """Two laws of one kind with their sizes added, None where more than these is unlike."""
    without = [_having(law, sizes, [0.0] * len(sizes)) for law in (first, second)]
    if not eqx.tree_equal(*without):
        return None
    return _having(first, sizes, [getattr(first, k) + getattr(second, k) for k in sizes])


def _phasor(first: Any, second: Any, sizes: Sequence[str]) -> AbstractLaw | None:
    """The sum of two waves of one kind, None where more than size and phase is unlike."""
    keys = [*sizes, "phase"]
    if not eqx.tree_equal(*(_having(law, keys, [0.0, 0.0]) for law in (first, second))):
        return None
    both = sum(getattr(x, sizes[0]) * jnp.exp(1j * x.phase) for x in (first, second))
    return _having(first, keys, [jnp.abs(both), jnp.angle(both)])


def _cogging(*laws: Any) -> Cogging:
    """All lines of torque of some laws, the strongest first."""
    singular = [isinstance(law, MotorRipple) for law in laws]
    columns = [
        jnp.concatenate(
            [
                jnp.atleast_1d(getattr(law, key if one else f"{key}s"))
                for law, one in zip(laws, singular, strict=True)
            ]
        )
        for key in ("amplitude", "order", "phase")
    ]
    strongest = jnp.argsort(-columns[0])
    return Cogging(*(column[strongest] for column in columns))


def one_a_place(placed: Sequence[Any]) -> tuple[Any, ...]:
    """Placed laws (each with a `law` and a `place`) with those of a place joined that can be.

    In the order of the first of each; what cannot be joined stays beside the other, and so do gains
    with another law of their port between them.
    """
    out: list[Any] = []
    for one in placed:
        for k, other in enumerate(out):
            both = joined(other.law, one.law) if other.place == one.place else None
            between = (x.law.port for x in out[k + 1 :])
            if both is not None and not (isinstance(both, GAINS) and both.port in between):
                out[k] = eqx.tree_at(lambda x: x.law, other, both)
                break
        else:
            out.append(one)
    return tuple(out)
