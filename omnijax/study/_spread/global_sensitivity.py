"""`global_sensitivity`: what matters over whole ranges, not only at one design."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..._errors import InputError, RunError
from ...vibration import METRICS
from .._batches import Order
from .._design import RigCases
from .._evaluation import checked_metrics
from .._file import LEAST_SAMPLES, Study, study_of
from .._sobol import sobol_points
from .._study_folder import Folder, folder_of
from .inputs import Batch, Input, UncertainInputs, one_by_one, run_all
from .morris import morris_design, morris_effects
from .result import GlobalSensitivity
from .sobol import sobol_design, sobol_indices

Report = Callable[[int, int], None]


def analyse(
    function: Callable[[Array], Array],
    inputs: Sequence[Input],
    metrics: Sequence[str],
    units: Sequence[str],
    *,
    samples: int = 256,
    seed: int = 0,
    report: Report | None = None,
    store: Folder | None = None,
    order: Order = "side by side",
) -> GlobalSensitivity:
    """Global sensitivities of any pure function of `inputs` (d,) to metrics (m,).

    `samples` blocks for Sobol (d + 2 runs each), a sixteenth as many trajectories for Morris and as
    many points with gradients as blocks, up to 256.  A run that is not finite has failed.  Runs go
    one after the other where `order` is `in turn`: for functions whose loops end when done.

    Raises `InputError` for less than 16 samples, `RunError` where too few runs are left.
    """
    box = UncertainInputs(inputs)
    batch = one_by_one(function, box, order)
    return _analyse(batch, box, metrics, units, samples, seed, report, store)


def _analyse(
    batch: Batch, box: UncertainInputs, metrics, units, samples: int, seed: int, report, store
) -> GlobalSensitivity:
    if samples < LEAST_SAMPLES:
        raise InputError(f"`samples` must be at least {LEAST_SAMPLES}, but is {samples}.")
    unit = sobol_design(box.size, samples, seed)
    paths = morris_design(box.size, max(8, samples // 16), seed + 1, box.normal)
    drawn = sobol_points(box.size, 1 << min(samples, 256).bit_length() - 1, seed + 2)
    tasks = (("sobol", unit, False), ("morris", paths, False), ("slopes", drawn, True))
    total, before, runs = sum(len(x) for _, x, _ in tasks), 0, {}
    for key, points, slopes in tasks:

        def tell(done, _, before=before):
            if report is not None:
                report(before + done, total)

        runs[key] = run_all(
            batch, box.standard(points), slopes=slopes, report=tell, store=store, key=key
        )
        before += len(points)
    try:
        sobol = sobol_indices(runs["sobol"].values, runs["sobol"].failed, box.size, seed)
        morris = morris_effects(paths, runs["morris"].values, runs["morris"].failed)
    except ValueError as error:
        raise RunError(f"too many runs failed: {error}") from None
    bound, half = _bounds(box, runs["slopes"])
    failed = [
        _named(box, points[i]) for key, points, _ in tasks for i in np.flatnonzero(runs[key].failed)
    ]
    return GlobalSensitivity(
        box.names, tuple(metrics), tuple(units), sobol, morris, bound, half, total, tuple(failed)
    )


def _bounds(box: UncertainInputs, runs) -> tuple[np.ndarray, np.ndarray]:
    """C E[(df/ds)^2]/V of the runs without failure, and 95 % half widths."""
    good = ~runs.failed
    square, values = runs.slopes[good] ** 2, runs.values[good]
    variance = values.var(axis=0)[:, None]
    factor = box.poincare / np.where(variance > 0, variance, np.inf)
    half = 1.96 * square.std(axis=0) / np.sqrt(max(good.sum(), 1))
    return factor * square.mean(axis=0), factor * half


def _named(box: UncertainInputs, unit: np.ndarray) -> str:
    values = np.asarray(box.values(jnp.asarray(box.standard(unit))))
    return ", ".join(f"{n} = {v:.6g}" for n, v in zip(box.names, values, strict=True))


def global_sensitivity(
    study: str | Path | Mapping | Study,
    metrics: Sequence[str] | str | None = None,
    *,
    out: str | Path | None = None,
    resume: bool = False,
    report: Report | None = None,
) -> GlobalSensitivity:
    """Global sensitivities of a study's metrics over the ranges of its variables.

    `metrics` is a list, or text with commas between; without any, those of the study's objective.
    Over several drives or loads each metric is its worst over the cases.

    Figures are SI, indices (metrics, variables) without unit (Saltelli 2010, Morris 1991).
    Raises `InputError` for a wrong study, `RunError` where too few runs are left.
    """
    asked = study_of(study)
    if not asked.variables:
        raise InputError("a global study needs at least one [[variable]] with path, low and high.")
    whole = [v.name for v in asked.variables if v.whole]
    if whole:
        raise InputError([f"`{n}` takes whole numbers: leave it out." for n in whole])
    names = checked_metrics(metrics or [name for name, _ in asked.weights])
    plain = dataclasses.replace(asked, constraints=(), tolerances=())
    cases = RigCases(plain, names)
    kinds = asked.distributions or ("uniform",) * len(asked.variables)
    inputs = [
        Input(v.name, v.low, v.high, v.log, kind == "normal")
        for v, kind in zip(asked.variables, kinds, strict=True)
    ]

    box = UncertainInputs(inputs)
    sign = np.array([1.0 if METRICS[name].smaller_is_better else -1.0 for name in names])

    def worst(x):
        s = jnp.asarray(sign)
        return s * jnp.max(s * cases.every(x, jnp.zeros((1, 0)))[0][:, 0], axis=0)

    if cases.in_bulk is None:
        batch = one_by_one(worst, box, cases.how.order)
    else:
        batch = partial(_in_bulk, cases, box, sign, asked.samples * (box.size + 2))
    store = folder_of(out, asked.identity("global", metrics=names), resume)
    units = [METRICS[name].unit for name in names]
    return _analyse(batch, box, names, units, asked.samples, asked.seed, report, store)


def _in_bulk(cases: RigCases, box: UncertainInputs, sign, total: int, standard: np.ndarray,
             slopes: bool):  # fmt: skip
    """Each metric's worst over the cases at standard points, and its slopes over these."""
    x, rate = jax.jvp(box.values, (jnp.asarray(standard),), (jnp.ones(standard.shape),))
    no_draws = np.zeros((len(standard), 0))
    values, by_rows = cases.many(np.asarray(x), no_draws, slopes, 0 if slopes else total)
    worst = np.argmax(sign * values, axis=1)[:, None]  # NaN counts as the worst
    figures = np.take_along_axis(values, worst, axis=1)[:, 0]
    if not slopes:
        return (figures,)
    by_inputs = np.take_along_axis(by_rows[..., : box.size], worst[..., None], axis=1)[:, 0]
    return figures, by_inputs * np.asarray(rate)[:, None]
