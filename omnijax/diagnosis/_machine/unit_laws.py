"""Laws of unit strength on a rig: the columns of its candidates."""

import itertools
import math

import numpy as np

from ...laws import AbstractLaw
from ...rig import Placed, Rig, place_law
from .._search import Candidate, is_wave, number, strengths, unknown_shapes, values_to_try


class Context:
    """What enumerates candidates: the rig, the channels at hand, typical sizes, and lines.

    `samples` of the longest run is about how many lines (half a resolution apart) could be picked.
    `orders` holds by law and wheel the orders that stand out and of how many they were picked,
    `torques` the largest commanded torque of each wheel, `tops` what a channel hardly exceeds.
    """

    def __init__(self, rig: Rig, groups, mount_rms, lines: tuple[float, ...], samples: int,
                 orders=None, torques=None, tops=None):  # fmt: skip
        self.rig, self.groups, self.mount_rms, self.lines = rig, groups, mount_rms, lines
        self.samples, self.orders, self.tops = samples, orders or {}, tops or {}
        self.torques = np.zeros(len(rig.names)) if torques is None else torques


def build(law: type[AbstractLaw], place: str, context: Context, **values) -> Placed:
    """A law with these parameters, placed."""
    made = law(**{k: number(v) for k, v in values.items()})
    return place_law(made, place, context.rig.names, context.rig.profiles)


def by_parameters(law, place, context) -> list[Candidate]:
    """A law by its table of parameters: a column a strength, shape constants from a ladder.

    One of one strength with a `phase` is a wave; with any other a `phase` begins at 0.
    """
    linear, shapes = strengths(law), unknown_shapes(law)
    ladders = [values_to_try(k, law.parameters[k]) for k in shapes]
    out = []
    for values in itertools.product(*ladders):
        fixed = dict(zip(shapes, values, strict=True))
        note = ", ".join(f"{k} {_said(v)}" for k, v in fixed.items())
        if is_wave(law):
            out.append(as_waves(law, place, context, note, 1, **fixed))
            continue
        fixed |= {"phase": 0.0} if "phase" in law.parameters else {}
        columns = []
        for key in linear or [None]:
            size = law.parameters[key].shape if key else 0
            for unit in np.eye(size) if size else [1.0]:
                zero = {k: np.zeros(law.parameters[k].shape or ()) for k in linear}
                chosen = zero | ({key: unit} if key else {}) | fixed
                columns.append(build(law, place, context, **chosen))
        out.append(Candidate(law.id, place, tuple(columns), _decoder(linear, law, fixed), note))
    return out


def _said(value) -> str:
    """A number, or a vector of numbers, as a note says it."""
    return f"[{', '.join(f'{x:.3g}' for x in value)}]" if np.ndim(value) else f"{value:.3g}"


def _decoder(linear, law, fixed):
    def decode(c):
        values, at = dict(fixed), 0
        for key in linear:
            size = law.parameters[key].shape
            values[key] = np.array(c[at : at + size]) if size else float(c[at])
            at += max(1, size)
        return values

    return decode


def as_waves(law, place, context, note: str = "", trials: int = 1, **fixed) -> Candidate:
    """A law of one strength and a phase as its cosine and sine parts."""
    (size,) = strengths(law)
    columns = tuple(
        build(law, place, context, **{size: 1.0}, phase=p, **fixed) for p in (0.0, math.pi / 2)
    )
    return Candidate(law.id, place, columns, lambda c: fixed | {
        size: math.hypot(*c), "phase": math.atan2(c[1], c[0])}, note, trials)  # fmt: skip
