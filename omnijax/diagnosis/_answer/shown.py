"""The noise that the data show once all that is known is in, beside what was declared."""

import dataclasses
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..._text import listed
from .._search import Level, Point, levels
from .._settings import SETTINGS
from .evidence import AbstractEvidence

SEARCH_AGAIN = SETTINGS.shown.search_again
STRUCTURE_POWER = SETTINGS.shown.structure_power
LEVEL_SHARE = SETTINGS.shown.level_share
LEVEL_ERRORS = SETTINGS.shown.level_errors
TOLD_ERRORS = SETTINGS.shown.told_errors


@dataclasses.dataclass(frozen=True)
class Shown:
    """`levels` by run and channel, and by channel the power of what hangs on the machine's state.

    A power is that of the largest discovery, over the noise's (channels without any: 0), in the
    held-out runs: `structure`, and in the `fitted` ones that were asked.  `where` holds the
    discoveries of the former and all answers behind them.  Of `bounded` channels, where a gap is
    left, the level is an upper bound: fast parts of the gap count in it.  Where `granted`, all this
    is of a point within the errors of the fit, and without that more than noise is left.
    """

    levels: tuple[dict[str, Level], ...]
    splits: tuple[str, ...]
    structure: dict[str, float]
    where: tuple[list[dict[str, Any]], list[dict[str, Any]]]
    bounded: frozenset[str] = frozenset()
    fitted: dict[str, float] = dataclasses.field(default_factory=dict)
    granted: bool = False

    @property
    def structured(self) -> list[str]:
        """Channels in which more than the noise hangs on the machine's state in held-out runs."""
        return [c for c, power in self.structure.items() if power > STRUCTURE_POWER]

    @property
    def structured_in_fitted_runs(self) -> list[str]:
        """The same in fitted runs."""
        return [c for c, power in self.fitted.items() if power > STRUCTURE_POWER]

    def ratio(self, channel: str, split: str | None = None) -> float:
        """1-sigma of a channel over the assumed one, RMS over a split's samples (None: all)."""
        return self._rms(channel, split, lambda _split, _run: 1.0)

    def sigma(self, evidence: AbstractEvidence, channel: str, split: str | None = None) -> float:
        """The same in the channel's unit; runs may be assumed to have noise of their own."""
        return self._rms(channel, split, lambda of, run: evidence.sigma(channel, of, run))

    def _rms(self, channel: str, split: str | None, assumed: Callable[[str, int], float]) -> float:
        """RMS over samples of a channel's levels times the noise assumed of a run (split, number).

        Where no level is known it is as assumed.
        """
        number: Counter[str] = Counter()
        squares, counts = [], []
        for of, run in zip(self.splits, self.levels, strict=True):
            if channel in run and split in (None, of):
                ratio = run[channel].ratio
                known = ratio if np.isfinite(ratio) else 1.0
                squares.append((known * assumed(of, number[of])) ** 2)
                counts.append(run[channel].samples)
            number[of] += 1
        if not any(counts):
            return assumed(split or "held-out", 0)
        return float(np.sqrt(np.average(squares, weights=counts)))

    @property
    def changes(self) -> list[dict[str, Level]]:
        """By run the channels whose assumed noise is wrong by more than chance, or has a colour."""
        return [
            {c: x for c, x in run.items()
             if wrong(x) and not (c in self.bounded and x.ratio > 1)}
            for run in self.levels
        ]  # fmt: skip

    @property
    def matters(self) -> bool:
        """Whether the assumed noise is so wrong that a search hangs on it."""
        return any(
            x.colour != "white" or abs(np.log(x.ratio)) > SEARCH_AGAIN
            for run in self.changes for x in run.values()
        )  # fmt: skip

    @property
    def coloured(self) -> bool:
        """Whether some channel's noise would have a colour."""
        return any(x.colour != "white" for run in self.changes for x in run.values())

    def refuted(self) -> "Shown":
        """The same where what looked like noise of a colour is none: there only the white part is.

        Candidates that explain much of it although it is weighed as such noise say so.
        """
        levels = tuple(
            {c: x if x.colour == "white" else x.white(x.floor) for c, x in run.items()}
            for run in self.levels
        )  # fmt: skip
        coloured = {c for run in self.levels for c, x in run.items() if x.colour != "white"}
        structure = self.structure | dict.fromkeys(coloured, np.inf)
        return dataclasses.replace(self, levels=levels, structure=structure)


