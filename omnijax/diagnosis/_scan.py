"""Tangent scores: what each candidate would explain once the baseline has its share."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import chi2 as chi2_law


@dataclasses.dataclass(frozen=True)
class Score:
    """One candidate's score test: gain in chi2, its degrees of freedom, coefficients.

    `dead`: the candidate changes no measured channel.  `allowed`: its sign is physical.
    """

    index: int
    candidate: Any
    gain: float
    columns: int
    coefficients: np.ndarray
    dead: bool
    allowed: bool

    @property
    def p(self) -> float:
        """Probability of such a gain without the effect (chi-square, one trial)."""
        return float(chi2_law.sf(self.gain, max(1, self.columns)))


class Signatures:
    """Stacked signature columns of all candidates, and their inner products."""

    def __init__(self, candidates: Sequence, columns: Sequence[np.ndarray]):
        self.candidates = list(candidates)
        widths = [x.shape[1] for x in columns]
        self.ends = np.cumsum([0, *widths])
        self.matrix = np.concatenate(columns, axis=1)
        size = np.linalg.norm(self.matrix, axis=0)
        self.scale = np.where(size > 0, size, 1.0)
        self.matrix /= self.scale
        self.gram = self.matrix.T @ self.matrix

    def scan(self, residual, J, priors: int, u) -> "Scan":
        """Score every candidate against `residual` with the tangents `J` projected out.

        The first `priors` tangents have a unit prior about 0 and stand at `u`.
        """
        k = J.shape[1]
        prior = np.zeros((priors, k))
        prior[:, :priors] = np.eye(priors)
        tall = np.concatenate([J, prior])
        scale = np.linalg.norm(tall, axis=0)
        q = _basis(tall / np.where(scale > 0, scale, 1.0)) if k else tall
        top = q[: len(residual)]
        rest = np.concatenate([residual, u])
        inside = top.T @ self.matrix
        gram = self.gram - inside.T @ inside
        right = self.matrix.T @ residual - inside.T @ (q.T @ rest)
        return Scan(self, gram, right)


def _basis(tall):
    left, values, _ = np.linalg.svd(tall, full_matrices=False)
    return left[:, values > 1e-9 * values[0]]


class Scan:
    """Scores of all candidates, best first, and the angles between their projected signatures."""

    def __init__(self, signatures: Signatures, gram, right):
        self.signatures, self.gram, self.right = signatures, gram, right
        self.scores = [self._score(i) for i in range(len(signatures.candidates))]
        # half of N log N a column: what a free number is worth in a set of 1e5 samples
        self.order = sorted(self.scores, key=lambda s: -(s.gain - 12.0 * s.columns))

    def _part(self, i: int) -> slice:
        return slice(self.signatures.ends[i], self.signatures.ends[i + 1])

    def _whitener(self, i: int) -> np.ndarray:
        values, vectors = np.linalg.eigh(self.gram[self._part(i), self._part(i)])
        good = values > 1e-8
        return vectors[:, good] / np.sqrt(values[good])

    def _score(self, i: int) -> Score:
        part, w = self._part(i), self._whitener(i)
        inside = w.T @ self.right[part]
        coefficients = (w @ inside) / self.signatures.scale[part]
        candidate = self.signatures.candidates[i]
        dead = w.shape[1] == 0
        allowed = not dead and candidate.allowed(coefficients)
        gain = float(inside @ inside)
        return Score(i, candidate, gain, w.shape[1], coefficients, dead, allowed)

    def cosine(self, a: int, b: int) -> float:
        """Cosine of the smallest angle between two candidates' projected signatures."""
        wa, wb = self._whitener(a), self._whitener(b)
        if wa.shape[1] == 0 or wb.shape[1] == 0:
            return 0.0
        inner = wa.T @ self.gram[self._part(a), self._part(b)] @ wb
        return float(min(1.0, np.linalg.svd(inner, compute_uv=False)[0]))

    def best_per_name(self) -> list[Score]:
        """The best allowed variant of every (id, place), best first."""
        seen: dict[str, Score] = {}
        for score in self.order:
            if score.allowed and score.candidate.name not in seen:
                seen[score.candidate.name] = score
        return list(seen.values())
