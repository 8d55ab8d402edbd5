"""`pareto`: the trade-off between two or three metrics, by epsilon-constraints side by side.

    minimise f_1   subject to   f_j <= eps_j  (j > 1),   for every eps on a grid at once

The ends of the front come first (each metric by itself); the searches between them start from the
designs interpolated between these ends, and those that fail start again from their best neighbour.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from ..._errors import InputError, RunError, tell
from ..._text import listed
from ...vibration import METRICS
from .._evaluation import checked_metrics
from .._file import Study, study_of
from .._problem import FigureRows, Limit, Problem, Variable, check_variables
from .._range import Ranges
from .._study_folder import Folder, Report, folder_of
from ._search import (
    Engine,
    SearchEnd,
    Starts,
    best_of,
    followed_by,
    nothing_left,
    start_shares,
    values_of,
)
from .answer import conflict
from .cases import RigCases
from .front import Front
from .rig import figures_of, floor_of

FREE = 1e6  # of a metric's size: a limit that never holds


class FrontTrace(NamedTuple):
    """How the searches of a front are run and kept."""

    engine: Engine
    batch: int
    report: Report | None

    def solve(self, lanes: Starts, stage: str) -> list[SearchEnd]:
        """The ends of one stage."""
        return self.engine.batches(lanes, self.batch, stage, self.report)


def trade_off(
    problem: Problem,
    metrics: tuple[str, ...],
    units: tuple[str, ...],
    *,
    points: int = 12,
    starts: int = 4,
    seed: int = 0,
    batch: int = 8,
    store: Folder | None = None,
    report: Report | None = None,
) -> Front:
    """The front of `problem`, whose figures f (m,) are the metrics; its own limits hold too.

    `report(done, total)` is called after each batch of searches of the stage at hand.  Raises
    `RunError` where no search ends inside the limits, and where one design is best in all metrics,
    `InputError` where a metric is 0 whatever the design.
    """
    count = len(metrics)
    check_variables(problem.variables)
    sizes = _sizes(problem, metrics, seed)
    engine = Engine(_with_weights(problem, metrics, sizes), starts, seed, store)
    most = max(count * starts, points ** (count - 1))
    trace = FrontTrace(engine, min(batch, most), report)
    shares = np.asarray(engine.lanes.share)[:, : len(problem.variables)]
    alone = _pack(engine, np.tile(shares, (count, 1)), np.repeat(np.eye(count), starts, axis=0))
    ends = trace.solve(alone, "alone")
    best = [best_of(ends[m * starts : (m + 1) * starts]) for m in range(count)]
    if lost := [n for n, e in zip(metrics, best, strict=True) if e.status == "failed"]:
        reason = next(e.reason for e in best if e.status == "failed")
        raise RunError(f"no search for the least {listed(lost, 'or')} ends in figures: {reason}.")
    if all(e.status == "infeasible" for e in best):
        raise RunError(conflict(engine.problem, best[0]) + ".")
    inside = _inside(trace, best)
    total = sum(e.evaluations for e in [*ends, *inside.values()])
    best = [inside.get(m, e) for m, e in enumerate(best)]
    values = _metrics(best, count)
    low, high = values.min(axis=0), values.max(axis=0)
    spanned = np.flatnonzero(high - low > 1e-7 * np.abs(high))
    if len(spanned) < 2:  # the others are at their best wherever the searches ended
        raise RunError(_no_front(metrics, best))
    lead, *held = spanned.tolist()
    place = _mesh(held, points, count)
    limits = np.full(place.shape, FREE) * np.maximum(high, 1e-300)
    limits[:, held] = (low + place * (high - low))[:, held]
    lanes = _between(engine, best, place, limits, lead)
    between = trace.solve(lanes, "between")
    again = _again(trace, lanes, between, place)
    total += sum(e.evaluations for e in [*between, *again.values()])
    between = [again.get(i, e) for i, e in enumerate(between)]
    kept = [e for e in [*best, *between] if e.status in {"optimal", "not optimal"}]
    values = _metrics(kept, count)
    front = undominated(values)
    names = tuple(v.name for v in problem.variables)
    return Front(
        metrics, units, names, tuple(v.unit for v in problem.variables), values[front],
        np.array([kept[i].x[: len(names)] for i in front]), tuple(kept[i].status for i in front),
        total,
    )  # fmt: skip


def _no_front(metrics: tuple[str, ...], best: list[SearchEnd]) -> str:
    """Why the best designs of all metrics are one."""
    short = [n for n, e in zip(metrics, best, strict=True) if e.status != "optimal"]
    names = ", ".join(metrics)
    if not short:
        return f"{names} do not conflict: one design is best in all of them."
    which = f"the search for the least {listed(short, 'or')} ended short of an optimum"
    return f"{names} span no front that was found: {which}."


def _inside(trace: FrontTrace, best: list[SearchEnd]) -> dict[int, SearchEnd]:
    """Ends of the front that broke a limit, searched anew from those that meet every one.

    What lies outside of the limits says nothing of how far the front goes.
    """
    count = len(best)
    out = [m for m, e in enumerate(best) if e.status == "infeasible"]
    if not out:
        return {}
    begin = [e.share[:-count] for e in best if e.status != "infeasible"]
    shares = np.tile(np.array(begin), (len(out), 1))
    lanes = _pack(trace.engine, shares, np.repeat(np.eye(count)[out], len(begin), axis=0))
    ends = trace.solve(lanes, "inside")
    anew = {m: best_of(ends[k * len(begin) :][: len(begin)]) for k, m in enumerate(out)}
    for m, end in anew.items():
        if end.status not in {"optimal", "not optimal"}:
            name = trace.engine.problem.limits[m].name
            raise RunError(f"no search for the least {name} ends inside the limits.")
    return anew


def _again(
    trace: FrontTrace, lanes: Starts, ends: list[SearchEnd], place: np.ndarray
) -> dict[int, SearchEnd]:
    """Searches that ended short of an optimum, from the end of their nearest good neighbour."""
    good = [i for i, e in enumerate(ends) if e.status == "optimal"]
    short = [i for i, e in enumerate(ends) if e.status != "optimal"]
    if not good or not short:
        return {}
    near = [good[int(np.argmin(np.linalg.norm(place[good] - place[i], axis=1)))] for i in short]
    share = jnp.asarray(np.array([ends[i].share for i in near]))
    index = np.array(short)
    part = Starts(share, lanes.free[index], lanes.limit[index])
    return dict(zip(short, trace.solve(part, "again"), strict=True))


def _sizes(problem: Problem, metrics: tuple[str, ...], seed: int) -> np.ndarray:
    """Median of each metric over a few designs; `InputError` where one is 0 in all of them."""
    shares = start_shares(problem, 4, seed)
    f, _ = values_of(problem)(Ranges.of(problem.variables).value(shares))
    still = np.all(np.abs(f) <= problem.floor, axis=0)
    if still.any():
        raise InputError([nothing_left(n) for n, s in zip(metrics, still, strict=True) if s])
    sizes = np.nanmedian(np.abs(f), axis=0)
    return np.where(sizes > 0, sizes, 1.0)


def _with_weights(problem: Problem, metrics: tuple[str, ...], sizes: np.ndarray) -> Problem:
    """Minimise sum w_m f_m/size_m with the metrics as limits too.

    The weights are variables that the searches hold fixed, so that every stage is one program.
    """
    d, many = len(problem.variables), problem.many

    def weighted(x, parts):
        f, g = parts
        return jnp.sum(x[d:] * f / sizes)[None], jnp.concatenate([f, g])

    def figures(x, extra):
        return weighted(x, problem.figures(x[:d], extra))

    def of_metrics(x, gradient: bool) -> FigureRows:
        assert many is not None
        return many(x[:, :d], gradient)

    weights = tuple(Variable(f"weight of {name}", 0.0, 1.0) for name in metrics)
    own = tuple(Limit(n, FREE * s, s) for n, s in zip(metrics, sizes, strict=True))
    return problem._replace(
        variables=(*problem.variables, *weights), figures=figures, worst=False, cases=("",),
        limits=(*own, *problem.limits), name="weighted metrics", unit="1",
        many=None if many is None else followed_by(of_metrics, weighted), floor=0.0,
    )  # fmt: skip


def _pack(engine: Engine, shares: np.ndarray, weights: np.ndarray, limits=None) -> Starts:
    """Lanes from shares (l, d), weights (l, m) and limits on the metrics (l, m)."""
    bound = np.array([x.bound for x in engine.problem.limits])
    limit = np.tile(bound, (len(shares), 1))
    if limits is not None:
        limit[:, : weights.shape[1]] = limits
    free = np.concatenate([np.ones_like(shares), np.zeros_like(weights)], axis=1)
    share = np.concatenate([shares, weights], axis=1)
    return Starts(jnp.asarray(share), jnp.asarray(free), jnp.asarray(limit))


def _metrics(ends: list[SearchEnd], count: int) -> np.ndarray:
    """The metrics (l, m): the first limits less what the searches held them to."""
    return np.array([e.g[:count] + e.limit[:count] for e in ends])


def _mesh(held: list[int], points: int, count: int) -> np.ndarray:
    """Shares (p, m) of the metrics' spans inside of which those `held` stay; 1 of the others."""
    inner = np.linspace(0.0, 1.0, points + 2)[1:-1]
    axes = [inner if m in held else np.ones(1) for m in range(count)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, count)


