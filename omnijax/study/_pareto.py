"""`pareto`: the trade-off between two or three metrics, by epsilon-constraints side by side.

    minimise f_1   subject to   f_j <= eps_j  (j > 1),   for every eps on a grid at once

The ends of the front come first (each metric by itself); the searches between them start from the
designs interpolated between these ends, and those that fail start again from their best neighbour.
"""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._errors import InputError, RunError
from ..vibration import METRICS
from ._constraints import all_limits
from ._design_engine import End, Engine, best_of
from ._design_problem import Limit, Problem, Scale, Variable, check_variables
from ._design_result import amount, conflict
from ._design_rig import RigCases
from ._design_search import Lanes
from ._design_starts import start_shares
from ._study_file import Study, study_of


@dataclasses.dataclass(frozen=True)
class Front:
    """Designs none of which is better than another in every metric.

    `values[p, m]` are the metrics and `x[p, d]` the variables; `status` as in `Design`.
    `evaluations` counts objectives with gradients, of all searches.
    """

    metrics: tuple[str, ...]
    units: tuple[str, ...]
    variables: tuple[str, ...]
    values: np.ndarray
    x: np.ndarray
    status: tuple[str, ...]
    evaluations: int

    def sentences(self) -> list[str]:
        """The span of the front in words."""
        good = sum(s == "optimal" for s in self.status)
        lines = [f"{len(self.x)} designs on the front, {good} of them optimal (KKT residual)."]
        for m, (name, unit) in enumerate(zip(self.metrics, self.units, strict=True)):
            low, high = self.values[:, m].min(), self.values[:, m].max()
            lines.append(f"{name} from {amount(low, unit)} to {amount(high, unit)}.")
        return lines

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` over point, metric and variable."""
        import xarray as xr

        data = {
            "value": (("point", "metric"), self.values),
            "x": (("point", "variable"), self.x),
            "status": ("point", np.array(self.status)),
        }
        coords = {
            "metric": list(self.metrics),
            "variable": list(self.variables),
            "metric_unit": ("metric", list(self.units)),
        }
        return xr.Dataset(data, coords, {"kind": "omnijax front", "evaluations": self.evaluations})

    def save(self, path: str | Path) -> None:
        """Write netCDF that `Front.load` reads back equal."""
        self.to_xarray().to_netcdf(path, engine="h5netcdf")

    @classmethod
    def load(cls, path: str | Path) -> "Front":
        """The front that `save` wrote."""
        import xarray as xr

        with xr.open_dataset(path, engine="h5netcdf") as opened:
            d = opened.load()
        if d.attrs.get("kind") != "omnijax front":
            raise InputError("holds no front.", path)

        def texts(name):
            return tuple(str(x) for x in d[name].values)

        return cls(
            texts("metric"), texts("metric_unit"), texts("variable"), d["value"].values,
            d["x"].values, texts("status"), int(d.attrs["evaluations"]),
        )  # fmt: skip

    def plot(self, ax: Any = None) -> Any:
        """The first two metrics against each other; a third in colour."""
        from ._sensitivity_plot import new_axes

        ax = new_axes(ax)
        order = np.argsort(self.values[:, 0])
        a, b = self.values[order, 0], self.values[order, 1]
        if len(self.metrics) == 2:
            ax.plot(a, b, "o-", color="#0072B2")
        else:
            dots = ax.scatter(a, b, c=self.values[order, 2], cmap="cividis")
            ax.figure.colorbar(dots, ax=ax, label=f"{self.metrics[2]} ({self.units[2]})")
        ax.set_xlabel(f"{self.metrics[0]} ({self.units[0]})")
        ax.set_ylabel(f"{self.metrics[1]} ({self.units[1]})")
        ax.set_title("nothing can be better in one without being worse in another")
        return ax


FREE = 1e6  # of a metric's size: a limit that never holds


def trade_off(
    problem: Problem,
    metrics: tuple[str, ...],
    units: tuple[str, ...],
    *,
    points: int = 12,
    starts: int = 4,
    seed: int = 0,
    report: Callable[[int, int], None] | None = None,
) -> Front:
    """The front of `problem`, whose figures f (m,) are the metrics; its own limits hold too."""
    count = len(metrics)
    check_variables(problem.variables)
    sizes = _sizes(problem, seed)
    engine = Engine(_with_weights(problem, metrics, sizes), starts, seed)
    tell = report or (lambda done, total: None)
    shares = start_shares(problem, starts, seed)
    alone = _pack(engine, np.tile(shares, (count, 1)), np.repeat(np.eye(count), starts, axis=0))
    width = max(len(alone.share), points if count == 2 else points**2)
    ends = engine.solve(_padded(alone, width))[: len(alone.share)]
    total = sum(e.evaluations for e in ends)
    tell(1, 3)
    best = [best_of(ends[m * starts : (m + 1) * starts]) for m in range(count)]
    if all(e.status in {"infeasible", "failed"} for e in best):
        raise RunError(conflict(engine.problem, best[0]) + ".")
    values = _metrics(engine, best, count)
    low, high = values.min(axis=0), values.max(axis=0)
    if np.any(high - low <= 1e-7 * np.abs(high)):
        raise RunError(f"{', '.join(metrics)} do not conflict: one design is best in all of them.")
    mesh = _mesh(low, high, points, count)
    lanes = _between(engine, best, mesh, low, high)
    found = engine.solve(_padded(lanes, width))[: len(mesh)]
    total += sum(e.evaluations for e in found)
    tell(2, 3)
    good = [i for i, e in enumerate(found) if e.status == "optimal"]
    if 0 < len(good) < len(found):
        share = np.array(lanes.share)
        place = (mesh - low[1:]) / (high - low)[1:]
        for i in sorted(set(range(len(found))) - set(good)):
            near = good[int(np.argmin(np.linalg.norm(place[good] - place[i], axis=1)))]
            share[i] = found[near].share
        again = engine.solve(_padded(lanes._replace(share=jnp.asarray(share)), width))[: len(mesh)]
        total += sum(again[i].evaluations for i in range(len(found)) if i not in good)
        found = [f if f.status == "optimal" else a for a, f in zip(again, found, strict=True)]
    tell(3, 3)
    kept = [e for e in [*best, *found] if e.status in {"optimal", "not optimal"}]
    values = _metrics(engine, kept, count)
    front = undominated(values)
    names = tuple(v.name for v in problem.variables)
    return Front(
        metrics, units, names, values[front], np.array([kept[i].x[: len(names)] for i in front]),
        tuple(kept[i].status for i in front), total,
    )  # fmt: skip


def _sizes(problem: Problem, seed: int) -> np.ndarray:
    scale = Scale.of(problem.variables)
    shares = jnp.asarray(start_shares(problem, 4, seed))
    f = jax.jit(jax.vmap(lambda s: problem.figures(scale.value(s), problem.extra)[0]))(shares)
    sizes = np.nanmedian(np.abs(np.asarray(f)), axis=0)
    return np.where(sizes > 0, sizes, 1.0)


def _with_weights(problem: Problem, metrics: tuple[str, ...], sizes: np.ndarray) -> Problem:
    """Minimise sum w_m f_m/size_m with the metrics as limits too.

    The weights are variables that the searches hold fixed, so that every stage is one program.
    """
    d = len(problem.variables)

    def figures(x, extra):
        f, g = problem.figures(x[:d], extra)
        return jnp.sum(x[d:] * f / sizes)[None], jnp.concatenate([f, g])

    weights = tuple(Variable(f"weight of {name}", 0.0, 1.0) for name in metrics)
    own = tuple(Limit(n, FREE * s, s) for n, s in zip(metrics, sizes, strict=True))
    return problem._replace(
        variables=(*problem.variables, *weights), figures=figures, worst=False, cases=("",),
        limits=(*own, *problem.limits), name="weighted metrics", unit="1",
    )  # fmt: skip


def _pack(engine: Engine, shares: np.ndarray, weights: np.ndarray, limits=None) -> Lanes:
    """Lanes from shares (l, d), weights (l, m) and limits on the metrics (l, m)."""
    bound = np.array([x.bound for x in engine.problem.limits])
    limit = np.tile(bound, (len(shares), 1))
    if limits is not None:
        limit[:, : weights.shape[1]] = limits
    free = np.concatenate([np.ones_like(shares), np.zeros_like(weights)], axis=1)
    share = np.concatenate([shares, weights], axis=1)
    return Lanes(jnp.asarray(share), jnp.asarray(free), jnp.asarray(limit))


def _padded(lanes: Lanes, width: int) -> Lanes:
    """The same lanes and copies of the last up to `width`: one shape, one program."""
    index = np.minimum(np.arange(width), len(lanes.share) - 1)
    return Lanes(*(x[index] for x in lanes))


def _metrics(engine: Engine, ends: list[End], count: int) -> np.ndarray:
    return engine._values(np.array([e.share for e in ends]))[1][:, :count]


def _mesh(low, high, points: int, count: int) -> np.ndarray:
    """Inner limits on metrics 2 ... m, (p, m - 1)."""
    axes = [np.linspace(low[m], high[m], points + 2)[1:-1] for m in range(1, count)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, count - 1)


def _between(engine: Engine, best: list[End], mesh, low, high) -> Lanes:
    """Searches between the ends of the front, from designs interpolated between them."""
    count = len(best)
    d = len(best[0].share) - count
    ends = np.array([e.share[:d] for e in best])
    near = 1 - (mesh - low[1:]) / (high - low)[1:]  # 1: metric m at its own best
    mix = np.concatenate([np.clip(1 - near.sum(axis=1, keepdims=True), 0.0, None), near], axis=1)
    shares = (mix / mix.sum(axis=1, keepdims=True)) @ ends
    weights = np.tile(np.eye(count)[0], (len(mesh), 1))
    limits = np.concatenate([np.full((len(mesh), 1), FREE * max(high[0], 1e-300)), mesh], axis=1)
    return _pack(engine, np.clip(shares, 0.01, 0.99), weights, limits)


def undominated(values: np.ndarray) -> np.ndarray:
    """Rows that no other row beats in every column, in order of the first column."""
    slack = 1e-9 * np.abs(values).max(axis=0)
    better = np.all(values[None] <= values[:, None] + slack, axis=2)
    strictly = np.any(values[None] < values[:, None] - slack, axis=2)
    kept = np.flatnonzero(~np.any(better & strictly, axis=1))
    return kept[np.argsort(values[kept, 0])]


def pareto(
    study: str | Path | Mapping | Study,
    metrics: tuple[str, ...] = (),
    *,
    report: Callable[[int, int], None] | None = None,
) -> Front:
    """The front of two or three metrics of a study (`[pareto]` names them, or `metrics` does).

    Over several drives and loads each metric is its mean over the cases.
    """
    asked = study_of(study)
    names = tuple(metrics) or asked.pareto
    if len(names) not in {2, 3}:
        raise InputError("a front needs 2 or 3 metrics: [pareto] metrics = [...].")
    if not asked.variables or any(v.whole for v in asked.variables):
        raise InputError("a front needs at least one [[variable]], and only real ones.")
    plain = dataclasses.replace(asked, tolerances=())
    cases = RigCases(plain, names)
    limits, held = all_limits(plain.constraints, plain.rig, cases.cases)

    def figures(x, draws):
        values, g = cases.every(x, draws)
        return jnp.mean(values[:, 0, : len(names)], axis=0), g[:, 0].reshape(-1)[held]

    problem = Problem(asked.variables, figures, tuple(limits), extra=cases.draws())
    units = tuple(METRICS[n].unit for n in names)
    return trade_off(
        problem, names, units, points=asked.points, starts=asked.starts, seed=asked.seed,
        report=report,
    )  # fmt: skip