def wrong(level: Level) -> bool:
    """Whether a level is not the assumed one."""
    if not np.isfinite(level.ratio) or level.ratio <= 0:
        return False
    far = abs(np.log(level.ratio))
    return level.colour != "white" or far > max(LEVEL_SHARE, LEVEL_ERRORS * level.error)


class Left(NamedTuple):
    """Residuals of one run by channel: which run of which split, in the order of `columns`."""

    split: str
    number: int
    channels: dict[str, np.ndarray]


def _runs(evidence: AbstractEvidence, point: Point) -> list[Left]:
    """What a point leaves of every run."""
    return [
        Left(split, k, channels) for split in ("train", "held-out")
        for k, channels in enumerate(
            evidence.columns(evidence.model.residuals([point], split)[0], split)
        )
    ]  # fmt: skip


def white_levels(evidence: AbstractEvidence, point: Point) -> list[dict[str, tuple[Level, float]]]:
    """By run and channel the level of the white part and the RMS: what needs no right model."""
    return [
        {c: (levels([x], False)[0], float(np.sqrt(np.nanmean(x**2))))
         for c, x in run.channels.items()}
        for run in _runs(evidence, point)
    ]  # fmt: skip


def shown_noise(evidence: AbstractEvidence, point: Point) -> Shown:
    """The noise at a point: all of a channel in which nothing hangs on the machine's state.

    Nor in a channel that moves with it: an effect that shows in one of them shows in all, and how
    much of what is left is noise cannot be told before it is explained.  Asked are the first
    held-out run and, where the evidence `asks_all`, every fitted one that holds more than white
    noise: what it alone excites is none.
    """
    runs = _runs(evidence, point)
    steps = [*evidence.steps("train"), *evidence.steps("held-out")]
    names = list(dict.fromkeys(c for run in runs for c in run.channels))
    standing: list[Standing | None] = [None] * len(runs)
    where: tuple[list[dict[str, Any]], list[dict[str, Any]]] = [], []
    for k, run in enumerate(runs):
        if run.split == "held-out" and run.number == 0:
            where = evidence.locate(point)
            standing[k] = Standing.of(where[1], run.channels)
        elif run.split == "train" and evidence.asks_all and _more_than_white(run.channels):
            evidence.model.tell(f"looking where the gap of fitted run {run.number + 1} is")
            answers = evidence.locate(point, run.split, run.number)[1]
            standing[k] = Standing.of(answers, run.channels)
    by_split = {
        split: {c: max((x.power.get(c, 0.0) for x, run in zip(standing, runs, strict=True)
                        if x is not None and run.split == split), default=0.0) for c in names}
        for split in ("train", "held-out")
    }  # fmt: skip
    moved = {
        evidence.subsystem(c) for structure in by_split.values()
        for c, power in structure.items() if power > STRUCTURE_POWER
    }  # fmt: skip
    table: list[dict[str, Level]] = [{} for _ in runs]
    for channel in names:
        have = [k for k, run in enumerate(runs) if channel in run.channels]
        noise_only = evidence.subsystem(channel) not in moved
        least = min((x.beside.get(channel, np.inf) for x in standing if x), default=np.inf)
        own_steps = [steps[k] for k in have] if steps else []
        entry = levels([runs[k].channels[channel] for k in have], noise_only, own_steps)
        for k, level in zip(have, entry, strict=True):
            own = standing[k]
            most = least if own is None else own.beside.get(channel, np.inf)
            table[k][channel] = level if noise_only else _beside(level, most)
    bounded = frozenset(c for c in names if evidence.subsystem(c) in moved)
    told = evidence.beside_starts(point) if len(bounded) < len(names) else []
    for own, levels_beside in zip(table, told, strict=False):
        own |= {c: x for c, x in levels_beside.items() if c in own and c not in bounded}
    return Shown(tuple(table), tuple(run.split for run in runs), by_split["held-out"], where,
                 bounded, by_split["train"])  # fmt: skip


