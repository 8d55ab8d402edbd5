"""What the held-out runs leave unexplained at every size of a named effect."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from .._search import Effect, Point, size_keys
from .._settings import SETTINGS
from .evidence import AbstractEvidence
from .gap import in_units
from .result import Diagnosis
from .shown import by_group

SHARES = SETTINGS.sizes.shares


@dataclasses.dataclass(frozen=True)
class SizedEffect:
    """One named effect as its size changes.

    `shares` (n,) of the found size rise from 0; `column` (n,) says which residual belongs to each.
    `size` is the found size in `unit`, None for a law that only is there or not (`shares` 0, 1).
    """

    name: str
    size: float | None
    unit: str
    shares: tuple[float, ...]
    column: tuple[int, ...]


@dataclasses.dataclass(frozen=True)
class ResidualTrace:
    """The residuals (k, n) of the channel that an effect changes most, at `time` (n,) in s."""

    channel: str
    unit: str
    time: np.ndarray
    values: np.ndarray


@dataclasses.dataclass(frozen=True)
class Sizes:
    """Residuals of the held-out runs at sizes of every named effect, the others as found.

    `gram` holds by output group (k, k): the mean of the product of two residuals, so that c G c
    is the mean square of the combination c of residuals, in `units` squared.  `floor` is the
    noise.  `traces` holds one for each effect, of the held-out run `run`.
    """

    effects: tuple[SizedEffect, ...]
    as_named: int
    gram: dict[str, np.ndarray]
    units: dict[str, str]
    floor: dict[str, float]
    run: str
    traces: tuple[ResidualTrace, ...]


def effect_sizes_on_held_out(diagnosis: Diagnosis) -> Sizes | None:
    """`Sizes` of a named diagnosis; None where nothing is named."""
    if diagnosis.verdict != "named" or not diagnosis.details:
        return None
    evidence: AbstractEvidence = diagnosis.details["evidence"]
    point: Point = diagnosis.details["found"].fit.point
    points, effects = [point], []
    for i, effect in enumerate(point.effects):
        size, unit, keys = _size(evidence, effect)
        shares = tuple(sorted((0.0, 1.0, *(SHARES if keys else ()))))
        at = []
        for share in shares:
            at.append(0 if share == 1.0 else len(points))
            if share != 1.0:
                points.append(_resized(point, i, keys, share))
        effects.append(SizedEffect(effect.name, size, unit, shares, tuple(at)))
    residuals = evidence.model.residuals(points, "held-out")
    gram = _gram(evidence, residuals)
    parts = [evidence.series(r) for r in residuals]
    traces = tuple(_trace(evidence, parts, e.column[0]) for e in effects)
    return Sizes(
        tuple(effects), 0, gram, {g: diagnosis.gap[g].unit for g in gram},
        {g: diagnosis.gap[g].noise_floor for g in gram}, parts[0][0], traces,
    )  # fmt: skip


def _size(evidence: AbstractEvidence, effect: Effect) -> tuple[float | None, str, tuple[str, ...]]:
    """An effect's size, its unit, and the numbers that grow with it."""
    known = evidence.model.laws[effect.id].parameters
    keys = size_keys(evidence.model.laws, effect)
    if not keys:
        return None, "", ()
    value = np.asarray(effect.values[keys[0]], float)
    size = float(value) if value.ndim == 0 else float(np.linalg.norm(value))
    return size, evidence.unit(known[keys[0]].unit, effect.place, keys[0]), keys


def _resized(point: Point, i: int, keys: Sequence[str], share: float) -> Point:
    """`point` with effect `i` at a share of its size; without it at 0."""
    effects = list(point.effects)
    if share == 0:
        return point.without(i)
    values = effects[i].values
    scaled = {k: share * np.asarray(values[k]) for k in keys}
    plain = {k: float(v) if v.ndim == 0 else v for k, v in scaled.items()}
    effects[i] = dataclasses.replace(effects[i], values={**values, **plain})
    return point.with_effects(*effects)


def _gram(evidence: AbstractEvidence, residuals: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
    """By group the mean products of the residuals, as `gaps` takes its RMS: over its channels."""
    each = [in_units(evidence, evidence.columns(r, "held-out")) for r in residuals]
    channels = list(dict.fromkeys(c for run in each[0] for c in run))
    out = {}
    for group, own in by_group(channels).items():
        total = np.zeros((len(each), len(each)))
        for channel in own:
            have = [i for i, run in enumerate(each[0]) if channel in run]
            table = np.stack([np.concatenate([runs[i][channel] for i in have]) for runs in each])
            table = table[:, np.isfinite(table).all(axis=0)]
            total += (table @ table.T) / max(1, table.shape[1])
        out[group] = total / len(own)
    return out


POINTS = 700  # of the trace
KEPT_POWER = SETTINGS.sizes.kept_power


def _trace(evidence: AbstractEvidence, parts: Sequence[Any], without: int) -> ResidualTrace:
    """The channel that changes most from residual `without` to the found one, in few points.

    Means over blocks of samples where these still show what changes, else the stretch of samples
    in which most changes.
    """
    _, time, last = parts[0]
    change = {c: np.nan_to_num(parts[without][2][c] - x) for c, x in last.items()}
    channel = max(change, key=lambda c: float(change[c] @ change[c]))
    unit, sigma = evidence.assumed(channel)["unit"], evidence.sigma(channel, "held-out", 0)
    table = sigma * np.stack([np.nan_to_num(x[channel]) for _, _, x in parts])
    block = -(-len(time) // POINTS)
    whole = len(time) // block * block
    means = table[:, :whole].reshape(len(table), -1, block).mean(axis=2)
    moved, kept = table[0] - table[without], block * np.sum((means[0] - means[without]) ** 2)
    if kept >= KEPT_POWER * float(moved @ moved):
        times = time[:whole].reshape(-1, block).mean(axis=1)
        return ResidualTrace(channel, unit, times, means)
    power = np.concatenate([[0.0], np.cumsum(moved**2)])
    start = int(np.argmax(power[POINTS:] - power[:-POINTS])) if len(time) > POINTS else 0
    part = slice(start, start + POINTS)
    return ResidualTrace(channel, unit, time[part], table[:, part])
