"""Which laws of the library come nearest to what a learned term does."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..._orthonormal import orthonormal_of_many_rows
from ..._search import AbstractModel, Point, Score
from ..._settings import SETTINGS

NEAR_LAWS = SETTINGS.answer_learned.near_laws
NEAREST = SETTINGS.answer_learned.nearest
NEAR_COSINE = SETTINGS.answer_learned.near_cosine


@dataclasses.dataclass(frozen=True)
class NearLaw:
    """A law of the library, as large as it comes nearest to what a term does.

    `cosine` is that of the changes which both make beside the baseline, `curve` (x, y) is drawn.
    """

    id: str
    place: str
    values: dict[str, Any]
    cosine: float
    curve: tuple[np.ndarray, np.ndarray] | None = None

    def table(self) -> dict[str, Any]:
        """Numbers for diagnosis.json."""
        return {"id": self.id, "place": self.place, "parameters": self.values,
                "cosine": self.cosine}  # fmt: skip


def near_laws(
    model: AbstractModel, point: Point, tangents: np.ndarray, change: np.ndarray,
    scores: Sequence[Score],
) -> list[NearLaw]:  # fmt: skip
    """The laws nearest to a `change` of the fitted runs' rows, nearest first.

    Of the candidates among `scores` that explain most there, beside what the `tangents`
    (rows, numbers) of the baseline can.
    """
    live = sorted((s for s in scores if not s.dead), key=lambda s: -s.gain)
    some = [s.candidate for s in live[:NEAR_LAWS]]
    if not some:
        return []
    known = orthonormal_of_many_rows(tangents)
    done = change - known @ (known.T @ change)
    table = np.asarray(model.columns(point, some), float)
    ends, out = np.cumsum([0, *(len(c.columns) for c in some)]), []
    for candidate, first, last in zip(some, ends, ends[1:], strict=False):
        A = table[first:last].T
        A = A - known @ (known.T @ A)
        sizes = np.linalg.lstsq(A, done, rcond=None)[0]
        cosine = float(np.linalg.norm(A @ sizes) / max(np.linalg.norm(done), 1e-300))
        if cosine > NEAR_COSINE and candidate.allowed(sizes):
            values = {k: np.asarray(v).tolist() for k, v in candidate.decode(sizes).items()}
            out.append(NearLaw(candidate.id, candidate.place, values, cosine))
    return sorted(out, key=lambda x: -x.cosine)[:NEAREST]
