"""The kinds of TOML files, told apart by their tables."""

from collections.abc import Mapping
from typing import Any

_OF_RIGS = {"sphere", "platform", "wheel"}
_OF_STUDIES = {"rig", "objective", "variable", "constraint", "search", "pareto", "limit", "drive"}


def kind_of(tables: Mapping[str, Any]) -> str:
    """What the tables of a TOML file describe, by their names: `machine`, `study` or `rig`."""
    if _OF_RIGS & set(tables):
        return "rig"
    if "kind" in tables:
        return "machine"
    return "study" if _OF_STUDIES & set(tables) else "rig"
