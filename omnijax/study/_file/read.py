"""Reading numbers of study files: every wrong one collected, one sentence each."""

from collections.abc import Mapping
from typing import Any

from ...rig import Quantity


class Reader:
    """Reads numbers and collects what is wrong with them."""

    def __init__(self) -> None:
        self.problems: list[str] = []

    def say(self, sentence: str) -> None:
        """Note a problem."""
        self.problems.append(sentence)

    def number(
        self, table: Mapping, key: str, where: str, quantity: Quantity, default: Any = None
    ) -> Any:
        """A number in SI units, or `default` where there is none."""
        if key not in table:
            if default is None:
                self.say(f"`{where}.{key}` is missing.")
            return default
        return self.value(table[key], f"{where}.{key}", quantity, default)

    def value(self, found: Any, where: str, quantity: Quantity, default: Any = None) -> Any:
        """`found` in SI units."""
        try:
            return quantity.read(found)
        except ValueError as error:
            self.say(f"`{where}` {error}")
            return default

    def whole(self, table: Mapping, key: str, where: str, low: int, default: int) -> int:
        """A whole number from `low` on."""
        found = self.number(table, key, where, Quantity("1", low=low, whole=True), default)
        return int(found)
