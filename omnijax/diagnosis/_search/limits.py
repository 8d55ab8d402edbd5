"""What the runs exclude: an upper limit for every effect that was not named.

To first order the strength c of a candidate is known from its score: c has the mean and the
covariance of the linear fit, the baseline and the named effects free.  The limit is the estimate
and 1.645 of its 1-sigma; of several strengths together, the 95 % point of their size's
distribution.  An estimate below what is possible excludes no more than zero does (Cowan and others,
Power-constrained limits, 2011).
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from .._settings import SETTINGS
from .candidates import is_wave
from .fit import Fit
from .model import AbstractModel, to_project
from .scan import Scan, Score, Signatures, taken_up
from .through_laws import MOST_COLUMNS, variants_through_laws

SURE, ONE_SIDED = 0.95, 1.6449  # the normal law's 95 % point
DRAWS = SETTINGS.limits.draws
BLOCKS = SETTINGS.held_out.blocks
MOST_SHARE = SETTINGS.limits.most_share
# sizes whose variants stand for one effect: the least limit holds
SMALLEST = ("gap", "delay", "tau")
BOUND = "limit"  # a law that bounds what passes is the stronger the lower its bound


def upper_limits(
    model: AbstractModel, fit: Fit, signatures: Signatures, named: set[str]
) -> list[dict[str, Any]]:
    """{id, place, parameter, limit_95, unit, largest} of every effect and place but `named` ones.

    `limit_95` is None where the runs say nothing about the effect: they would not show it, or but
    at a size above the `largest` that it may have.  Of a saturation it is the
    highest bound tried that they exclude, `share` the 95 % limit of its law's own size there.
    Beside a law that is stepped in time others of its kind change something else than in the
    machine without it: their limits are of what they change there.
    """
    J, u = to_project(model, fit.jacobian, fit.point.u)
    taken = taken_up(J, len(u))
    scan = signatures.scan(fit.residual, taken, u)
    best: dict[str, dict[str, Any]] = {}
    holding: dict[str, Score] = {}
    for score in scan.scores:
        c = score.candidate
        if c.name in named:
            continue
        key, unit = size_of(model, c)
        entry = {"id": c.id, "place": c.place, "parameter": key, "limit_95": None, "unit": unit,
                 "largest": largest_of(model, c.id, key)}  # fmt: skip
        old = best.setdefault(c.name, entry)
        told = _limit(signatures, scan, score, fit.residual, entry)
        if told is not None and (old["limit_95"] is None or _holds(key, told, old)):
            best[c.name], holding[c.name] = {**entry, **told}, score
    if model.needs_stepping(fit.point.effects):
        stepped = {"all", *(e.place for e in fit.point.effects if model.bends(e.id))}
        bent = [s for s in holding.values() if model.bends(s.candidate.id)]
        bent.sort(key=lambda s: s.candidate.place not in stepped)
        tables = variants_through_laws(model, fit.point, scan, bent[:MOST_COLUMNS])
        if tables:
            some = [signatures.layout.candidates[i] for i in tables]
            through = Signatures(some, np.concatenate([*tables.values()]))
            scan = through.scan(fit.residual, taken, u)
            for score in scan.scores:
                entry = best[score.candidate.name]
                told = _limit(through, scan, score, fit.residual, entry)
                entry.update(told or {"limit_95": None})
    return sorted(best.values(), key=lambda x: (x["id"], x["place"]))


def _limit(
    signatures: Signatures, scan: Scan, score: Score, residual: np.ndarray, entry: Mapping[str, Any]
) -> dict[str, float] | None:
    """`limit_95` of one candidate, of a bound its `share` too; None where the runs say nothing."""
    if score.dead:
        return None
    key = entry["parameter"]
    spread = inflation(signatures, score, residual)
    limit = limit_of(scan, score, spread, "share" if key == BOUND else key)
    if limit is None or key != BOUND:
        return {"limit_95": limit} if limit is not None and limit < entry["largest"] else None
    bound = float(score.candidate.decode(np.ones(len(score.coefficients)))[key])
    return {"limit_95": bound, "share": limit} if limit < 1 else None


def _holds(key: str, told: dict[str, float], other: dict[str, Any]) -> bool:
    """Whether a variant's limit is the one that holds for the effect."""
    limit, known = told["limit_95"], other["limit_95"]
    return limit < known if key in SMALLEST else limit > known


