"""Rows of several runs side by side: windows of one shape share a program and run in one batch."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from .rows import Balance, FreeRun

PARTS = 4  # of the windows of a split, which run one after the other, at most


@dataclasses.dataclass(frozen=True)
class Batch:
    """Runs whose rows one program gives: their data in parts of one shape, each run's values.

    `takes` are the windows of each part among those of all `members`, none for a balance; the last
    part is filled up by its last window.
    """

    members: list[int]
    parts: list[tuple]
    takes: list[np.ndarray]
    values: list[int]

    def data(self, starts: Mapping[int, np.ndarray]) -> list[tuple]:
        """The parts, of free runs with the windows' `starts` (windows, states + 2) by run."""
        if not self.takes:
            return self.parts
        moved = np.concatenate([starts[i] for i in self.members])
        return [
            (*part, jnp.asarray(moved[take]))
            for part, take in zip(self.parts, self.takes, strict=True)
        ]

    def by_run(self, made: Sequence[np.ndarray]) -> dict[int, np.ndarray]:
        """Values (points, values) by run of those of the parts."""
        ends = np.cumsum(self.values)
        table = np.concatenate(made, axis=1)[:, : ends[-1]]
        return dict(zip(self.members, np.split(table, ends[:-1], axis=1), strict=True))


def alike(rows: Balance | FreeRun) -> tuple:
    """What free runs share whose windows may run side by side."""
    return (*rows.kind, rows.data[2].shape[1]) if isinstance(rows, FreeRun) else ("", id(rows))


def widths(rows: Sequence[Balance | FreeRun], splits: Iterable[Sequence[int]]) -> dict[tuple, int]:
    """Windows that run side by side, by what free runs share: one program for all splits.

    As many as the smallest split has, but no split has more than `PARTS` parts.
    """
    totals: dict[tuple, list[int]] = {}
    for split in splits:
        counts: dict[tuple, int] = {}
        for one in (rows[i] for i in split):
            if isinstance(one, FreeRun):
                counts[alike(one)] = counts.get(alike(one), 0) + len(one.begin)
        for key, count in counts.items():
            totals.setdefault(key, []).append(count)
    return {key: max(min(x), -(-max(x) // PARTS)) for key, x in totals.items()}


def batches(rows: Mapping[int, Balance | FreeRun], widths: Mapping[tuple, int]) -> list[Batch]:
    """What may run side by side, of free runs `widths` windows at a time."""
    groups: dict[tuple, list[int]] = {}
    for i, one in rows.items():
        groups.setdefault(alike(one), []).append(i)
    out = []
    for key, members in groups.items():
        some = [rows[i] for i in members]
        if key not in widths:  # a balance: each run by itself
            out.append(Batch(members, [some[0].data], [], [some[0].count]))
            continue
        counts, samples, width = [len(r.data[2]) for r in some], key[-1], widths[key]
        data = jax.tree.map(lambda *x: np.concatenate(x), *[r.data for r in some])
        ends = range(0, sum(counts), width)
        takes = [np.minimum(np.arange(k, k + width), sum(counts) - 1) for k in ends]
        parts = [jax.tree.map(lambda x, take=take: jnp.asarray(x[take]), data) for take in takes]
        out.append(Batch(members, parts, takes, [n * samples for n in counts]))
    return out