def _between(
    engine: Engine, best: list[SearchEnd], place: np.ndarray, limits: np.ndarray, lead: int
) -> Starts:
    """Searches for the least of metric `lead` from designs interpolated between the ends."""
    count = len(best)
    d = len(best[0].share) - count
    ends = np.array([e.share[:d] for e in best])
    mix = 1 - place  # 1: a held metric at its own best
    mix[:, lead] = np.clip(1 - mix.sum(axis=1), 0.0, None)
    shares = (mix / mix.sum(axis=1, keepdims=True)) @ ends
    weights = np.tile(np.eye(count)[lead], (len(place), 1))
    return _pack(engine, np.clip(shares, 0.01, 0.99), weights, limits)


def undominated(values: np.ndarray) -> np.ndarray:
    """Rows that no other row beats in every column, each once, in order of the first column."""
    slack = 1e-9 * np.abs(values).max(axis=0)
    better = np.all(values[None] <= values[:, None] + slack, axis=2)
    strictly = np.any(values[None] < values[:, None] - slack, axis=2)
    kept = np.flatnonzero(~np.any(better & strictly, axis=1))
    same = np.all(np.abs(values[kept, None] - values[None, kept]) <= 1e3 * slack, axis=2)
    kept = kept[~np.any(np.tril(same, -1), axis=1)]
    return kept[np.argsort(values[kept, 0])]


