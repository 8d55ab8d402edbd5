"""Clocks of loggers: an output group may be read a little before or after angles and torques.

Loggers that are started together are off by parts of a millisecond.  Every group but theta has an
offset d of its own, y(t) = y(t - d), among the calibrated unknowns, with bounds: what is later than
they allow is a sensor's delay.  It reads what a run foretells, and so costs no run.

A logger may be started anew for every run.  Of several fitted runs there is the mean offset, and by
how far each is beside it, the last by what makes their sum 0.  Nothing that was fitted tells the
offsets of another run: those of held-out runs are fitted to these, as the state at a start is.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import ClassVar, TypeGuard

import numpy as np
from jaxtyping import Array, Float
from scipy.interpolate import BSpline
from scipy.ndimage import spline_filter1d

from ...laws import AbstractLaw, AbstractSensor, SensorDelay, SensorSignal
from ...rig import Rig, place_law
from .._search import Prior, number
from .._settings import SETTINGS

CLOCK = "clock"  # head of the unknowns' names
READ_LATE = ("dR", "Omega", "a")  # against theta and the torques
DEGREE = SETTINGS.clocks.degree
B_SPLINE = BSpline.basis_element(np.arange(-3.0, 4.0), extrapolate=False)
BEYOND_SAMPLES = SETTINGS.clocks.beyond_samples


class LoggerClock(AbstractSensor):
    """y(t) = y(t - d), d of either sign: a nuisance and no effect, so that no rig file knows it.

    One d for all runs, or one by run (`at_run`).
    """

    delay: Float[Array, "*runs"]

    id: ClassVar[str] = "logger-clock"


LATE_LAWS = (LoggerClock, SensorDelay)  # by which dR and a are read as late as they say


def only_delays(law: AbstractLaw) -> TypeGuard[LoggerClock | SensorDelay]:
    """Whether a sensor's law is one of `LATE_LAWS`; a class below them has a formula of its own."""
    return type(law) in LATE_LAWS


def clock_priors(
    groups, stated: set[str], runs: Mapping[str, Sequence[str]] = MappingProxyType({})
) -> list[Prior]:
    """The offset of every group at hand whose delay the rig file does not speak of.

    Where several fitted `runs` measured the group that is their mean; behind it stands by how far
    each is beside it, but the last one.
    """
    sigma = SETTINGS.prediction.clock_error
    most = SETTINGS.prediction.clock_most / sigma
    open_ = [g for g in READ_LATE if g in groups and f"sensor.{g}.delay" not in stated]
    names = [
        f"{CLOCK}.{g}{run}" for g in open_ for run in ("", *(f".{x}" for x in runs.get(g, [])[:-1]))
    ]
    return [
        Prior(name, 0.0, sigma, relative=False, hard=most, unit="s", limited=True)
        for name in names
    ]  # fmt: skip


def beside_mean(count: int) -> np.ndarray:
    """Offsets (runs, numbers) of a group by its numbers: the mean, and what is beside it."""
    table = np.concatenate([np.ones((count, 1)), np.eye(count)[:, :-1]], axis=1)
    table[-1, 1:] = -1.0
    return table


def with_clocks(rig: Rig, offsets: Mapping[str, float | np.ndarray], always: bool = False) -> Rig:
    """The rig whose output groups are read `offsets` s late, of all runs or by run.

    `always`: also those that are read at once.
    """
    laws = [
        place_law(LoggerClock(number(d)), group, rig.names, rig.profiles)
        for group, d in offsets.items() if always or np.any(d)
    ]  # fmt: skip
    return rig.with_effects((*laws, *rig.effects))


def at_run(rig: Rig, i: int, own: Mapping[str, float]) -> Rig:
    """The rig as run `i` is read: by its own offset of every clock; `own` are those by group of a
    run that was not fitted."""
    if not any(isinstance(p.law, LoggerClock) for p in rig.effects):
        return rig
    effects = []
    for p in rig.effects:
        if isinstance(p.law, LoggerClock):
            delay = np.asarray(p.law.delay)
            late = own.get(p.place, delay[i] if delay.ndim else delay)
            p = dataclasses.replace(p, law=LoggerClock(number(late)))  # noqa: PLW2901
        effects.append(p)
    return rig.with_effects(effects)


def offset_of(rig: Rig, group: str) -> float:
    """How late, in s, a group of the rig's outputs is read, by its logger's clock and its sensor.

    A delay may be taken first of all sensors' laws, if those before it act by so much earlier.
    """
    laws = [p.law for p in rig.at("sensor") if p.place == group]
    return sum(float(law.delay) for law in laws if only_delays(law))


def read_late(law: LoggerClock, signal: SensorSignal) -> np.ndarray:
    """What the offset adds to the values (t, c) of its signal: splines on the even time grid."""
    values, step = np.asarray(signal.values), float(signal.time[1] - signal.time[0])
    if not np.all(np.isfinite(values)):
        return np.zeros_like(values)
    return late_by(values.T, float(law.delay) / step).T - values


def late_by(rows: np.ndarray, samples: float) -> np.ndarray:
    """Rows (c, t) so many samples late: before the start as at the first sample.

    Behind the end they go on as their point reflection.  All samples lie equally far from a knot,
    so that a few weights of B-splines serve all.
    """
    beyond = BEYOND_SAMPLES + math.ceil(abs(samples))
    wide = np.pad(rows, ((0, 0), (beyond, beyond)), mode="reflect", reflect_type="odd")
    knots = spline_filter1d(wide, DEGREE, axis=1, mode="mirror")
    first = math.floor(-samples)
    near = np.arange(first - DEGREE // 2, first + DEGREE // 2 + 2)
    weights = B_SPLINE(-samples - near)
    count = rows.shape[1]
    parts = [knots[:, beyond + k : beyond + k + count] for k in near]
    late = np.tensordot(weights, np.stack(parts), 1)
    late[:, : max(0, math.ceil(samples))] = rows[:, :1]
    return late
