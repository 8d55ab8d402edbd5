"""Figures of a study's rig in every case: drives, loads and draws of its parts."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._errors import InputError
from ...rig import Rig, get_parameter, put_parameter
from ...simulation import SpeedDrive, TorqueDrive
from .._batches import each
from .._constraints import (
    CaseNames,
    CaseResult,
    all_limits,
    all_values,
    metrics_of,
    reads_runs,
)
from .._evaluation import (
    BULK,
    METHODS,
    Drive,
    Evaluation,
    Question,
    apply,
    choose,
    evaluate_in_bulk,
    evaluation_of,
    gathers,
    samples_of,
)
from .._file import Study
from .._parameters import checked_parameters, part_problems, values_of
from .._problem import FigureRows, Limit
from .._sobol import sobol_points

# Steady states of a design from which on they go in bulk: one alone takes 5 to 12 ms, 64 in bulk 30
# to 45, but the programs in bulk are compiled in three times the time (40 CPU s for 12).
SEVERAL = 64
RTOL = 1e-6  # of the adaptive solver, unless the study says


def _question(study: Study, metrics: tuple[str, ...], varied: tuple[str, ...]) -> Question:
    drives = tuple(case.drive for case in study.drives)
    return Question(study.rig, drives, varied, metrics, study.model, study.duration)


def _constraint_problems(study: Study) -> list[str]:
    moving = isinstance(study.drives[0].drive, TorqueDrive)
    if moving and any(c.quantity == "frequency_separation" for c in study.constraints):
        return [
            "`constraint.frequency_separation` needs constant speeds: with motor torques the "
            "rollers pass at every frequency on the way."
        ]
    return []


def stochastic_problems(study: Study) -> list[str]:
    """What keeps Adam from drawing parts anew, where the study asks for it."""
    if study.stochastic and not study.tolerances:
        return ["`search.stochastic_steps` needs a [tolerance] table to draw from."]
    return []


def check_study(study: Study) -> None:
    """`InputError` with what the commands of a study refuse before they compute anything."""
    problems = _constraint_problems(study) + stochastic_problems(study)
    loads = tuple(path for load in study.loads for path, _ in load.values)
    varied = (*(v.name for v in study.variables), *checked_parameters(study.rig, loads))
    judged = tuple(name for name, _ in study.weights), study.pareto, (study.limit or ())[:1]
    for metrics in filter(None, judged):
        wanted = tuple(dict.fromkeys((*metrics, *metrics_of(study.constraints))))
        try:
            samples_of(study.duration, study.rate)
            choose(_question(study, wanted, varied))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(list(dict.fromkeys(problems)))


class RigCases:
    """Figures of a study's rig in every case, for any values of the variables."""

    def __init__(self, study: Study, metrics: tuple[str, ...] | None = None):
        self.study = study
        wanted = tuple(name for name, _ in study.weights) if metrics is None else metrics
        self.metrics = tuple(dict.fromkeys((*wanted, *metrics_of(study.constraints))))
        self.start = study.drives[0].drive
        if wrong := _constraint_problems(study):
            raise InputError(wrong)
        self._figures, self._tried_by = None, ""
        self.inputs = jnp.asarray(np.array([(*d.values, *d.force) for d in study.drives]))
        self.paths = tuple(v.name for v in study.variables)
        self.parts, self.half_widths = self._tolerances()
        self.cases = self._names()
        self.load_paths = tuple(dict.fromkeys(p for x in study.loads for p, _ in x.values))
        self.loads = jnp.asarray(self._load_table())
        self.how, self.note = self._evaluation()

    def _evaluation(self) -> tuple[Evaluation, str]:
        """How a case is evaluated, and a sentence on it where runs are integrated."""
        study = self.study
        varied = (*self.paths, *self.load_paths, *self.parts)
        self.question = _question(study, self.metrics, varied)
        how, why = evaluation_of(
            self.question,
            study.rate,
            rtol=study.rtol,
            trial=self._tried,
            ranges=study.variables,
        )
        if study.rtol is None:
            how = how._replace(rtol=RTOL)
        how = how._replace(forward=True)
        return how, f"runs by {METHODS[how.method]}: {why}." if how.integrated else ""

    def _tried(self, how: Evaluation, designs: np.ndarray) -> np.ndarray:
        """Every figure of designs in every case, (t, ...); one program for any substeps."""
        if self._figures is None or self._tried_by != how.solver:
            self._tried_by = how.solver
            nominal = jnp.zeros((1, len(self.parts)))

            def figures(x, substeps):
                now = how._replace(substeps=substeps)
                metrics, limits = self.every(x, nominal, now)
                return jnp.concatenate([metrics.ravel(), limits.ravel()])

            self._figures = jax.jit(figures)
        return np.array([self._figures(x, how.substeps) for x in designs])

    def _tolerances(self) -> tuple[tuple[str, ...], Array]:
        """Paths of the parts that are drawn, and their relative half widths (p,)."""
        given = [path for path, _ in self.study.tolerances]
        if wrong := part_problems(self.study.rig, given):
            raise InputError(wrong)
        paths, half_widths = [], []
        for path, half in self.study.tolerances:
            single = checked_parameters(self.study.rig, [path])
            paths += single
            half_widths += [half] * len(single)
        return tuple(paths), jnp.asarray(np.array(half_widths))

    def _load_table(self) -> np.ndarray:
        """Values at `load_paths`, one row a load; the rig's own where a load says none."""
        paths = checked_parameters(self.study.rig, self.load_paths)
        self.load_paths = paths
        own = values_of(self.study.rig, paths)
        rows = []
        for load in self.study.loads:
            given = {p: v for k, v in load.values for p in checked_parameters(self.study.rig, [k])}
            rows.append([given.get(p, o) for p, o in zip(paths, own, strict=True)])
        return np.array(rows).reshape(len(self.study.loads), len(paths))

    def _names(self) -> tuple[str, ...]:
        many = len(self.study.drives) > 1, len(self.study.loads) > 1
        return tuple(
            ", ".join(n for n, m in ((drive.name, many[0]), (load.name, many[1])) if m)
            for drive in self.study.drives
            for load in self.study.loads
        )

    def limits(self) -> tuple[list[Limit], np.ndarray]:
        """The limits of all cases, and where they stand among the stacked constraints (k c,)."""
        loads = self.study.loads
        loaded = tuple(load.name for load in loads) if len(loads) > 1 else ("",)
        names = CaseNames(self.cases, loaded, self.load_paths)
        return all_limits(self.study.constraints, self.study.rig, names)

    def rig(self, x, load=None, draw=None) -> Rig:
        """The rig of variables `x` with a load's values, its parts off by the relative `draw`."""
        rig = apply(self.study.rig, self.start, self.paths, x)[0]
        for i, path in enumerate(self.load_paths):
            rig = put_parameter(rig, path, self.loads[0, i] if load is None else load[i])
        if draw is not None:
            for i, path in enumerate(self.parts):
                rig = put_parameter(rig, path, get_parameter(rig, path) * (1 + draw[i]))
        return rig

    def drive(self, x, values: Float[Array, " variables"]) -> Drive:
        """The drive of speeds or torques and force, with the variables that belong to it."""
        kind = self.study.drives[0].kind
        moved, force = values[:-3], values[-3:]
        start = eqx.tree_at(
            lambda d: (getattr(d, kind).values, d.force.values),
            self.start,
            (moved[None], force[None]),
        )
        return apply(self.study.rig, start, self.paths, x)[1]

    def one(self, x, values, load, draw, how: Evaluation | None = None) -> tuple[Array, Array]:
        """(metrics, constraints) of one case; `how` if not as the study has it."""
        rig, drive = self.rig(x, load, draw), self.drive(x, values)
        how = self.how if how is None else how
        run = how.run(rig, drive)
        metrics = how.of(run, rig)
        return metrics, self._constrained(rig, drive, run, metrics)

    def _constrained(self, rig: Rig, drive: Drive, run, metrics: Float[Array, " m"]) -> Array:
        """Values of the constraints (c,) of one case; `run` may be None where none looks at it."""
        now = drive.speed.values[0] if isinstance(drive, SpeedDrive) else None
        named = dict(zip(self.metrics, metrics, strict=True))
        point = CaseResult(rig, run, now, self.study.model)
        return all_values(self.study.constraints, point, named)

    def every(
        self, x, draws: Float[Array, "t p"], how: Evaluation | None = None
    ) -> tuple[Array, Array]:
        """Metrics (k, t, m) and constraints (k, t, c) of every case and every draw."""
        order = (self.how if how is None else how).order

        def case(values, load):
            return each(lambda draw: self.one(x, values, load, draw, how), [draws], order)

        return each(case, list(self._case_values()), order)

    @functools.cached_property
    def in_bulk(self) -> Evaluation | None:
        """How `many` are evaluated; None where they cannot be."""
        rows = not reads_runs(self.study.constraints)
        asked = self.question._replace(rows=rows, samples=self.how.samples)
        method, _ = choose(asked)
        if method not in BULK:
            return None
        gathered = gathers(method, asked.rig, asked.model, asked.metrics)
        return self.how._replace(method=method, gathered=gathered)

    def goes_in_bulk(self, draws: int) -> bool:
        """Whether a design in every case, with so many draws, is rather evaluated in bulk."""
        several = self.how.times is not None or len(self.cases) * draws >= SEVERAL
        return several and self.in_bulk is not None

    def many(
        self, x: np.ndarray, draws: np.ndarray, gradient: bool = False, total: int = 0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Metrics (n, k, m) of points (n, d) with their draws (n, p) in every case, in bulk.

        And slopes (n, k, m, row) by rows as `case` takes them, of no columns without `gradient`.
        `total` points are asked for in all, where more than these.
        """
        assert self.in_bulk is not None
        values, loads = self._case_values()
        own = np.concatenate([values, loads], axis=1)  # (k, ...)
        shape, parts = (len(x), len(own)), (x[:, None], own[None], draws[:, None])
        rows = np.concatenate([np.broadcast_to(p, (*shape, p.shape[2])) for p in parts], axis=2)
        metrics, slopes, _ = evaluate_in_bulk(
            self.in_bulk, self.case, rows.reshape(-1, rows.shape[2]), gradient, total * len(own)
        )
        return metrics.reshape(*shape, -1), slopes.reshape(*shape, *slopes.shape[1:])

    def with_draws(
        self, x: np.ndarray, draws: np.ndarray, gradient: bool, total: int
    ) -> FigureRows:
        """Metrics (n, k, t, m) of points x (n, d) in every case with every draw, in bulk.

        And their slopes by the variables.  `total` points are asked for in all.
        """
        count, size = draws.shape[0], x.shape[1]
        rows = np.repeat(x, count, axis=0), np.tile(draws, (len(x), 1))
        metrics, slopes = self.many(*rows, gradient, total * count)

        def arranged(y):
            return np.moveaxis(y.reshape(len(x), count, *y.shape[1:]), 1, 2)

        return FigureRows(arranged(metrics), arranged(slopes[..., :size]) if gradient else None)

    def constraints(self, x, draws: Float[Array, "t p"], metrics: Float[Array, "k t m"]) -> Array:
        """Values (k, t, c) of constraints that look at no run, of every case and every draw."""

        def case(values, load, metrics):
            def one(draw, metrics):
                rig, drive = self.rig(x, load, draw), self.drive(x, values)
                return self._constrained(rig, drive, None, metrics)

            return jax.vmap(one)(draws, metrics)

        return jax.vmap(case)(*self._case_values(), metrics)

    def case(self, row: Float[Array, " row"]) -> tuple[Rig, Drive]:
        """Rig and drive of one case: variables, speeds and force, load and draw side by side."""
        ends = np.cumsum([len(self.paths), self.inputs.shape[1], self.loads.shape[1]])
        x, values, load, draw = jnp.split(row, ends)
        return self.rig(x, load, draw), self.drive(x, values)

    def _case_values(self) -> tuple[Array, Array]:
        """Speeds with force, and load, of every case: drives first, loads second, as in `cases`."""
        values = jnp.repeat(self.inputs, len(self.loads), axis=0)
        return values, jnp.tile(self.loads, (len(self.inputs), 1))

    def draws(self) -> Float[Array, "t p"]:
        """The parts' relative deviations: corners for the worst case, uniform for the spread."""
        size, study = len(self.parts), self.study
        if not size:
            return jnp.zeros((1, 0))
        unit = sobol_points(size, study.draws, study.seed)
        if study.spread == "worst":
            corners = np.where(unit < 0.5, -1.0, 1.0)
            corners = np.concatenate([np.zeros((1, size)), corners])
            return jnp.asarray(corners * np.array(self.half_widths))
        return jnp.asarray((2 * unit - 1) * np.array(self.half_widths))

    def draw(self, key) -> Float[Array, "t p"]:
        """New deviations of the same kind."""
        shape = (self.study.draws, len(self.parts))
        unit = jax.random.uniform(key, shape, minval=-1.0, maxval=1.0)
        return (jnp.sign(unit) if self.study.spread == "worst" else unit) * self.half_widths

    def weighted(self, metrics: Float[Array, "k t m"]) -> Float[Array, "k t"]:
        """The objective of every case and draw."""
        place = [self.metrics.index(name) for name, _ in self.study.weights]
        weight = jnp.array([w for _, w in self.study.weights])
        return metrics[..., jnp.array(place)] @ weight

    def spread(self, values: Float[Array, "k t"]) -> Array:
        """Over the draws: all of them for the worst case, else mean + sigmas x deviation."""
        if not self.parts or self.study.spread == "worst":
            return values.reshape(-1)
        centre = jnp.mean(values, axis=1)
        variance = jnp.mean((values - centre[:, None]) ** 2, axis=1)
        positive = variance > 0
        deviation = jnp.where(positive, jnp.sqrt(jnp.where(positive, variance, 1.0)), 0.0)
        return centre + self.study.sigmas * deviation
