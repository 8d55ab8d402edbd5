"""Tangent scores: what each candidate would explain once the baseline has its share."""

import contextlib
import dataclasses
import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.special import chdtrc

from .._settings import SETTINGS
from .._threads import each

COLUMN_PRICE = SETTINGS.search.column_price
PIECE = 32  # columns that are worked on together


def chance(gain: float, columns: int) -> float:
    """Probability of such a gain in `columns` directions of white noise."""
    return float(chdtrc(max(1, columns), max(gain, 0.0)))


@dataclasses.dataclass(frozen=True)
class Score:
    """One candidate's score test: gain in chi2, its degrees of freedom, coefficients.

    `dead`: the candidate changes no measured channel.  `allowed`: its sign is physical.  `spread`:
    chi2 a degree of freedom of the residual, at least 1.
    """

    index: int
    candidate: Any
    gain: float
    columns: int
    coefficients: np.ndarray
    dead: bool
    allowed: bool
    spread: float = 1.0

    @property
    def p(self) -> float:
        """Probability of such a gain without the effect, its trials counted (Sidak)."""
        one = chance(self.gain / self.spread, self.columns)
        return float(-np.expm1(self.candidate.trials * np.log1p(-min(one, 1 - 1e-16))))

    @property
    def merit(self) -> float:
        """Gain less the price of the columns."""
        return self.gain - COLUMN_PRICE * self.columns


@dataclasses.dataclass(frozen=True)
class SignatureLayout:
    """Which columns of a table of signatures are whose, and how long they were."""

    candidates: list
    scale: np.ndarray

    @functools.cached_property
    def ends(self) -> np.ndarray:
        """Where every candidate's columns begin, and where the last one's end."""
        return np.cumsum([0, *(len(c.columns) for c in self.candidates)])

    def part(self, i: int) -> slice:
        """The columns of candidate `i`."""
        return slice(self.ends[i], self.ends[i + 1])


class Signatures:
    """Signature columns of all candidates, scaled to length 1.

    The table (columns, rows) is kept and scaled in place: it is large, and may be of single
    precision.  All products with it are of double precision, piece by piece: a product that BLAS
    parts among its threads ends on other last bits with every number of cores.  Its scans do not
    hold it, but the inner products of every candidate's own columns (all with all would cost more
    than the signatures themselves).
    """

    def __init__(self, candidates: Sequence, table: np.ndarray):
        self.table = table
        size = np.sqrt(np.concatenate([np.einsum("kr,kr->k", x, x) for x in self.pieces()]))
        self.layout = SignatureLayout(list(candidates), np.where(size > 0, size, 1.0))
        self.table /= self.layout.scale[:, None]
        self.blocks = self.blocks_within(slice(None))

    def blocks_within(self, rows: np.ndarray | slice) -> list[np.ndarray]:
        """By candidate the inner products of its columns over some rows."""
        parts = map(self.layout.part, range(len(self.layout.candidates)))
        return [x @ x.T for x in (self.columns(part)[:, rows] for part in parts)]

    @contextlib.contextmanager
    def replaced(self, tables: Mapping[int, np.ndarray]) -> Iterator[None]:
        """Other columns (k, rows) in place of candidates' own, for the scans of a block."""
        layout, blocks = self.layout, self.blocks
        own = {i: self.table[layout.part(i)].copy() for i in tables}
        self.layout = SignatureLayout(layout.candidates, layout.scale.copy())
        self.blocks = list(blocks)
        for i, columns in tables.items():
            part, size = layout.part(i), np.linalg.norm(columns, axis=1)
            self.layout.scale[part] = np.where(size > 0, size, 1.0)
            self.table[part] = columns / self.layout.scale[part][:, None]
            x = self.columns(part)
            self.blocks[i] = x @ x.T
        try:
            yield
        finally:
            self.layout, self.blocks = layout, blocks
            for i, columns in own.items():
                self.table[layout.part(i)] = columns

    def columns(self, part: slice) -> np.ndarray:
        """Some columns (k, rows) in double precision."""
        return self.table[part].astype(float, copy=False)

    def pieces(self) -> Iterator[np.ndarray]:
        """The columns in double precision, few at a time."""
        return map(self.columns, self._parts())

    def _parts(self) -> list[slice]:
        count = max(1, len(self.table))
        return [slice(a, a + PIECE) for a in range(0, count, PIECE)]

    def times(self, x: np.ndarray) -> np.ndarray:
        """Inner products (columns, k) with the columns of `x` (rows, k)."""
        return np.concatenate(each(lambda part: self.columns(part) @ x, self._parts()))

    def scan_within(self, rows: np.ndarray, residual, J, u) -> "Scan":
        """Score every candidate by some rows alone, a mask, beside the tangents `J` there."""
        taken = taken_up(J * rows[:, None], len(u))
        return self.scan(residual * rows, taken, u, blocks=self.blocks_within(rows))

    def scan(self, residual, taken, u, scrambled=(), spread: float = 1.0,
             about: str | None = None, blocks: Sequence[np.ndarray] = (),
             again: Callable[[list[Score]], list[Score]] | None = None) -> "Scan":  # fmt: skip
        """Score every candidate against `residual` beside what the tangents have `taken_up`.

        The tangents with priors stand at `u`.  `scrambled` residuals score the decoys.  Angles are
        known between all candidates and the best one, and the best one named `about`.  `blocks` are
        the inner products of every candidate's columns, by default over all rows.  `again` makes
        the scan's scores of those.
        """
        top = taken[: len(residual)]
        rest = np.concatenate([residual, u])
        inner = self.times(np.column_stack([top, residual, *scrambled]))
        inside, plain, *mixed = np.split(inner, np.arange(top.shape[1], inner.shape[1]), axis=1)
        right = plain[:, 0] - inside @ (taken.T @ rest)
        wrong = [m[:, 0] - inside @ (top.T @ x) for m, x in zip(mixed, scrambled, strict=True)]
        own = [inside[self.layout.part(i)] for i in range(len(self.blocks))]
        blocks = [b - x @ x.T for b, x in zip(blocks or self.blocks, own, strict=True)]
        decoys = [Scan(self.layout, blocks, x) for x in wrong]
        best = max((s.merit for d in decoys for s in d.scores if s.allowed), default=0.0)
        scan = Scan(self.layout, blocks, right, best, max(1.0, spread), again)
        named = [s for s in scan.order if s.candidate.name == about]
        for score in (*scan.best_per_name()[:1], *named[:1]):
            part = self.layout.part(score.index)
            with_all = self.times(self.columns(part).T).T
            scan.towards[score.index] = with_all - inside[part] @ inside.T
        return scan


