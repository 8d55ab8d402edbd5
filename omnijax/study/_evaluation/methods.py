"""The methods that evaluate a design, what each of them cannot honour, and which one is taken.

Every method gives the figures that `simulate` and `vibration.evaluate` give of the same design (the
steady ones: those of its long run).  What a method cannot honour is an obstacle, in words; a design
goes to the first method without one, and where none is left the question is refused.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..._errors import InputError
from ...dynamics import hold_obstacle
from ...laws import DualRow
from ...rig import Rig
from ...simulation import (
    BULK_METRICS,
    SpeedDrive,
    TorqueDrive,
    exact_obstacle,
    figures_obstacle,
    modal_obstacle,
    modal_steady_obstacle,
)
from ...vibration import BULK_STEADY_METRICS, STEADY_METRICS
from .drives import Drive, is_constant, turning

METHODS = {
    "steady-bulk": "steady state in bulk (closed form, modal form)",
    "steady": "steady state (closed form, no time stepping)",
    "bulk": "exact propagation in bulk (linear model, constant speeds, modal form)",
    "propagation": "exact propagation (linear model, prescribed speeds)",
    "fixed": "fixed steps (motor torques, the step tried against its half)",
    "full": "full simulation (adaptive time stepping)",
    "free-run": "free run of an axis under a log's inputs (Runge-Kutta steps)",
}
BULK = ("bulk", "steady-bulk")  # take rows of many designs at once
MOST_SAMPLES = 16_384  # of runs that are kept side by side, 64 of them in 180 MB
WHY = {
    "steady-bulk": "no duration is asked for; the model is linear, modal form",
    "steady": "no duration is asked for",
    "bulk": "the model is linear, the speeds are constant",
    "propagation": "the model is linear and the speeds are given",
    "fixed": "motor torques drive the wheels",
}
# s of one core for a second of a run, by orders of magnitude: three wheels at 2 rad/s, 1 kHz, with
# Hertz contacts took 0.15, closed forms in bulk 2e-5
STEPPED, IN_BULK = 0.1, 2e-5


class Question(NamedTuple):
    """What is asked of every design; `rig` and `drives` before anything of them is varied."""

    rig: Rig
    drives: tuple[Drive, ...]  # all of one kind
    varied: tuple[str, ...]  # paths of rig and drive
    metrics: tuple[str, ...]
    model: str
    duration: float | None  # s; none: the steady state
    rows: bool = False  # whether designs come as rows of numbers, for their metrics alone
    gradient: bool = False
    alone: bool = False  # whether the slopes of one design are all that is asked for
    adaptive: bool = False  # a solver or its tolerance is given
    solver: str | None = None  # the one that is asked for by name
    samples: int | None = None  # of a run, if known

    @property
    def constant(self) -> bool:
        """Whether nothing of the drives changes in time."""
        return all(is_constant(turning(d)) and is_constant(d.force) for d in self.drives)


Obstacle = Callable[[Question], str | None]


def _asked_solver(q: Question) -> str | None:
    return None if q.solver in (None, "exact") else f"the solver `{q.solver}` is asked for"


def _no_closed_form(q: Question) -> str | None:
    if not all(isinstance(d, SpeedDrive) for d in q.drives):
        return "motor torques drive the wheels"
    reason = exact_obstacle(q.rig, q.model)
    return reason or (None if q.constant else "the drive changes in time")


def _phases_that_do_not_count(q: Question) -> str | None:
    turn = np.all(_speeds(q) != 0, axis=0)
    for name, turns in zip(q.rig.names, turn, strict=True):
        if f"angle.{name}" in q.varied and (turns or f"speed.{name}" in q.varied):
            return (
                f"`angle.{name}` is varied, and figures of the long run are those of all start "
                "angles of a wheel that turns"
            )
    for path in q.varied:
        if path.startswith("effect.floor-vibration.") and path.endswith(".phase"):
            return f"`{path}` is varied, and figures of the long run are those of all phases"
    return None


def _speeds(q: Question) -> Float[np.ndarray, "d n"]:
    """The constant speeds of the wheels in every drive, rad/s."""
    return np.array([np.asarray(turning(d).values)[0] for d in q.drives])


def _no_steady_metric(q: Question) -> str | None:
    missing = [name for name in q.metrics if name not in STEADY_METRICS]
    return f"the steady state does not give {', '.join(missing)}" if missing else None


def _nothing_holds(q: Question) -> str | None:
    return hold_obstacle(q.rig, q.model)


def _no_rows(q: Question) -> str | None:
    return None if q.rows else "more is read from a run than its metrics"


def _no_modal_run(q: Question) -> str | None:
    if (reason := modal_obstacle(q.rig, q.model)) is not None or (q.samples or 0) <= MOST_SAMPLES:
        return reason
    if (why := figures_obstacle(q.rig, q.model, q.metrics)) is None:
        return None
    others = [name for name in q.metrics if name not in BULK_METRICS]
    told = f"{', '.join(others)} need every sample of a run" if others else why
    return f"{told}, and {q.samples} samples are more than {MOST_SAMPLES}"


def _no_modal_steady(q: Question) -> str | None:
    others = [name for name in q.metrics if name not in BULK_STEADY_METRICS]
    if others:
        return f"the modal core does not give {', '.join(others)} of the long run"
    return modal_steady_obstacle(q.rig, q.model)


def _no_fixed_steps(q: Question) -> str | None:
    torques = all(isinstance(d, TorqueDrive) for d in q.drives)
    if not (torques and q.constant):
        return "fixed steps take constant motor torques and forces"
    if q.adaptive:
        return "a solver or its tolerance is given"
    if q.gradient and (q.alone or not q.rows):  # off by up to 15 % where figures were within 1e-4
        return "slopes feel how finely fixed steps see the shapes"
    dual = any(isinstance(profile, DualRow) for profile in q.rig.profiles)
    return "contacts jump between two rows" if dual else None


OBSTACLES: dict[str, tuple[Obstacle, ...]] = {
    "steady": (_no_closed_form, _no_steady_metric, _nothing_holds, _phases_that_do_not_count),
    "steady-bulk": (_no_rows, _no_modal_steady, _phases_that_do_not_count),  # beside `steady`'s
    "propagation": (_no_closed_form, _asked_solver),
    "bulk": (_no_rows, _no_modal_run),  # beside `propagation`'s
    "fixed": (_no_fixed_steps,),
}


def obstacle(method: str, question: Question) -> str | None:
    """What `method` cannot honour of the question, in words; None where it serves."""
    return next((why for of in OBSTACLES[method] if (why := of(question)) is not None), None)


def gathers(method: str, rig: Rig, model: str, metrics: Sequence[str]) -> bool:
    """Whether `method` gathers the figures on the way through runs, without keeping samples."""
    return method == "bulk" and figures_obstacle(rig, model, metrics) is None


def cost_of_steps(duration: float | None) -> str:
    """What a design costs that is stepped in time, in words: an order of magnitude."""
    length = 1.0 if duration is None else duration
    each = "each second of a run" if duration is None else f"each run of {duration:g} s"
    return (
        f"{each} is stepped in time, which takes of the order of {_seconds(STEPPED * length)} of "
        f"one core, where closed forms take {_seconds(IN_BULK * length)} (as measured on tripods)"
    )


def _seconds(time: float) -> str:
    """A time (s) to one digit."""
    unit, scale = next(
        (u, s) for u, s in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)) if time >= s or u == "µs"
    )
    return f"{float(f'{time / scale:.1g}'):g} {unit}"


def choose(question: Question) -> tuple[str, str]:
    """(method, why): the cheapest one that honours everything.

    Raises `InputError` where the question asks for a steady state that does not exist.
    """
    exact, bulk = (
        ("steady", "steady-bulk") if question.duration is None else ("propagation", "bulk")
    )
    reason = obstacle(exact, question)
    if reason is None:
        against = obstacle(bulk, question)
        return (bulk, WHY[bulk]) if against is None else (exact, f"{WHY[exact]}; {against}")
    if question.duration is None:
        so = ""
        if reason == _nothing_holds(question):
            so = ", so there is no steady state"
        elif reason == _no_closed_form(question):
            so = ", so no closed form gives its steady state"
        outside = exact_obstacle(question.rig, question.model) == reason
        cost = f" With one, {cost_of_steps(None)}." if outside else ""
        raise InputError(f"this study needs a `duration`: {reason}{so}.{cost}")
    against = obstacle("fixed", question)
    if against is None:
        return "fixed", WHY["fixed"]
    return "full", f"{reason}; {against}; {cost_of_steps(question.duration)}"
