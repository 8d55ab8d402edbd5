"""Candidates of a rig: every law of the library at every place it may have."""

import numpy as np

from ....laws import AbstractLaw
from ..._search import Candidate, holds_list
from .recipes import RECIPES
from .unit_laws import Context, by_parameters

_NEEDS_GRAVITY = {"unbalance"}


def untried(laws: dict[str, type[AbstractLaw]]) -> set[str]:
    """Ids of laws that are never proposed for a rig: those that hold lists.

    Several lines at one place (`cogging`) are found one by one and told as one effect.
    """
    return {id for id, law in laws.items() if holds_list(law)}


def candidates(context: Context, laws: dict[str, type[AbstractLaw]]) -> list[Candidate]:
    """Every candidate of `laws` for a rig."""
    out: list[Candidate] = []
    left_out = untried(laws)
    if not np.any(np.asarray(context.rig.platform.gravity)):
        left_out |= _NEEDS_GRAVITY
    for id, law in laws.items():
        if id in left_out:
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
    here = {*names, *groups, *channels, "sphere", "platform"}
    every = [
        place for word in law.places for place in known.get(word, [word] if word in here else [])
    ]
    return list(dict.fromkeys(every))
