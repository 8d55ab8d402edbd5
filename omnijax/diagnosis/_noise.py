"""The noise that a diagnosis starts from: what is declared, held against what the data show."""

import dataclasses
from typing import Any

import numpy as np
from scipy.special import chdtri

from .._white_noise import noise_squares
from ..recording import Case, channels, noise_floor
from ._settings import SETTINGS

NOISE_FREE = {
    "dR": SETTINGS.noise.free_elastic, "a": SETTINGS.noise.free_elastic,
    "Omega": SETTINGS.noise.free_turning, "theta": SETTINGS.noise.free_angle,
}  # fmt: skip
DECLARED_ERROR = SETTINGS.noise.declared_error
AGREED_ERRORS = SETTINGS.noise.agreed_errors
UNKNOWN_ERROR = SETTINGS.noise.unknown_error
FINEST_STEP = SETTINGS.noise.finest_step
DIFFERENCE = SETTINGS.noise.difference
GUESSED_SHARE = SETTINGS.noise.guessed_share
FEWEST_LEVELS = SETTINGS.noise.fewest_levels
ROUNDING_GAP = SETTINGS.noise.rounding_gap
GRID_ERROR = SETTINGS.noise.grid_error
GRID_SHARE = SETTINGS.noise.grid_share


@dataclasses.dataclass(frozen=True)
class Assumed:
    """Noise of one channel: 1-sigma, relative error, where it is from, what was declared."""

    sigma: float
    error: float
    source: str
    declared: float | None
    colour: str = ""


def assumed_noise(case: Case) -> dict[str, Assumed]:
    """By measured channel of a case, pooled over its runs."""
    runs = case.noise_runs
    shown = noise_floor(runs, declared=False)
    out = {}
    for group, source in shown.source.items():
        names = [c for c in channels(group, runs[0].wheels) if c in shown.sigma]
        error = shown.error[group] * np.sqrt(len(names))
        for name in names:
            values = [r.channels[name] for r in runs if name in r.channels]
            values = [v[np.isfinite(v)] for v in values]
            if sum(map(len, values)) < 2:
                continue
            said = [r.declared_noise(name) for r in runs]
            told = [s for s in said if s is not None and s > 0]
            declared = float(np.sqrt(np.mean(np.square(told)))) if told else None
            out[name] = _one(name, values, shown.sigma[name], error, source, declared)
    return out


def _one(name, values, measured: float, error: float, source: str, declared) -> Assumed:
    """The assumption for one channel with `values` by run."""
    quantum = shown_step(values, _beside_steps(values, measured, declared))
    colour = "quantised" if quantum > 0 else ""
    least = quantum / np.sqrt(12)
    if measured == 0 and not colour and declared in (None, 0.0):
        size = np.sqrt(np.mean(np.concatenate(values) ** 2))
        return Assumed(float(NOISE_FREE[name.split("_")[0]] * size), 0.0, "noise-free", declared)
    known = np.isfinite(measured) and measured > least
    if not known:
        sigma, wide, how = _unmeasured(values, declared, least)
    else:
        sigma, wide, how = combined(measured, error, source, declared)
    return Assumed(sigma, wide, how, declared, colour)


def combined(
    measured: float, error: float, source: str, declared: float | None
) -> tuple[float, float, str]:
    """(1-sigma, its relative error, source) of a noise that the data show, and what was declared.

    A declaration that agrees is kept as it is; else both count by how well each is known.
    """
    if declared is None:
        return measured, error, source
    if abs(np.log(measured / declared)) < AGREED_ERRORS * error:
        return declared, min(error, DECLARED_ERROR), "declared"
    mine, theirs = error**-2, DECLARED_ERROR**-2
    mean = (mine * np.log(measured) + theirs * np.log(declared)) / (mine + theirs)
    return float(np.exp(mean)), (mine + theirs) ** -0.5, source


def _beside_steps(values, measured: float, declared: float | None) -> float:
    """The noise that steps are held against: the larger one of what is known, else a bound."""
    if np.isfinite(measured) or declared is not None:
        return float(np.nanmax([measured, declared or 0.0]))
    return _rough(values)


def _unmeasured(values, declared, least: float) -> tuple[float, float, str]:
    """Of a channel whose noise the data do not show: a declaration, the steps, or a bound."""
    if least > 0:  # a channel that rests on one step
        return float(np.hypot(max(declared or 0.0, least), least)), DECLARED_ERROR, "steps"
    if declared is not None:
        return declared, DECLARED_ERROR, "declared"
    return _upper(values), UNKNOWN_ERROR, "unknown"


def _upper(values: list[np.ndarray]) -> float:
    """An upper bound of the white noise, a share of the channel where differences show none."""
    return (
        _rough(values)
        or float(np.sqrt(np.mean(np.concatenate(values) ** 2)) * GUESSED_SHARE)
        or 1.0
    )


def _rough(values: list[np.ndarray]) -> float:
    """The quieter half of differences of a high order as a 1-sigma; 0 of a channel that stands."""
    squares = [noise_squares(v, DIFFERENCE) for v in values if len(v) > DIFFERENCE + 1]
    if not squares:
        return 0.0
    return float(np.sqrt(np.median(np.concatenate(squares)) / chdtri(1, 0.5)))


def shown_step(values: list[np.ndarray], noise: float) -> float:
    """`step_of` a channel, 0 too where a `noise` of that 1-sigma hides its steps."""
    quantum = step_of(values)
    return quantum if quantum > FINEST_STEP * noise else 0.0


def step_of(values: list[np.ndarray]) -> float:
    """The step of a quantised channel, 0 where its values lie on no grid.

    However many levels it has: an encoder that turns fast reads another one at every sample, and no
    two of them may be neighbours.
    """
    levels = np.unique(np.concatenate(values))
    if len(levels) < FEWEST_LEVELS:
        return 0.0
    gaps = np.diff(levels)
    apart = np.diff(np.unique(gaps))
    for differences in (gaps, apart):
        usable = differences[differences > ROUNDING_GAP * np.median(gaps)]
        step = float(np.min(usable, initial=np.inf))
        counts = np.round(gaps / step)
        if np.isfinite(step) and np.mean(np.abs(gaps / step - counts) < GRID_ERROR) > GRID_SHARE:
            return float(np.sum(gaps) / np.sum(counts))  # a file's digits bend a single one
    return 0.0


def by_group(assumed: dict[str, Assumed]) -> dict[str, float]:
    """1-sigma by output group: root mean square over its channels."""
    groups: dict[str, list[float]] = {}
    for name, x in assumed.items():
        groups.setdefault(name.split("_")[0], []).append(x.sigma)
    return {g: float(np.sqrt(np.mean(np.square(s)))) for g, s in groups.items()}


def run_levels(assumed: dict[str, Assumed], wheels: int) -> dict[str, np.ndarray]:
    """By group the channels' 1-sigma over that of the group, where they are not all alike."""
    out: dict[str, Any] = {}
    for group, sigma in by_group(assumed).items():
        names = channels(group, wheels)
        own = np.array([assumed[n].sigma / sigma if n in assumed else 1.0 for n in names])
        if np.ptp(own) > 1e-9:
            out[group] = own
    return out
