"""Reading study files: every wrong entry collected, one sentence each."""

from collections.abc import Mapping
from typing import Any

from ..._errors import did_you_mean
from ...rig import Quantity


class Reader:
    """Reads tables and collects what is wrong with them."""

    def __init__(self) -> None:
        self.problems: list[str] = []

    def say(self, sentence: str) -> None:
        """Note a problem."""
        self.problems.append(sentence)

    def table(self, data: Any, where: str, keys: tuple[str, ...]) -> dict[str, Any]:
        """A table with only `keys`."""
        if not isinstance(data, Mapping):
            self.say(f"`{where}` must be a table, but is {data!r}.")
            return {}
        for key in data:
            if key not in keys:
                hint = did_you_mean(key, keys) or f" Known keys: {', '.join(keys)}."
                path = f"{where}.{key}" if where else key
                self.say(f"`{path}` is not a key of a study file.{hint}")
        return {key: data[key] for key in data if key in keys}

    def tables(self, data: Mapping, key: str, keys: tuple[str, ...]) -> list[dict[str, Any]]:
        """A list of tables."""
        blocks = data.get(key, [])
        if not isinstance(blocks, list):
            self.say(f"`{key}` must be a list of tables ([[{key}]]), but is {blocks!r}.")
            return []
        names = [self._label(block, i) for i, block in enumerate(blocks)]
        return [
            self.table(block, f"{key}.{name}", keys)
            for block, name in zip(blocks, names, strict=True)
        ]

    @staticmethod
    def _label(block: Any, i: int) -> str:
        found = block if isinstance(block, Mapping) else {}
        name = found.get("path", found.get("name", found.get("quantity")))
        return name if isinstance(name, str) else str(i + 1)

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

    def choice(self, table: Mapping, key: str, where: str, options: tuple[str, ...]) -> str:
        """One of `options`; the first where there is none."""
        found = table.get(key, options[0])
        if found not in options:
            hint = did_you_mean(str(found), options)
            path = f"{where}.{key}" if where else key
            self.say(f"`{path}` must be one of {', '.join(options)}, but is {found!r}.{hint}")
            return options[0]
        return found

    def text(self, table: Mapping, key: str, where: str, default: str) -> str:
        """Text of some length, or `default` where there is none."""
        found = table.get(key, default)
        if not isinstance(found, str) or not found.strip() or not found.isprintable():
            self.say(f"`{where}.{key}` must be printable text, but is {found!r}.")
            return default
        return found

    def whole(self, table: Mapping, key: str, where: str, low: int, default: int) -> int:
        """A whole number from `low` on."""
        found = self.number(table, key, where, Quantity("1", low=low, whole=True), default)
        return int(found)