def pareto(
    study: str | Path | Mapping | Study,
    metrics: Sequence[str] | str = (),
    *,
    out: str | Path | None = None,
    resume: bool = False,
    report: Report | None = None,
) -> Front:
    """The front of two or three metrics of a study (`[pareto]` names them, or `metrics` does).

    Over several drives and loads each metric is its mean over the cases, with the parts at their
    nominal values.  With `out` finished searches are stored there, and `resume` takes them up.

    Figures are SI.  Raises `InputError` for a wrong study and for one metric or more than three,
    `RunError` where the metrics do not conflict or nothing is feasible.

    Source: epsilon-constraints (Haimes, Lasdon and Wismer 1971), each solved as `design` does.
    """
    asked = study_of(study)
    names = checked_metrics(metrics) if metrics else asked.pareto
    if len(names) not in {2, 3}:
        raise InputError("a front needs 2 or 3 metrics: [pareto] metrics = [...].")
    margins = [n for n in names if not METRICS[n].smaller_is_better]
    if margins:
        raise InputError(
            [f"`{n}` is no vibration but a margin: hold it by a [[constraint]]." for n in margins]
        )
    if not asked.variables or any(v.whole for v in asked.variables):
        raise InputError("a front needs at least one [[variable]], and only real ones.")
    if asked.tolerances:
        tell(["a front takes the parts at their nominal values: [tolerance] counts for nothing."])
    plain = dataclasses.replace(asked, tolerances=())
    cases = RigCases(plain, names)
    limits, held = cases.limits()

    def combined(values, g):
        return jnp.mean(values[:, 0, : len(names)], axis=0), g[:, 0].reshape(-1)[held]

    draws = cases.draws()
    figures, in_bulk = figures_of(cases, combined, draws)
    problem = Problem(
        asked.variables,
        figures,
        tuple(limits),
        extra=draws,
        order=cases.how.order,
        many=in_bulk,
        floor=tuple(map(floor_of, names)),
    )
    units = tuple(METRICS[n].unit for n in names)
    store = folder_of(out, asked.identity("pareto", metrics=names), resume)
    return trade_off(
        problem, names, units, points=asked.points, starts=asked.starts, seed=asked.seed,
        batch=asked.batch, store=store, report=report,
    )  # fmt: skip