class Standing(NamedTuple):
    """What stands of where the gap of one run is, by channel: the `power` of the largest discovery
    over the noise's, and the RMS `beside` it, in assumed sigma."""

    power: dict[str, float]
    beside: dict[str, float]

    @classmethod
    def of(cls, answers: Sequence[dict[str, Any]], channels: dict[str, np.ndarray]) -> "Standing":
        """From all answers of a run and its residuals by channel."""
        power, beside = {}, {}
        for entry in answers:
            c, rms = entry["channel"], entry["rms_over_noise"]
            if entry["stands"] and c in channels:
                floor = min(levels([channels[c]], False)[0].ratio, rms)
                over = entry["share"] * (rms / max(floor, 1e-12)) ** 2
                power[c] = max(power.get(c, 0.0), over)
                left = rms * np.sqrt(max(0.0, 1 - entry["share"]))
                beside[c] = min(beside.get(c, np.inf), float(left))
        return cls(power, beside)


def _more_than_white(channels: dict[str, np.ndarray]) -> bool:
    """Whether some channel holds as much beside its white part as counts as structure."""
    most = float(np.sqrt(1 + STRUCTURE_POWER))
    return any(
        np.sqrt(np.nanmean(x**2)) > most * levels([x], False)[0].ratio for x in channels.values()
    )


def _beside(level: Level, most: float) -> Level:
    """The level of a white part, but no more than what a discovery leaves of a channel, `most`.

    Where noise was weighed by a spectrum that holds the discovery, differences of a high order see
    no less than that.
    """
    if not 0 < most < level.ratio / (1 + SEARCH_AGAIN):
        return level
    return level.white(most)


def noise_table(
    evidence: AbstractEvidence, shown: Shown, earlier: Shown | None = None
) -> dict[str, dict[str, Any]]:
    """By channel what was declared, what the data show with its 1-sigma, and the colour.

    What an `earlier` look found coloured is whitened since.  `at_most`: a gap is left in the
    channel or in one that moves with it, so that what is shown is an upper bound.
    """
    out = {}
    for channel in shown.structure:
        assumed = evidence.assumed(channel)
        own = [run[channel] for run in shown.levels if channel in run]
        value = shown.sigma(evidence, channel)
        error = value * float(np.sqrt(np.mean([x.error**2 for x in own]) / len(own)))
        first = (
            [] if earlier is None else [run[channel] for run in earlier.levels if channel in run]
        )
        colours = [x.colour for x in (*first, *own) if x.colour != "white"]
        out[channel] = {
            "declared": assumed["declared"], "shown": value, "sigma": error,
            "at_most": channel in shown.bounded,
            "colour": assumed.get("colour") or (colours[0] if colours else "white"),
            "unit": assumed["unit"], "source": assumed["source"],
        }  # fmt: skip
    return out


def noise_remarks(table: dict[str, dict[str, Any]]) -> list[str]:
    """Where declared and shown noise differ, or the noise is not white, in sentences.

    An upper bound above what was declared says nothing against it.
    """
    said, most = [], []
    for channel, x in table.items():
        d, s, bound = x["declared"], x["shown"], x["at_most"]
        if (
            d
            and abs(np.log(s / d)) > max(LEVEL_SHARE, TOLD_ERRORS * x["sigma"] / s)
            and (s < d or not bound)
        ):
            shown = f"shown {'at most ' if bound else ''}{s:.3g} {x['unit']}"
            said.append(f"{channel}: declared {d:.3g} {x['unit']}, {shown}")
        elif bound:
            most.append(channel)
    lines = [f"The data show another noise than was declared ({'; '.join(said)})."] if said else []
    if most:
        lines.append(
            f"Beside what no named effect explains the noise of {listed(most)} is known to its "
            "upper bound alone."
        )
    coloured = [f"{c} ({x['colour']})" for c, x in table.items() if x["colour"] != "white"]
    if coloured:
        lines.append(f"Not white, and weighed as it is: the noise of {', '.join(coloured)}.")
    unsure = sorted({c.split("_")[0] for c, x in table.items() if x["source"] == "unknown"})
    if unsure:
        lines.append(
            f"The noise of {', '.join(unsure)} could not be known beforehand (no rest, no repeats, "
            "no quiet stretch, none declared): its level is what the model leaves, so an effect "
            "that looks like noise there is not seen."
        )
    return lines


def by_group(channels: Sequence[str]) -> dict[str, list[str]]:
    """Channels by output group."""
    out: dict[str, list[str]] = {}
    for channel in channels:
        out.setdefault(channel.split("_")[0], []).append(channel)
    return out