def size_of(model: AbstractModel, candidate) -> tuple[str, str]:
    """The number that tells an effect's size, and its unit; a law of one size has a `share`."""
    known = model.laws[candidate.id].parameters
    strengths = [k for k, p in known.items() if p.linear]
    for key in strengths or (*SMALLEST, BOUND):
        if key in known:
            return key, known[key].unit
    return "share", "1"


def largest_of(model: AbstractModel, id: str, key: str) -> float:
    """The largest size that an effect's parameter may have, of either sign.

    Its own bound; of strengths that are shares, as creep and gains, no more than the `MOST_SHARE`.
    """
    known = model.laws[id].parameters.get(key)
    if known is None:
        return math.inf
    largest = max(-known.low, known.high)
    return min(largest, MOST_SHARE) if known.linear and known.unit == "1" else largest


def inflation(signatures: Signatures, score: Score, residual: np.ndarray) -> float:
    """1-sigma of a candidate's strengths over that in white noise of the assumed level.

    From the scatter of the blocks of (signature x residual), so that colour and misfit count.
    """
    starts = np.unique(np.linspace(0, len(residual), BLOCKS, endpoint=False).astype(int))
    columns = signatures.columns(signatures.layout.part(score.index))
    blocks = np.add.reduceat(columns * residual, starts, axis=1)
    left = blocks - blocks.mean(axis=1, keepdims=True)
    return max(1.0, float(np.sum(left**2, axis=1).max())) ** 0.5  # the columns have length 1


def limit_of(scan: Scan, score: Score, spread: float, key: str) -> float | None:
    """The 95 % upper limit of one candidate's size; None where its size does not follow from c."""
    part = scan.layout.part(score.index)
    values, vectors = np.linalg.eigh(scan.blocks[score.index])
    good = values > 1e-8
    root = vectors[:, good] / np.sqrt(values[good]) * spread / scan.layout.scale[part][:, None]
    if len(score.coefficients) == 1:
        c, sigma = float(score.coefficients[0]), float(np.linalg.norm(root))
        if score.candidate.allowed(np.array([-1.0])):
            strength = both_signs(c, sigma)
        else:
            strength = one_sign(c, sigma)
        return _scaled(score, key, strength)
    rng = np.random.default_rng(0)
    drawn = score.coefficients + rng.normal(size=(DRAWS, root.shape[1])) @ root.T
    return float(np.quantile(_sizes(score.candidate, key, drawn), SURE))


def _sizes(candidate, key: str, drawn: np.ndarray) -> np.ndarray:
    """Sizes (draws,) of a candidate with coefficients (draws, k)."""
    if drawn.shape[1] == 2 and is_wave(candidate.columns[0].law):  # cosine and sine: hundreds
        return np.hypot(*drawn.T)
    return np.array([np.linalg.norm(candidate.decode(c)[key]) for c in drawn])


def _scaled(score: Score, key: str, strength: float) -> float | None:
    """A strength as a size; a threshold's strength is that of one fixed size."""
    if key == "share":
        return strength
    if key == "gap":  # small gaps act in proportion; nothing follows above the one that was tried
        tried = float(score.candidate.decode(np.ones(1))[key])
        return strength * tried if strength < 1 else None
    return float(np.linalg.norm(score.candidate.decode(np.array([strength]))[key]))


def one_sign(c: float, sigma: float) -> float:
    """Limit of a strength that is not negative, estimated as `c` with 1-sigma `sigma`.

    An estimate below zero excludes no more than zero does (power-constrained limits).
    """
    return max(c, 0.0) + ONE_SIDED * sigma


def both_signs(c: float, sigma: float) -> float:
    """Limit of the size of a strength of either sign, estimated as `c` with 1-sigma `sigma`."""
    return abs(c) + ONE_SIDED * sigma
