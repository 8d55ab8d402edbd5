"""Reading numbers of study files: every wrong one collected, one sentence each."""

from typing import Any

from ...rig import Quantity


class Reader:
    """Reads numbers and collects what is wrong with them."""

    def __init__(self) -> None:
        self.problems: list[str] = []

    def say(self, sentence: str) -> None:
        """Note a problem."""
        self.problems.append(sentence)

    def value(self, given: Any, where: str, quantity: Quantity, default: Any = None) -> Any:
        """`given` in SI units."""
        try:
            return quantity.read(given)
        except ValueError as error:
            self.say(f"`{where}` {error}")
            return default
