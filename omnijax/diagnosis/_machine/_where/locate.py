"""Where a rig's prediction and a run disagree: what its residual is asked.

Beside lines, orders and the states of wheels and sphere: the reading of the channel itself, on
which hangs what its sensor does to it, and a change over the run of what the model takes as
constant, calibrated numbers and the strengths of effects alike.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..._orthonormal import orthonormal
from ..._search import (
    Level,
    Point,
    WhereQuestion,
    discovered,
    in_all_runs,
    moved,
    on_reading,
    state,
    steps_of,
    value_of,
)
from ..._settings import SETTINGS
from ..._threads import each
from .._noise import DataRows
from ..clocks import CLOCK
from .left_motion import accelerating, turned_lengths

DRIFTS = "sensor-drift"  # a law of the time itself: noise that wanders changes its numbers
PRIOR_STEP = SETTINGS.fit.prior_step
OWN_SHARE = SETTINGS.locate.own_share
ASKED_SIZE = SETTINGS.locate.asked_size
SHUFFLES = SETTINGS.where.shuffles
DIGITS = SETTINGS.locate.digits


def locate(
    model, point: Point, i: int, beside: Sequence[int], top: int = SETTINGS.search.shown_most
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """`discovered` of the residual of a rig's model at `point` on run `i`.

    What is a function of a channel's reading is one in all runs `beside`, `i` among them.
    """
    machine, rig = model.machine, model.rig_at(point)
    vector, changes = _tangents(model, point, i)
    labels = [f"dR_{c}" for c in "xyz"] + [f"a_{c}" for c in "xyz"]
    labels += [f"Omega_{c}" for c in "xyz"] + [f"theta_{k + 1}" for k in range(rig.size)]
    columns = dict(zip(labels, _table(machine, i, vector).T, strict=True))
    own = {label: changing({k: np.stack([x[:, c] for x in tables], axis=1)
                            for k, tables in changes.items()},
                           ASKED_SIZE * float(np.linalg.norm(columns[label])))
           for c, label in enumerate(labels)}  # fmt: skip
    step = machine.runs[i].step
    for c in "xyz":
        own[f"a_{c}"] += accelerating(f"dR_{c}", columns[f"dR_{c}"], step)
    answers = _in_all_runs(model, rig, labels, beside)
    time, signals = machine.runs[i].time, _signals(machine, rig, i)
    drawn = _drawn(machine.rows[i], model.turning_noise_of(point, i), labels[6:])
    return discovered(time, columns, *signals, top, own, answers, drawn)


def _drawn(
    rows: DataRows, noise: Mapping[str, Level], channels: Sequence[str]
) -> dict[str, np.ndarray]:
    """By channel of the rotation residuals (samples, m) of a run that holds noise alone.

    Of the colours `noise`; the free starts take up a part of it, and leave the rest bent in every
    window.  None where it is white: blocks of a residual, shuffled, say as much.
    """
    if not noise and rows.turning is None:
        return {}
    left = rows.left_of_noise([noise.get(c) for c in channels], SHUFFLES)
    return {c: left[:, k] for k, c in enumerate(channels)}


def _in_all_runs(model, rig, labels: list[str], every: Sequence[int]) -> list[dict[str, Any]]:
    """Answers of the runs `every`: by elastic channel what is a function of its reading, by wheel
    what of its rolled length is left of Omega too."""
    machine = model.machine
    steps = [machine.runs[i].step for i in every]
    vectors = [machine.residuals([rig], [i])[0] for i in every]
    (read,) = machine.elastic([rig], every)  # before the sensors, whose laws hang on it
    left = [machine.rows[i].unwhitened(x) for i, x in zip(every, vectors, strict=True)]
    turned = [_turned(machine, rig, i, x) for i, x in zip(every, vectors, strict=True)]

    def of_reading(c: int) -> dict[str, Any] | None:
        return on_reading(labels[c], [x[:, c] for x in left], [x[:, c] for x in read], c, steps)

    def of_motion(k: int) -> dict[str, Any] | None:
        lengths, shapes = zip(*((x[:, k], y[:, k : k + 1]) for x, y in turned), strict=True)
        return in_all_runs("motion Omega", lengths, shapes, k, steps)

    out = [*each(of_reading, range(6)), *each(of_motion, range(rig.size))]
    asked = [*labels[:6], *labels[-rig.size :]]
    return [{"channel": c, **answer} for c, answer in zip(asked, out, strict=True)
            if answer is not None]  # fmt: skip


def _turned(machine, rig, i: int, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`turned_lengths` of run `i`."""
    run, axes = machine.runs[i], machine.motions(rig, [i])[i].axes
    axes = axes[:: max(1, (len(axes) - 1) // (run.samples - 1))]
    return turned_lengths(machine.rows[i], vector, axes, run.step)


def _table(machine, i: int, vector: np.ndarray) -> np.ndarray:
    """A vector of run `i` as (samples, channels)."""
    return np.concatenate(machine.rows[i].split(vector), axis=1)


def _tangents(model: Any, point: Point, i: int) -> tuple[np.ndarray, dict[str, list[np.ndarray]]]:
    """The residual of run `i`, and by what is taken as constant its changes with those numbers.

    They are tables (samples, channels), per relative change of the number, or per unit of one that
    is 0.  The same quantity of all wheels is one entry, and so is every effect.  A wheel's radius
    scales its measured angle; that part of the change is left out, as the angle's noise would be
    compared with itself.
    """
    free = [f for f in model.free(point) if point.effects[f.effect].id != DRIFTS]
    values = np.array([value_of(point, f) for f in free])
    names, points, steps = [], [point], []  # steps in units of the numbers' sizes
    known, out, scaled = model.elastic_tangents(point, [i]), {}, {}
    for k, prior in enumerate(model.priors):
        head, *middle, last = prior.name.split(".")
        if head == CLOCK:
            continue
        name = ".".join([*middle[1:], last] if head == "wheel" else [head, *middle, last])
        size = prior.sigma / (1.0 if prior.relative else abs(prior.value) or 1.0)
        if k in known:
            out.setdefault(name, []).append(_table(model.machine, i, known[k] / size))
            continue
        if name == "radius":
            scaled[len(names)] = model.rig.names.index(middle[0]) - model.rig.size
        names.append(name)
        h = PRIOR_STEP if point.u[k] < 0 else -PRIOR_STEP
        points.append(moved(point, point.u + h * np.eye(len(point.u))[k], (), ()))
        steps.append(h * size)
    for k, (f, step) in enumerate(zip(free, steps_of(point, free), strict=True)):
        names.append(point.effects[f.effect].name)
        h = -step if values[k] + step > f.high else step
        points.append(moved(point, point.u, free, values + h * np.eye(len(free))[k]))
        steps.append(h / (abs(values[k]) or 1.0))
    here, *there = model.machine.residuals([model.rig_at(p) for p in points], [i])
    left = _table(model.machine, i, here)
    for k, (name, residual, step) in enumerate(zip(names, there, steps, strict=True)):
        if np.all(np.isfinite(residual)):
            table = _table(model.machine, i, (residual - here) / step)
            if k in scaled:
                table[:, scaled[k]] -= left[:, scaled[k]]
            out.setdefault(name, []).append(table)
    return here, out


def changing(tangents: dict[str, np.ndarray], least: float = 0.0) -> list[WhereQuestion]:
    """Whether numbers grow or fade over the run: their tangents (samples, k) times the time.

    Without what constant numbers explain of it.  Directions shorter than `least` are left out:
    measured angles enter the tangents, so noise of theirs does, and is what is left in theta.
    """
    if not tangents:
        return []
    every = np.concatenate([*tangents.values()], axis=1)
    kept = orthonormal(every, max(least, 1e-9 * _longest(every)))
    out = []
    for name, columns in tangents.items():
        ramp = np.linspace(-1, 1, len(columns))[:, None] * columns
        left = ramp - kept @ (kept.T @ ramp)
        own = orthonormal(left, max(least, OWN_SHARE * _longest(ramp)))
        if own.shape[1]:
            out.append(state(f"change {name}", own))
    return out


def _longest(columns: np.ndarray) -> float:
    """Length of the longest column."""
    return float(np.linalg.norm(columns, axis=0).max())


def _signals(machine, rig, i: int) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Angles of the wheels and of the sphere, and the states, at the samples of run `i`."""
    run, rotated = machine.runs[i], machine.rotated(rig, [i])[i]
    m = rotated.motion
    fine = (len(m.theta) - 1) // (run.samples - 1)
    theta, speed, turning = m.theta[::fine], m.speed[::fine], m.turning[::fine]
    angles = {n: theta[:, k] for k, n in enumerate(rig.names)}
    size = np.linalg.norm(turning, axis=1)
    angles["sphere"] = np.concatenate([[0.0], np.cumsum((size[1:] + size[:-1]) / 2) * run.step])
    felt = machine.signals(rig, i)
    states: dict[str, np.ndarray] = {"time s": run.time}
    for k, n in enumerate(rig.names):
        states[f"phase {n}"] = np.mod(theta[:, k], 2 * np.pi)
        states[f"speed {n}"] = np.abs(speed[:, k])
        states[f"direction {n}"] = np.sign(np.round(speed[:, k], DIGITS))
        states[f"load {n}"] = rotated.drive[::fine, k]
        states[f"deflection {n}"] = felt[::fine, k]
    return angles, states
