"""Where simulation and data disagree: lines in Hz and in orders, states, against a shuffled null.

Every question is a small orthonormal set of columns over the samples of one channel: the share is
how much of the residual's power lies in them.  Lines in Hz are looked for up to half the sampling
rate; one beyond it shows at its mirror frequency, which the answer says.  Orders are looked up at
the measured angle of every sample, so the sampling rate does not fold them.

Orders and states have to beat two nulls: blocks of the residual, shuffled and given random signs,
and residuals of the same spectrum with random phases (Theiler and others, 1992), since noise that
wanders keeps its colour only in those.  Where a residual lacks what was fitted to noise it is
stationary no more, and has to beat what is left of such noise too (a parametric bootstrap: Efron,
Tibshirani, 1993).  A line in Hz has to beat its neighbours as well: noise of
any colour is smooth over frequencies, a line is not.
"""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.fft import irfft
from scipy.special import betaincc, fdtrc, stdtr
from scipy.stats import false_discovery_control

from .._orthonormal import orthonormal_of_many_rows
from .._settings import SETTINGS
from .._threads import each

SHUFFLES = SETTINGS.where.shuffles
DISCOVERY_RATE = SETTINGS.where.discovery_rate
HIGHEST_ORDER = SETTINGS.where.highest_order
NEIGHBOURS = SETTINGS.where.neighbours
BAND_WIDTH = SETTINGS.where.band_width
LEAST_COLUMN = SETTINGS.where.least_column
BINS = SETTINGS.where.bins
BLOCK_SAMPLES = SETTINGS.where.block_samples
FEWEST_BLOCKS = SETTINGS.where.fewest_blocks
SHORTEST_BLOCK = SETTINGS.where.shortest_block
END_SAMPLES = SETTINGS.where.end_samples
END_PARTS = SETTINGS.where.end_parts
LEAST_SHAPE = SETTINGS.where.least_shape
UNSURE_SHOWN = SETTINGS.where.unsure_shown
MISSED_SHARE = SETTINGS.where.missed_share
ROUNDING = SETTINGS.where.rounding
SHOWN_MOST = SETTINGS.search.shown_most


@dataclasses.dataclass(frozen=True)
class WhereQuestion:
    """One place to look: domain, value, what it refers to.

    `columns` (samples, k) are orthonormal; a band of lines in Hz has none, but `band`, its indices
    among the Fourier frequencies.
    """

    domain: str
    value: float
    reference: str
    columns: np.ndarray | None = None
    band: tuple[int, int] = (0, 0)

    @property
    def size(self) -> int:
        """Number of columns."""
        return 2 * (self.band[1] - self.band[0]) if self.columns is None else self.columns.shape[1]


