"""Candidates of a rig: every law of the library at every place it may have."""

import numpy as np

from ...laws import AbstractLaw
from .._search import Candidate
from .recipes import RECIPES
from .unit_laws import Context, by_parameters

# never proposed for a rig: the twin of creep, which is said beside it, and several lines at one
# place, which are found one by one and told as one effect
UNTRIED = {"wheel-radius", "cogging"}
_NEEDS_GRAVITY = {"unbalance"}


def candidates(context: Context, laws: dict[str, type[AbstractLaw]]) -> list[Candidate]:
    """Every candidate of `laws` for a rig."""
    out: list[Candidate] = []
    for id, law in laws.items():
        if id in UNTRIED or (
            id in _NEEDS_GRAVITY and not np.any(np.asarray(context.rig.platform.gravity))
        ):
            continue
        make = RECIPES.get(id, by_parameters)
        for place in places(law, context):
            out += make(law, place, context)
    return out


def places(law: type[AbstractLaw], context: Context) -> list[str]:
    """Places of a law on this rig, in channels that were measured."""
    names, groups = context.rig.names, context.groups
    wheels = range(1, len(names) + 1)
    channels = [f"{g}_{i}" for g in groups for i in (wheels if g == "theta" else "xyz")]
    known = {
        "wheel": list(names),
        "all": ["all"] if len(names) > 1 else [],
        "group": list(groups),
        "channel": channels,
        "encoder": [c for c in channels if c.startswith("theta")],
    }
    out: list[str] = []
    for place in law.places:
        default = [place] if place in groups or place in ("sphere", "platform") else []
        out += known.get(place, default)
    return out
