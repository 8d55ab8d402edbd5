"""Which wheels turn in step, so that their start angles matter in the long run: asked of a study.

The figures of the long run take the phases of wheels as independent.  Where the paces of two
wheels are as small whole numbers they are not.  On the bundled tripod, of which two wheels turn,
the start angles move an RMS by up to 18 % where the paces are alike, 7 % as 2 : 3, 3 % as 1 : 2
and 2 % as 1 : 3; less than 1 % as 1 : 4 or 5 : 7.
"""

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ...laws import DamagedRoller, TableShape, WheelRunout
from ...rig import Rig
from .drives import Drive, apply, turning
from .methods import Question

RATIOS = (1.0, 1 / 2, 2.0, 2 / 3, 3 / 2)  # of paces in step: those that move an RMS by 3 % and more
MOST = 4096  # designs that are looked at


class _Paces(NamedTuple):
    """Of designs: how fast wheels turn (rad/s) and pass their rollers; NaN where it is open."""

    speeds: Float[np.ndarray, "d n"]
    rollers: Float[np.ndarray, "d n"]


def wheels_in_step(question: Question, ranges: Sequence[Any] = ()) -> str | None:
    """Which wheels turn in step, so that their start angles matter; None where none do.

    Of the question's drives, and of the levels of its `ranges`; speeds that may take any value of
    a range, as drawn ones do, are in step with none.
    """
    turns = _once_a_turn(question.rig)
    for drive in question.drives:
        speeds, rollers = _designs(question, drive, ranges)
        speeds = np.abs(speeds)
        paces = np.stack([speeds * rollers, np.where(turns, speeds, np.nan)], -1)
        paces[~(paces > 0)] = np.nan
        groups = [_in_step(each) for each in paces]
        first = next((k for k, group in enumerate(groups) if len(group) > 1), None)
        if first is not None:
            share = sum(len(group) > 1 for group in groups), len(groups)
            return _said(question.rig.names, groups[first], paces[first], *share)
    return None


def _said(names: Sequence[str], group: list[int], paces: np.ndarray, some: int, count: int) -> str:
    *others, last = (names[i] for i in group)
    own = paces[group, 0]
    alike = np.isnan(own).any() or np.allclose(own, own[0], rtol=1e-9)
    as_numbers = "" if alike else f"as {' : '.join(f'{x:.4g}' for x in own / own.min())}"
    where = f", {as_numbers}" if as_numbers else ""
    if count > 1:
        first = f" ({as_numbers} in the first of these)" if as_numbers else ""
        where = f" in {some} of {count} designs{first}"
    return (
        f"{', '.join(others)} and {last} turn in step{where}, and in the long run no "
        "start angles are taken as known: an RMS is the mean over them, a peak the largest of all. "
        "A duration takes the angles of the drive."
    )


def _once_a_turn(rig: Rig) -> Bool[np.ndarray, " n"]:
    """Whether something of a wheel comes once a turn, beside its rollers."""
    laws = [x for x in rig.at("shape") if isinstance(x.law, WheelRunout | DamagedRoller)]
    return np.array([
        (isinstance(profile, TableShape) and profile.whole_turn) or any(i in x.wheels for x in laws)
        for i, profile in enumerate(rig.profiles)
    ])  # fmt: skip


def _in_step(paces: Float[np.ndarray, "n k"]) -> list[int]:
    """The first wheels (by number) that are in step with each other, of their paces; or none."""
    linked = {frozenset((i, j)) for i, j in itertools.combinations(range(len(paces)), 2)
              if _related(paces[i], paces[j])}  # fmt: skip
    if not linked:
        return []
    group = set(min(linked, key=sorted))
    while more := {i for link in linked if link & group for i in link} - group:
        group |= more
    return sorted(group)


def _related(one: np.ndarray, other: np.ndarray) -> bool:
    quotients = np.divide.outer(one, other)
    return bool(np.isclose(quotients[..., None], RATIOS, rtol=1e-9, atol=0).any())


def _designs(question: Question, drive: Drive, ranges: Sequence[Any]) -> _Paces:
    """The paces of the designs that differ in them, under one drive; `MOST` of them at most."""
    rig = question.rig
    base = _Paces(*(x[None] for x in _of(rig, drive)))
    levels: dict[str, np.ndarray] = {}
    for k, path in enumerate(question.varied):
        of_speed = path.startswith("speed.") and path != "speed.scale"
        if of_speed or (path.startswith("wheel.") and path.endswith(".rollers")):
            levels[path] = _levels(ranges[k]) if k < len(ranges) else np.full(1, np.nan)
    shape = [len(x) for x in levels.values()]
    count = int(np.prod(shape, dtype=float))
    chosen = np.arange(count)
    if count > MOST:
        chosen = np.sort(np.random.default_rng(0).integers(0, count, MOST))
    speeds, rollers = (np.repeat(x, len(chosen), 0) for x in base)
    numbers = np.unravel_index(chosen, shape) if shape else ()
    for (path, values), k in zip(levels.items(), numbers, strict=True):
        tried = [_of(*apply(rig, drive, (path,), [value])) for value in values]
        for whole, column in ((speeds, 0), (rollers, 1)):
            new = np.stack([each[column] for each in tried])[k]
            changed = ~np.isclose(new, base[column], rtol=1e-15, atol=0)
            whole[changed] = new[changed]
    return _Paces(speeds, rollers)


def _levels(one: Any) -> np.ndarray:
    """Values that a range may take; NaN where these are any of it."""
    if getattr(one, "values", None) is not None:
        return np.asarray(one.values, float)
    if getattr(one, "count", None) is not None:
        return one.levels()
    if getattr(one, "whole", False):
        return np.arange(one.low, one.high + 1)
    return np.full(1, np.nan)


def _of(rig: Rig, drive: Drive) -> tuple[np.ndarray, np.ndarray]:
    """The constant speeds (n,) of the wheels in rad/s, and their numbers (n,) of rollers."""
    return np.asarray(turning(drive).values)[0], np.asarray(rig.wheels.rollers, float)
