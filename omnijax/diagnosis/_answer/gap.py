"""The gap: what is left between measured and predicted, by output group, against the noise."""

import numpy as np

from .result import Gap

UNITS = {"dR": "m", "theta": "rad", "Omega": "rad/s", "a": "m/s^2"}


def group_squares(rows_list, residual: np.ndarray) -> dict[str, tuple[float, float]]:
    """Whitened (sum of squares, degrees of freedom) of every output group."""
    squares = dict.fromkeys(UNITS, 0.0)
    counts = dict.fromkeys(UNITS, 0.0)
    offset = 0
    for rows in rows_list:
        elastic, rotation = rows.split(residual[offset : offset + rows.size])
        offset += rows.size
        parts = {
            "dR": (elastic[:, :3], rows.elastic[:, :3]), "a": (elastic[:, 3:], rows.elastic[:, 3:]),
            "Omega": (rotation[:, :3], rows.rotation[:, :3]),
            "theta": (rotation[:, 3:], rows.rotation[:, 3:]),
        }  # fmt: skip
        free = sum(q.shape[1] for part, q in rows.nuisance if part.start >= rows.elastic.size)
        for group, (values, weight) in parts.items():
            squares[group] += float(np.sum(values**2))
            counts[group] += int(np.sum(weight > 0))
        if counts["Omega"] and counts["theta"]:
            counts["Omega"] -= free / 2
            counts["theta"] -= free / 2
    return {g: (squares[g], counts[g]) for g in UNITS if counts[g] > 0}


def gaps(rows_list, noise, before: np.ndarray, after: np.ndarray) -> dict[str, Gap]:
    """`Gap` of every group from the held-out residuals before and after (theta by windows)."""
    first, last = group_squares(rows_list, before), group_squares(rows_list, after)
    return {
        g: Gap(
            noise[g], noise[g] * np.sqrt(first[g][0] / first[g][1]),
            noise[g] * np.sqrt(last[g][0] / last[g][1]), UNITS[g],
        )
        for g in first
    }  # fmt: skip