def questions(
    time, angles: dict[str, np.ndarray], states: dict[str, np.ndarray]
) -> list[WhereQuestion]:
    """Bands up to half the sampling rate, orders of every angle, and bins of every state."""
    count, step = len(time), time[1] - time[0]
    width = max(1, round(BAND_WIDTH * count * step))
    out = []
    for k in range(1, (count - 1) // 2, width):
        end = min(k + width, (count - 1) // 2 + 1)
        middle = (k + end - 1) / 2 / (count * step)
        out.append(WhereQuestion("frequency", middle, "Hz", band=(k, end)))
    orders = np.arange(1, HIGHEST_ORDER + 1)
    for name, angle in angles.items():
        phase = np.outer(orders, angle)
        pairs = np.linalg.qr(np.stack([np.cos(phase), np.sin(phase)], axis=2))[0]
        out += [
            WhereQuestion("order", float(k), name, q) for k, q in zip(orders, pairs, strict=True)
        ]
    for name, values in states.items():
        out.append(state(name, bins(values)))
    return out


def state(name: str, columns: np.ndarray) -> WhereQuestion:
    """The question of a state, "speed w1" say, by orthonormal columns."""
    domain, _, reference = name.partition(" ")
    return WhereQuestion(domain, float("nan"), reference, columns)


def bins(values: np.ndarray, count: int = BINS) -> np.ndarray:
    """Membership of `count` equally filled bins, orthonormal."""
    edges = np.unique(np.quantile(values, np.linspace(0, 1, count + 1)[1:-1]))
    member = np.eye(len(edges) + 1)[np.searchsorted(edges, values)]
    member = member[:, member.any(axis=0)]
    return member / np.sqrt(member.sum(axis=0))


class Asked:
    """Questions gathered for many residuals: one product and one Fourier transform answer all."""

    def __init__(self, asked: Sequence[WhereQuestion]):
        self.questions = list(asked)
        self.plain = [q for q in asked if q.columns is not None]
        self.bands = [q for q in asked if q.columns is None]
        columns = [q.columns for q in asked if q.columns is not None]
        self.columns = np.concatenate(columns, 1).astype(np.float32) if columns else None
        self.levelled = (
            np.concatenate([of_levelled(c) for c in columns], 1).astype(np.float32)
            if columns else None
        )  # fmt: skip
        self.starts = np.cumsum([0, *(q.size for q in self.plain)])[:-1]

    def powers(self, residuals: np.ndarray, level: bool = False) -> np.ndarray:
        """Power (plain questions, m) of residuals (samples, m); `level`: of levelled ones."""
        columns = self.levelled if level else self.columns
        if columns is None:
            return np.zeros((0, residuals.shape[1]))
        inside = columns.T @ residuals.astype(np.float32)
        return np.add.reduceat(inside.astype(float) ** 2, self.starts, axis=0)

    def lines(self, residuals: np.ndarray) -> np.ndarray:
        """Power (bands, m) of residuals (samples, m)."""
        if not self.bands:
            return np.zeros((0, residuals.shape[1]))
        spectrum = np.abs(np.fft.rfft(residuals, axis=0)) ** 2 * (2 / len(residuals))
        total = np.concatenate([np.zeros((1, residuals.shape[1])), np.cumsum(spectrum, axis=0)])
        ends = np.array([q.band for q in self.bands])
        return total[ends[:, 1]] - total[ends[:, 0]]


def shares(
    residual: np.ndarray,
    asked: Sequence[WhereQuestion] | Asked,
    seed: int = 0,
    own: Sequence[WhereQuestion] = (),
    drawn: np.ndarray | None = None,
) -> list[dict[str, Any]]:
    """Share of the residual's power and its p-value for every question (1-D residual).

    `own` questions are asked of this residual alone; `drawn` (samples, m) are residuals of noise
    alone, of its likeliest colour, where these are known.
    """
    power = float(residual @ residual)
    if power == 0:
        return []
    asked, further = asked if isinstance(asked, Asked) else Asked(asked), Asked(own)
    plain = [*asked.plain, *further.plain]

    def answers(x: np.ndarray, level: bool = False) -> np.ndarray:
        return np.concatenate([asked.powers(x, level), further.powers(x, level)])

    shuffled = shuffle(residual, seed)
    level = levelled(residual)
    nulls = [(residual, shuffled, False), (level, surrogates(level, seed), True)]
    chances = []
    for first, null, without_level in nulls:
        total = max(float(first @ first), 1e-300)
        table = answers(np.concatenate([first[:, None], null], axis=1), without_level) / total
        chances.append(p_value(table[:, 0], table[:, 1:]))
    share = answers(residual[:, None])[:, 0] / power
    if drawn is not None:
        chances.append(p_value(share, answers(drawn) / np.sum(drawn**2, axis=0)))
    out = [_answer(q, x, max(p)) for q, x, *p in zip(plain, share, *chances, strict=True)]
    bands = asked.lines(np.concatenate([residual[:, None], shuffled], axis=1)) / power
    middle = np.array([q.value for q in asked.bands])
    size = np.array([q.size / 2 for q in asked.bands])
    beside = above_neighbours(middle, bands[:, 0], size)
    shuffled_p = p_value(bands[:, 0], bands[:, 1:])
    out += [
        _answer(q, x, p)
        for q, x, p in zip(asked.bands, bands[:, 0], np.maximum(shuffled_p, beside), strict=True)
    ]
    return out


def _answer(q: WhereQuestion, share: float, p: float) -> dict[str, Any]:
    return {"domain": q.domain, "value": q.value, "reference": q.reference,
            "share": float(share), "p": float(p)}  # fmt: skip


def levelled(columns: np.ndarray) -> np.ndarray:
    """Columns (samples, ..) less the straight line through their ends, and less their mean.

    Noise that wanders is then periodic.  A level says nothing: random phases leave it to chance.
    """
    n = len(columns)
    end = max(1, min(END_SAMPLES, n // END_PARTS))
    first, last = columns[:end].mean(axis=0), columns[-end:].mean(axis=0)
    level = columns - np.linspace(first, last, n)
    return level - level.mean(axis=0)


def of_levelled(columns: np.ndarray) -> np.ndarray:
    """Orthonormal columns (samples, k) of what levelling leaves of some; zero where it leaves none.

    Line and mean are nuisances of every question: what a residual loses with them its question has
    to lose too, or little of a slow wave would seem to lie in its own column.

    Source: regression beside nuisances (Frisch, Waugh, 1933; Lovell, 1963).
    """
    basis = orthonormal_of_many_rows(levelled(columns), LEAST_COLUMN)
    return np.pad(basis, ((0, 0), (0, columns.shape[1] - basis.shape[1])))


def surrogates(residual: np.ndarray, seed: int, count: int = SHUFFLES) -> np.ndarray:
    """Copies (samples, count) of the same spectrum with random phases, in single precision."""
    rng = np.random.default_rng(seed)
    lines = np.fft.rfft(residual)[:, None].astype(np.complex64)
    phases = (2 * np.pi * rng.random((len(lines), count))).astype(np.float32)
    turned = np.empty(phases.shape, np.complex64)
    np.cos(phases, out=turned.real)
    np.sin(phases, out=turned.imag)
    turned *= lines
    return np.asarray(irfft(turned, len(residual), axis=0))


def above_neighbours(middle: np.ndarray, power: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Chance that a band stands as far above a power law through the bands beside it.

    `middle` (bands,) Hz, `power` (bands,), `lines` (bands,): how many Fourier lines a band has.
    The band's direct neighbours, into which a line leaks, are left out.  Powers of noise with a
    spectrum that is smooth there are chi-square laws of two degrees a line, so that a band over
    what its neighbours lead to is an F law; of the slope's error the spread of a Student law is
    asked too where neighbours stand on one side alone.
    """
    y, out = np.log(np.maximum(power / lines, 1e-300)), np.ones(len(power))
    near = _neighbours(middle.astype(float).tobytes())
    if not len(near.band):
        return out
    own, beside, free = y[near.band], y[near.index], near.there.sum(axis=1) - 2
    slope, level = np.einsum("kab,kja,kj->bk", near.inverse, near.line, beside)
    left = np.where(near.there, beside - slope[:, None] * near.away - level[:, None], 0.0)
    spread = np.sqrt(np.sum(left**2, axis=1) / free * (1 + near.inverse[:, 1, 1]))
    student = stdtr(free, (level - own) / np.maximum(spread, 1e-12))
    count = np.where(near.there, lines[near.index], 0.0)
    over = np.exp(beside - slope[:, None] * near.away) * count
    usual = np.sum(over, axis=1) / count.sum(axis=1)
    ratio = np.exp(own) / np.maximum(usual, 1e-300)
    exact = fdtrc(2 * lines[near.band], 2 * count.sum(axis=1), ratio)
    out[near.band] = np.where(near.on_both_sides, exact, np.maximum(exact, student))
    return out


class _Neighbours(NamedTuple):
    """Bands that have enough neighbours, and straight lines through these.

    `index` holds a band's neighbours, `there` whether it has so many, `away` the log of how far off
    they are; `line` are a line's columns, `inverse` is that of their inner products.
    """

    band: np.ndarray  # (k,)
    index: np.ndarray  # (k, m)
    there: np.ndarray  # (k, m)
    away: np.ndarray  # (k, m)
    line: np.ndarray  # (k, m, 2)
    inverse: np.ndarray  # (k, 2, 2)
    on_both_sides: np.ndarray  # (k,)


@functools.lru_cache(maxsize=4)
def _neighbours(middle: bytes) -> _Neighbours:
    """Of bands at some frequencies, Hz."""
    x = np.log(np.frombuffer(middle))
    offset = np.array([j for j in range(-NEIGHBOURS - 1, NEIGHBOURS + 2) if abs(j) > 1])
    index = np.arange(len(x))[:, None] + offset
    there = (index >= 0) & (index < len(x))
    band = np.flatnonzero(there.sum(axis=1) >= NEIGHBOURS)
    there, index = there[band], np.clip(index[band], 0, max(len(x) - 1, 0))
    away = np.where(there, x[index] - x[band, None], 0.0)
    line = np.stack([away, there.astype(float)], axis=2)
    inverse = np.linalg.inv(np.swapaxes(line, 1, 2) @ line)
    return _Neighbours(band, index, there, away, line, inverse, np.logical_and.reduce(there, 1))


def shuffle(
    residual: np.ndarray, seed: int, block: int = BLOCK_SAMPLES, count: int = SHUFFLES
) -> np.ndarray:
    """Block-shuffled copies (samples, count), every block with a random sign and a random shift."""
    rng = np.random.default_rng(seed)
    n = len(residual)
    out = np.empty((n, count))
    pieces = max(1, n // min(block, max(SHORTEST_BLOCK, n // FEWEST_BLOCKS)))
    sizes = np.full(pieces, n // pieces) + (np.arange(pieces) < n % pieces)
    starts = np.cumsum(sizes) - sizes
    for c in range(count):
        shift = rng.integers(n)
        order = rng.permutation(pieces)
        signs = rng.choice([-1.0, 1.0], pieces)
        long = sizes[order]
        before = starts[order] - (np.cumsum(long) - long)  # each, less where it goes to
        at = np.arange(n) + np.repeat(before - shift, long)
        out[:, c] = np.repeat(signs[order], long) * residual[at]  # negative ones count from the end
    return out


def p_value(share: np.ndarray | float, null: np.ndarray) -> np.ndarray:
    """Probability (..) of shares (..) under nulls (.., draws); 1 where a null has no spread.

    By a beta law of each null's mean and variance.
    """
    mean, variance = np.mean(null, axis=-1), np.var(null, axis=-1, ddof=1)
    usual = (mean > 0) & (mean < 1) & (variance > 0)
    mean, variance = np.where(usual, mean, 0.5), np.where(usual, variance, 1.0)
    size = np.maximum(mean * (1 - mean) / variance - 1, LEAST_SHAPE)
    tail = betaincc(mean * size, (1 - mean) * size, np.clip(share, 0.0, 1.0))
    return np.where(usual, tail, 1.0)


def discoveries(shares: list[dict[str, Any]], rate: float = DISCOVERY_RATE) -> list[dict[str, Any]]:
    """Those that stand, with the rate of false discoveries shared by lines, orders and states.

    There are far more lines than states: asked together they would drown what hangs on a state.
    """
    kinds: dict[str, list[dict[str, Any]]] = {}
    for f in shares:
        kind = f["domain"] if f["domain"] in ("frequency", "order") else "state"
        kinds.setdefault(kind, []).append(f)
    return [f for asked in kinds.values() for f in _standing(asked, rate / len(kinds))]


def _standing(shares: list[dict[str, Any]], rate: float) -> list[dict[str, Any]]:
    """Those that stand after Benjamini and Yekutieli's control of the false-discovery rate.

    The questions overlap (an order is a line where the speed is steady), so they depend on each
    other in any way.
    """
    shares = [f for f in shares if np.isfinite(f["p"])]  # a column that is still has no chance
    if not shares:
        return []
    adjusted = false_discovery_control([f["p"] for f in shares], method="by")
    kept = [f for f, p in zip(shares, adjusted, strict=True) if p <= rate]
    return sorted(kept, key=lambda f: f["p"])


def discovered(
    time: np.ndarray,
    columns: dict[str, np.ndarray],
    angles: dict[str, np.ndarray],
    states: dict[str, np.ndarray],
    top: int = SHOWN_MOST,
    own: Mapping[str, Sequence[WhereQuestion]] | None = None,
    answers: Sequence[dict[str, Any]] = (),
    drawn: Mapping[str, np.ndarray] | None = None,
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """(the strongest discoveries, all answers) of residuals by channel, in sigma.

    `own` holds by channel the questions that are asked of it alone, `answers` what was asked
    elsewhere and stands or falls with the others, `drawn` what noise alone leaves (see `shares`).
    Every answer says whether it `stands`; where none does, the likeliest few are returned so
    marked, of the channels that are missed most: what is smooth may be large and yet like noise of
    its own colour.
    """
    asked, step = Asked(questions(time, angles, states)), time[1] - time[0]
    sizes = {label: float(np.sqrt(np.mean(column**2))) for label, column in columns.items()}
    labels = [label for label, rms in sizes.items() if rms >= ROUNDING]
    further = {label: () if own is None else own.get(label, ()) for label in labels}
    counts = [len(asked.questions) + len(x) for x in further.values()]
    seeds = dict(zip(labels, np.cumsum([0, *counts]).tolist(), strict=False))

    def answered(label: str) -> list[dict[str, Any]]:
        null = None if drawn is None else drawn.get(label)
        return [
            {"channel": label, "rms_over_noise": sizes[label], **answer,
             "mirror": 1 / step - answer["value"] if answer["domain"] == "frequency" else None,
             "stands": False}
            for answer in shares(columns[label], asked, seeds[label], further[label], null)
        ]  # fmt: skip

    everything = [answer for some in each(answered, labels) for answer in some]
    everything += [{**answer, "mirror": None, "stands": False} for answer in answers]
    stand = discoveries(everything)
    for answer in stand:
        answer["stands"] = True
    stand.sort(key=lambda f: -f["share"] * max(0.0, f["rms_over_noise"] ** 2 - 1))
    return (stand or _likeliest(everything))[:top], everything


def _likeliest(answers: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The few with the least chance, of the channels that are missed most."""
    least = MISSED_SHARE * max((f["rms_over_noise"] for f in answers), default=0.0)
    mostly = [f for f in answers if f["rms_over_noise"] >= least]
    return sorted(mostly, key=lambda f: f["p"])[:UNSURE_SHOWN]
