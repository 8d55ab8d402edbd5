"""Signatures beside laws that bend what others change.

A signature is what a law changes in the machine without laws at contacts and mounts; beside a play
that rattles the same law changes something else (a relaxation beside a backlash: cosine 0.81, a
twelfth of the gain), and a weaker law that explains less stands before it.  What stands out there,
and what an effect is compared with, is scored again by differences through the laws of the fit.
"""

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from .._settings import SETTINGS
from .candidates import strengths
from .model import AbstractModel, Point
from .scan import Scan, Score, Signatures

MOST_COLUMNS = SETTINGS.through_laws.most_columns
VARIANTS = SETTINGS.through_laws.variants


def through_laws(
    model: AbstractModel, point: Point, scan: Scan, names: Iterable[str]
) -> dict[int, np.ndarray]:
    """By candidate of the `names` its signatures (k, rows) through the laws of `point`.

    Nothing where these are not stepped in time.  Differences are taken at strengths that change as
    much as the scan's gain says, and of a whole law that has none; of a name's best variants and
    of so many columns at most.
    """
    if not model.needs_stepping(point.effects):
        return {}
    return variants_through_laws(model, point, scan, _variants(model, point, scan, names))


def variants_through_laws(
    model: AbstractModel, point: Point, scan: Scan, some: Sequence[Score]
) -> dict[int, np.ndarray]:
    """By candidate of some scores its signatures (k, rows) through the laws of `point`."""
    if not some:
        return {}
    steps = [_steps(model, scan, score) for score in some]
    tables = model.through_laws(point, [s.candidate for s in some], steps)
    if not tables:  # the scan's are those already
        return {}
    return {
        s.index: table for s, table in zip(some, tables, strict=True) if np.all(np.isfinite(table))
    }


def scored_through_laws(
    model: AbstractModel, point: Point, signatures: Signatures, scored: Callable[[], Scan],
    names: Callable[[Scan], Iterable[str]],
) -> Scan:  # fmt: skip
    """The scan that `scored` makes, once more with what its `names` change through the laws."""
    scan = scored()
    tables = through_laws(model, point, scan, names(scan))
    if not tables:
        return scan
    with signatures.replaced(tables):
        return scored()


def _steps(model: AbstractModel, scan: Scan, score: Score) -> np.ndarray:
    """By column of a candidate the strength at which its difference is taken."""
    if not strengths(model.laws[score.candidate.id]):
        return np.ones(len(score.coefficients))
    return np.sqrt(max(1.0, score.gain)) / scan.layout.scale[scan.layout.part(score.index)]


def _variants(model: AbstractModel, point: Point, scan: Scan, names: Iterable[str]) -> list[Score]:
    """The best variants of the `names` whose laws change what the point's laws bend."""
    by_name: dict[str, list[Score]] = {name: [] for name in names}
    for score in scan.order:
        c = score.candidate
        if c.name not in by_name or score.dead or model.laws[c.id].port == "sensor":
            continue
        if not model.has(point.effects, c.id, c.place) and len(by_name[c.name]) < VARIANTS:
            by_name[c.name].append(score)
    some, columns = [], 0
    for score in (s for alike in by_name.values() for s in alike):
        columns += len(score.coefficients)
        if columns > MOST_COLUMNS:
            break
        some.append(score)
    return some
