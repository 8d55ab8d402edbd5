"""Laws of unit strength on a rig: the columns of its candidates."""

import itertools

import numpy as np

from ....laws import AbstractLaw
from ....rig import Placed, Rig, place_law
from ..._search import (
    Candidate,
    number,
    strengths,
    unit_laws,
    unknown_shapes,
    values_to_try,
)


class Context:
    """What enumerates candidates: the rig, the channels at hand, typical sizes, and lines.

    `samples` of the longest run is about how many lines (half a resolution apart) could be picked.
    `orders` holds by law and wheel the orders that stand out and of how many they were picked,
    `torques` the largest commanded torque of each wheel, `tops` what a channel hardly exceeds,
    `speed` the wheels' RMS speed in rad/s.
    """

    def __init__(self, rig: Rig, groups, mount_rms, lines: tuple[float, ...], samples: int,
                 orders=None, torques=None, tops=None, speed: float = 1.0):  # fmt: skip
        self.rig, self.groups, self.mount_rms, self.lines = rig, groups, mount_rms, lines
        self.samples, self.orders, self.tops = samples, orders or {}, tops or {}
        self.speed = speed
        self.torques = np.zeros(len(rig.names)) if torques is None else torques

    def held(self, law: type[AbstractLaw], place: str) -> AbstractLaw | None:
        """The same law that the rig has at a place already."""
        return held_law(self.rig, law.id, place)


def held_law(rig: Rig, id: str, place: str) -> AbstractLaw | None:
    """The law of an id that a rig has at a place; None where it has none."""
    return next((p.law for p in rig.effects if (p.law.id, p.place) == (id, place)), None)


def held_sizes(law: AbstractLaw | None) -> dict[str, float]:
    """The sizes of a law, those that are one number each."""
    if law is None:
        return {}
    keys = [k for k in strengths(law) if not law.parameters[k].shape]
    return {k: float(getattr(law, k)) for k in keys if getattr(law, k) is not None}


def build(law: type[AbstractLaw], place: str, context: Context, **values) -> Placed:
    """A law with these parameters, placed."""
    return _placed(law(**{k: number(v) for k, v in values.items()}), place, context)


def _placed(law: AbstractLaw, place: str, context: Context) -> Placed:
    return place_law(law, place, context.rig.names, context.rig.profiles)


def by_parameters(law, place, context) -> list[Candidate]:
    """A law by its table of parameters: a column a strength, shape constants from a ladder."""
    shapes = unknown_shapes(law)
    ladders = [values_to_try(k, law.parameters[k]) for k in shapes]
    out = []
    for values in itertools.product(*ladders):
        fixed = dict(zip(shapes, values, strict=True))
        note = ", ".join(f"{k} {_said(v)}" for k, v in fixed.items())
        out.append(of_units(law, place, context, fixed, note))
    return out


def of_units(law, place, context, fixed: dict, note: str = "", trials: int = 1) -> Candidate:
    """A law by its laws of unit strength at shape constants `fixed`."""
    known = context.held(law, place)
    width = None if known is None else getattr(known, "width", None)
    if width is not None and "width" in law.parameters:  # so that both together are one law
        fixed = {"width": float(width)} | fixed
    units, decode = unit_laws(law, fixed)
    columns = tuple(_placed(unit, place, context) for unit in units)
    return Candidate(law.id, place, columns, decode, note, trials, held_sizes(known))


def _said(value) -> str:
    """A number, or a vector of numbers, as a note says it."""
    return f"[{', '.join(f'{x:.3g}' for x in value)}]" if np.ndim(value) else f"{value:.3g}"
