"""From a question to its evaluation: method, samples, and steps as fine as needed."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..._errors import InputError, tell
from ...simulation import EXPONENTIAL, MAX_STEPS, RTOL, fixed_methods
from .coarse import coarse_samples
from .drives import apply
from .evaluation import Evaluation, samples_of, without_run
from .fixed_steps import fine_enough, trial_designs
from .in_step import wheels_in_step
from .methods import Question, choose, gathers
from .misfits import speed_misfits

Trial = Callable[[Evaluation, np.ndarray], np.ndarray]


def evaluation_of(
    question: Question,
    rate: float | None = None,
    *,
    solver: str = "auto",
    rtol: float | None = None,
    max_steps: int | None = None,
    trial: Trial | None = None,
    ranges: Sequence[Any] = (),
) -> tuple[Evaluation, str]:
    """How the designs of a question are evaluated, and why so.

    Runs have `rate` samples per s.  `solver`, `rtol` and `max_steps` are those of full simulations.
    `trial(evaluation, designs)` gives all figures (t, m) of trial designs (t, d) of the `ranges`;
    without it the question's own rig is tried.
    Raises `InputError` where no method can honour the question, and for settings of runs where it
    asks for a steady state.
    """
    stepping = {
        "solver": None if solver == "auto" else solver, "rtol": rtol, "max_steps": max_steps,
    }  # fmt: skip
    if wrong := without_run(question.duration, rate=rate, **stepping):
        raise InputError(wrong)
    adaptive = any(value is not None for value in stepping.values())
    times = samples_of(question.duration, rate)
    question = question._replace(
        adaptive=question.adaptive or adaptive,
        solver=stepping["solver"],
        samples=None if times is None else len(times),
    )
    method, why = choose(question)
    if question.duration is None and (remark := wheels_in_step(question, ranges)) is not None:
        tell([remark])
    if times is not None and (remark := coarse_samples(question, times, ranges)) is not None:
        tell([remark])
    tell(speed_misfits(question, times, ranges))
    how = Evaluation(
        method=method,
        metrics=question.metrics,
        model=question.model,
        times=times,
        solver=solver,
        rtol=RTOL if rtol is None else rtol,
        max_steps=MAX_STEPS if max_steps is None else max_steps,
        forward=question.gradient,
        gathered=gathers(method, question.rig, question.model, question.metrics),
    )
    if method != "fixed":
        return how, why
    tried = _own(question) if trial is None else trial
    designs = trial_designs(ranges)
    sample = float(how.times[1] - how.times[0])
    for steps in _steps(question, sample, designs):
        fixed = how._replace(solver=steps)
        fine = fine_enough(
            lambda x, n, fixed=fixed: tried(fixed._replace(substeps=n), x), designs, 2 * sample
        )
        if fine is not None:
            return fixed._replace(substeps=fine[0]), f"{why}; {steps}, {fine[1]}"
    return how._replace(method="full"), f"{why}; fixed steps are too coarse for a trial design"


def _steps(question: Question, sample: float, designs: np.ndarray) -> tuple[str, ...]:
    """Methods of fixed steps to try; samples follow each other by `sample` s."""
    if question.gradient or not question.rows:  # slopes feel how finely a step sees the shapes
        return (EXPONENTIAL,)
    rigs = [apply(question.rig, question.drives[0], question.varied, x)[0] for x in designs]
    return fixed_methods(rigs, sample, question.model)


def _own(question: Question) -> Trial:
    """The figures of the question's rig under its drives."""

    def figures(how: Evaluation, _):
        @jax.jit
        def values(substeps):
            now = how._replace(substeps=substeps)
            return jnp.concatenate([now.values(question.rig, d) for d in question.drives])

        return np.asarray(values(how.substeps))[None]

    return figures
