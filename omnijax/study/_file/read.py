"""Reading numbers of study files: every wrong one collected, one sentence each."""

from collections.abc import Iterable
from typing import Any

from ...rig import Quantity
from .problems import Place


class Reader:
    """Reads numbers and collects what is wrong with them."""

    def __init__(self, problems: Iterable[str] = (), dropped: Iterable[Place] = ()) -> None:
        self.problems, self._dropped = list(problems), tuple(dropped)

    def lost(self, *place: str) -> bool:
        """Whether something that stood at `place`, or in it, was wrong and has been dropped."""
        return any(entry[: len(place)] == place for entry in self._dropped)

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