def taken_up(J: np.ndarray, priors: int) -> np.ndarray:
    """Orthonormal directions (rows + priors, k) along which the tangents `J` take up what is left.

    The first `priors` tangents have a unit prior: a row each, below those of the data.
    """
    k = J.shape[1]
    prior = np.zeros((priors, k))
    prior[:, :priors] = np.eye(priors)
    tall = np.concatenate([J, prior])
    if k == 0:
        return tall
    scale = np.linalg.norm(tall, axis=0)
    left, values, _ = np.linalg.svd(tall / np.where(scale > 0, scale, 1.0), full_matrices=False)
    return left[:, values > 1e-9 * values[0]]


def beside_taken(residual: np.ndarray, taken: np.ndarray, u: np.ndarray) -> np.ndarray:
    """What is left (rows,) of a residual beside all that the tangents could take up.

    A fit leaves more where a number that takes it up stands at the end of its range.
    """
    top = taken[: len(residual)]
    return residual - top @ (taken.T @ np.concatenate([residual, u]))


class Scan:
    """Scores of all candidates, best first, and the angles between their projected signatures.

    `blocks` holds by candidate the inner products of its projected columns, `towards` by candidate
    those of its columns with all columns.
    """

    def __init__(
        self, layout: SignatureLayout, blocks, right, decoy: float = 0.0, spread: float = 1.0,
        again: Callable[[list[Score]], list[Score]] | None = None,
    ):  # fmt: skip
        self.layout, self.blocks, self.right, self.decoy = layout, blocks, right, decoy
        self.spread = spread
        self.towards: dict[int, np.ndarray] = {}
        scores = [self._score(i) for i in range(len(layout.candidates))]
        self.scores = scores if again is None else again(scores)
        self.order = sorted(self.scores, key=lambda s: -s.merit)

    def _whitener(self, i: int) -> np.ndarray:
        values, vectors = np.linalg.eigh(self.blocks[i])
        good = values > 1e-8
        return vectors[:, good] / np.sqrt(values[good])

    def _score(self, i: int) -> Score:
        part, w = self.layout.part(i), self._whitener(i)
        inside = w.T @ self.right[part]
        coefficients = (w @ inside) / self.layout.scale[part]
        candidate = self.layout.candidates[i]
        dead = w.shape[1] == 0
        allowed = not dead and candidate.allowed(coefficients)
        gain = float(inside @ inside)
        return Score(i, candidate, gain, w.shape[1], coefficients, dead, allowed, self.spread)

    def cosine(self, a: int, b: int) -> float:
        """Cosine of the smallest angle between two candidates' projected signatures.

        `a` is one of `towards`.
        """
        wa, wb = self._whitener(a), self._whitener(b)
        if wa.shape[1] == 0 or wb.shape[1] == 0:
            return 0.0
        inner = wa.T @ self.towards[a][:, self.layout.part(b)] @ wb
        return float(min(1.0, np.linalg.svd(inner, compute_uv=False)[0]))

    def best_per_name(self) -> list[Score]:
        """The best allowed variant of every (id, place), best first."""
        seen: dict[str, Score] = {}
        for score in self.order:
            if score.allowed and score.candidate.name not in seen:
                seen[score.candidate.name] = score
        return list(seen.values())
