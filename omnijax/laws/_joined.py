"""Laws of one kind at one place as one: a rig file has one block an effect and place."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from ._base import AbstractLaw
from ._torques import Cogging, MotorRipple

IN_SERIES = ("actuator", "sensor")  # ports where a law takes up what the former left
LINES = (MotorRipple, Cogging)


def joined(first: AbstractLaw, second: AbstractLaw) -> AbstractLaw | None:
    """One law whose output is that of both together, `first + second`; None where there is none.

    Lines of torque are one `cogging`, the strongest first.  Of other laws sizes add, where they are
    of one kind, their other numbers are equal and neither takes up what the other left.
    """
    if isinstance(first, LINES) and isinstance(second, LINES):
        return _cogging(first, second)
    sizes = [key for key, parameter in first.parameters.items() if parameter.linear]
    if type(first) is not type(second) or first.port in IN_SERIES or not sizes:
        return None
    if any(getattr(law, k) is None for law in (first, second) for k in sizes):
        return None

    def with_sizes(law, values) -> Any:
        return eqx.tree_at(lambda x: [getattr(x, k) for k in sizes], law, values)

    without = [with_sizes(law, [0.0] * len(sizes)) for law in (first, second)]
    if not eqx.tree_equal(*without):
        return None
    return with_sizes(first, [getattr(first, k) + getattr(second, k) for k in sizes])


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

    In the order of the first of each; what cannot be joined stays beside the other.
    """
    out: list[Any] = []
    for one in placed:
        for k, other in enumerate(out):
            both = joined(other.law, one.law) if other.place == one.place else None
            if both is not None:
                out[k] = eqx.tree_at(lambda x: x.law, other, both)
                break
        else:
            out.append(one)
    return tuple(out)
