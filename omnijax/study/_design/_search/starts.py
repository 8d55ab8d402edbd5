"""Where searches start, and how whole numbers are treated.

The user's start comes first.  The others are the best of `SCREENED` points of a Sobol sequence that
lie apart; where too few of these meet the limits, the points are evolved until enough do: figures
without slopes are cheap.

Up to `ENUMERATED` combinations of whole numbers are all searched.  Beyond that they are relaxed to
real numbers, and both neighbours of every relaxed optimum are searched again.
"""

import itertools
from collections.abc import Iterable

import jax.numpy as jnp
import numpy as np

from ..._problem import Problem
from ..._range import Ranges
from ..._sobol import sobol_points
from .evolve import Judge, evolve, far_apart
from .search import Starts

ENUMERATED = 12
SCREENED = 64  # at least, for each combination of whole numbers
GENERATIONS, FEW = 100, 8  # at most, and where every figure is a run


def start_shares(problem: Problem, count: int, seed: int) -> np.ndarray:
    """The user's start, the middle, then a scrambled Sobol sequence; shares (count, d)."""
    scale = Ranges.of(problem.variables)
    middle = np.full(len(problem.variables), 0.5)
    values = [v.start for v in problem.variables]
    first = [middle]
    if any(v is not None for v in values):
        filled = np.where([v is None for v in values], 1.0, np.array(values, float))
        share = np.asarray(scale.share(jnp.asarray(filled)))
        first.insert(0, np.where([v is None for v in values], 0.5, share))
    drawn = sobol_points(len(problem.variables), max(count, 2), seed)
    return np.concatenate([np.array(first), 0.02 + 0.96 * drawn])[:count]


def whole_values(problem: Problem) -> list[np.ndarray]:
    """The allowed whole numbers of each variable; none of a real one."""
    return [
        np.arange(np.ceil(v.low), np.floor(v.high) + 1) if v.whole else np.array([])
        for v in problem.variables
    ]


def make_lanes(problem: Problem, starts: np.ndarray, held: Iterable[dict[int, float]]) -> Starts:
    """Every start with every combination of `held` values {index of the variable: value}."""
    scale, shares, free = Ranges.of(problem.variables), [], []
    limit = jnp.array([x.bound for x in problem.limits])
    for fixed in held:
        for start in starts:
            share, mask = start.copy(), np.ones(len(start))
            for i, value in fixed.items():
                x = np.ones(len(start))
                x[i] = value
                share[i], mask[i] = float(scale.share(jnp.asarray(x))[i]), 0.0
            shares.append(share)
            free.append(mask)
    limits = jnp.broadcast_to(limit, (len(shares), len(limit)))
    return Starts(jnp.asarray(np.array(shares)), jnp.asarray(np.array(free)), limits)


def combinations(problem: Problem) -> int:
    """How many ways there are to choose the whole numbers."""
    return int(np.prod([len(v) for v in whole_values(problem) if len(v)]))


def relaxed(problem: Problem) -> bool:
    """Whether whole numbers are searched as real ones first."""
    return combinations(problem) > ENUMERATED


def first_lanes(problem: Problem, count: int, seed: int, judge: Judge) -> Starts:
    """The searches side by side: `count` for each combination of whole numbers."""
    values = whole_values(problem)
    index = [] if relaxed(problem) else [i for i, v in enumerate(values) if len(v)]
    screened = start_shares(problem, max(SCREENED, 2 * count), seed)
    parts = []
    for c in itertools.product(*(values[i] for i in index)):
        fixed = dict(zip(index, c, strict=True))
        drawn = make_lanes(problem, screened, [fixed])
        shares, free = np.asarray(drawn.share), np.asarray(drawn.free[0])
        generations = (FEW if problem.costly else GENERATIONS) if problem.limits else 0
        moved, rank = evolve(shares, free, judge, 2 * count, generations, seed)
        chosen = moved[far_apart(moved, rank, count)]
        if any(v.start is not None for v in problem.variables):
            chosen = np.concatenate([shares[:1], chosen])[:count]
        rest = (x[: len(chosen)] for x in (drawn.free, drawn.limit))
        parts.append(Starts(jnp.asarray(chosen), *rest))
    return Starts(*(jnp.concatenate(xs) for xs in zip(*parts, strict=True)))


def rounded_lanes(problem: Problem, shares: np.ndarray) -> Starts:
    """Both neighbours of every whole variable at relaxed shares (m, d), to be searched again."""
    scale, values = Ranges.of(problem.variables), whole_values(problem)
    index = [i for i, v in enumerate(values) if len(v)]
    parts = []
    for share in shares:
        x = np.asarray(scale.value(jnp.asarray(share)))
        sides = []
        for i in index:
            near = {np.floor(x[i]), np.ceil(x[i])}
            sides.append(sorted({np.clip(n, values[i][0], values[i][-1]) for n in near}))
        every = itertools.product(*sides)
        fixed = [dict(zip(index, c, strict=True)) for c in every]
        parts.append(make_lanes(problem, share[None], fixed))
    return Starts(*(jnp.concatenate(xs) for xs in zip(*parts, strict=True)))
