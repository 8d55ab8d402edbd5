"""What each candidate changes in the rows of a machine: its tangents, or itself where it has none.

A law without a linear strength, as a delay, has no tangent at nothing: its column is what it
changes at the size that is tried.
"""

from collections.abc import Sequence

import numpy as np

from ..._search import Candidate, Point, strengths


def signatures(model, point: Point, candidates: Sequence[Candidate]) -> np.ndarray:
    """Rows (columns of all candidates, train rows) in sigma; 0 where they are not finite."""
    theta, thetas, ways, finite = model.numbers.vector(point), [], [], []
    for candidate in candidates:
        slot = model.numbers.slot_beside(point, candidate.id, candidate.place)
        for placed in candidate.columns:
            here, way = theta.copy(), np.zeros_like(theta)
            here[slot.begin] = 1.0
            for key, p in slot.law.parameters.items():
                value = np.asarray(getattr(placed.law, key), float)
                if p.linear:
                    way[slot.part(key)] = value
                here[slot.part(key)] = 0.0 if p.linear else value
            finite.append(not strengths(slot.law))
            thetas.append(here)
            ways.append(way)
    thetas, ways, finite = np.stack(thetas), np.stack(ways), np.array(finite)
    which, evaluation = model.measured.splits["train"], model.evaluation
    out = np.zeros((len(thetas), model.measured.count("train")))
    if (~finite).any():
        table = evaluation.tangents(thetas[~finite], ways[~finite], which)
        out[~finite] = -model.whitened(table, "train")
    if finite.any():
        base = evaluation.values(theta[None], which)
        table = base - evaluation.values(thetas[finite], which)
        out[finite] = model.whitened(table, "train")
    out[~np.all(np.abs(out) < 1e100, axis=1)] = 0.0
    return out
