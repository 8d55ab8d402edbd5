"""Laws that act one after the other, each on what the former left."""

from collections.abc import Callable, Iterable
from typing import Any


def in_series(
    value: Any, laws: Iterable[Any], change: Callable[[Any, Any], tuple[Any, Any]]
) -> tuple[Any, tuple[Any, ...]]:
    """`value` after `laws` that act one after the other, and the rates of their memories.

    `change(law, value)`: what one law adds to what the former left, and the rate of its memory.
    """
    rates = []
    for law in laws:
        added, rate = change(law, value)
        value = value + added
        rates.append(rate)
    return value, tuple(rates)
