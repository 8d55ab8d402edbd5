"""Tables of rig files for tests, and one change to them."""

import copy
import tomllib

from omnijax.rig import bundled_rigs

ATLAS = tomllib.loads(bundled_rigs()["atlas"].read_text(encoding="utf-8"))
MISSING = object()


def tables(*changes) -> dict:
    """The Atlas rig's tables with `changes`: pairs (("wheel", 0, "radius"), value or MISSING)."""
    data = copy.deepcopy(ATLAS)
    for path, value in changes:
        here = data
        for step in path[:-1]:
            here = here[step]
        if value is MISSING:
            del here[path[-1]]
        else:
            here[path[-1]] = value
    return data


def with_effects(*blocks: dict) -> dict:
    """The Atlas rig's tables with effect blocks."""
    return tables((("effect",), list(blocks)))


def effect(name: str, place: str, **parameters) -> dict:
    """One effect block."""
    return {"id": name, "place": place, "parameters": parameters}
