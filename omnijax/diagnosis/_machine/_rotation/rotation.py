"""Rotation along a run: torques of the laws, and the response to torques, read off `dynamics`."""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from ...._programs import kept
from ....dynamics import (
    Rolling,
    RotationMoment,
    Torques,
    TurningLaws,
    command_times,
    inertia_at,
    rotation_response,
    torques,
)
from ....rig import Acting, Rig
from .._elastic import acts, refine
from .._laws import bare, follow
from .._motion import RunMotion, rolling_radius
from ..runs import FINE, Run


@dataclasses.dataclass(frozen=True)
class MeasuredTurning:
    """Linear response of one run's rotation to torques (spec section 4)."""

    response: np.ndarray  # (n + 3, t, n + 3): of a unit torque on each shaft, opposing each axis
    axes: np.ndarray  # (t or 1, n, 3)

    def thin(self, step: int) -> "MeasuredTurning":
        """The same at every `step`-th time."""
        axes = self.axes if len(self.axes) == 1 else self.axes[::step]
        return MeasuredTurning(self.response[:, ::step], axes)

    @functools.cached_property
    def rates(self) -> np.ndarray:
        """dOmega/dt (t, n + 3, 3) of a unit torque on each shaft, then opposing each axis."""
        return np.moveaxis(self.response[:, :, -3:], 0, 1)

    def respond(self, shaft: np.ndarray | None, opposing: np.ndarray | None):
        """(drive forces (t, n), dOmega/dt (t, 3)) caused by torques (t, n) and (t, 3)."""
        n = len(self.response) - 3
        out = np.zeros(self.response.shape[1:])
        for torque, responses in ((shaft, self.response[:n]), (opposing, self.response[n:])):
            if torque is None:
                continue
            for k, response in enumerate(responses):
                if acts(torque[:, k]):
                    out += response * torque[:, k : k + 1]
        return out[:, :n], out[:, n:]


def isotropic(rig: Rig) -> bool:
    """Whether the sphere's inertia is a multiple of the unit matrix: attitude does not matter."""
    inertia = np.asarray(rig.sphere.inertia_matrix)
    return bool(np.all(inertia == inertia[0, 0] * np.eye(3)))


def attitude_matters(rig: Rig) -> bool:
    """Whether the sphere's torques or its inertia hang on how it lies."""
    unlike = not isotropic(rig) or np.any(np.asarray(rig.sphere.centre_of_mass))
    return bool(unlike or rig.at("sphere"))


def turning(rig: Rig, run: Run, motion: RunMotion) -> MeasuredTurning:
    """The response along one run's motion."""
    attitude = np.eye(3)[None] if isotropic(rig) else motion.attitude
    radius = rolling_radius(rig, motion)
    response = _responses(bare(rig), *map(run.as_longest, (radius, motion.axes, attitude)))
    return MeasuredTurning(np.asarray(response)[:, : len(radius)], motion.axes)


@kept
def _responses(rig: Rig, radius, axes, attitude):
    def at(radius, axes, attitude):
        inertia = inertia_at(rig.sphere.inertia_matrix, attitude)
        return rotation_response(rig, Rolling(radius, axes), inertia)

    (axes, axes_in), (attitude, attitude_in) = _held(axes), _held(attitude)
    return jax.vmap(at, (0, axes_in, attitude_in), 1)(radius, axes, attitude)


def commanded(rig: Rig, run: Run) -> np.ndarray:
    """Torques (FINE points, n) whose turn it is, linear between samples."""
    torque, placed = refine(run.torque, FINE), rig.at("command")
    if not placed:
        return torque
    fine = run.fine(FINE)
    times = np.asarray(_command_times(placed, run.as_longest(fine), rig.size))[: len(fine)]
    return np.stack([np.interp(times[:, k], fine, torque[:, k]) for k in range(rig.size)], axis=1)


@kept
def _command_times(placed, fine, size: int):
    return jax.vmap(lambda t: command_times(placed, t, size))(fine)


def rotation_moments(rig: Rig, m: RunMotion, command: np.ndarray, normal: np.ndarray):
    """What laws that act on the rotation feel along a motion; one entry where nothing changes."""
    attitude = m.attitude if attitude_matters(rig) else np.eye(3)[None]
    felt = (m.axes, attitude, m.turning, m.theta, m.speed, command, command, normal)
    return RotationMoment(*felt)  # pyright: ignore[reportArgumentType]


def run_torques(rig: Rig, run: Run, at: RotationMoment) -> tuple[RotationMoment, Torques]:
    """The moments with what is delivered, and torques (t, n), (t, 3) with all laws of the rig."""
    laws = TurningLaws.of(rig, masked=True)
    memory = laws.rest(rig.size)
    apply = functools.partial(each_moment, run)
    at, total, _ = torques(bare(rig), laws, at, memory, apply)
    return at, total


def each_moment(run: Run, function, rig: Rig, law: Any, at: RotationMoment, memory: Any):
    """`function` of one law at its port, for all moments; and None, in place of memories' rates.

    Memories are followed along the moments, evenly as many a sample of the run.
    """
    moving, still, step, count = _parted(run, at)
    out = _each(function, rig, law, moving, still, memory, step)
    return jax.tree.map(lambda x: np.asarray(x)[:count], out), None


def each_law(run: Run, function, rig: Rig, laws: Sequence[Acting], at: RotationMoment):
    """Tuples of what a port's `function` gives of each of `laws`, for all moments.

    Laws of one structure, side by side.
    """
    moving, still, step, count = _parted(run, at)
    some = jax.tree.map(lambda *x: np.stack(x), *[(law, law.rest(rig.size)) for law in laws])
    out = _side_by_side(function, rig, some, moving, still, step)
    out = jax.tree.map(lambda x: np.asarray(x)[:, :count], out)
    out = out if isinstance(out, tuple) else (out,)
    return [tuple(x[k] for x in out) for k in range(len(laws))]


@kept
def _side_by_side(function, rig, laws, moving, still, step):
    return jax.vmap(lambda x: _along(function, rig, x[0], moving, still, x[1], step))(laws)


@kept
def _each(function, rig, law, moving, still, memory, step):
    return _along(function, rig, law, moving, still, memory, step)


def _along(function, rig, law, moving, still, memory, step):
    def rule(now, state):
        return function(rig, law, _whole(now, still), state)

    if memory is None:
        return jax.vmap(lambda now: rule(now, None)[0])(moving)
    return follow(rule, moving, memory, step)


def _held(values):
    """(`values`, the axis of time) for `vmap`; one entry of an array that holds for all times."""
    return (values[0], None) if len(values) == 1 else (values, 0)


def _parted(run: Run, at: RotationMoment) -> tuple[RotationMoment, RotationMoment, np.ndarray, int]:
    """What changes in time, and what holds for all times; None in its place in the other.

    The first led on to the longest run's end; with s between two moments, and their number.
    """
    still, count = [len(x) == 1 for x in at], max(map(len, at))
    led_on = [x if s else run.as_longest(np.asarray(x)) for x, s in zip(at, still, strict=True)]
    return (
        RotationMoment(*(None if s else x for x, s in zip(led_on, still, strict=True))),  # pyright: ignore
        RotationMoment(*(x[0] if s else None for x, s in zip(at, still, strict=True))),  # pyright: ignore
        np.asarray(run.step * (run.samples - 1) / (count - 1)),
        count,
    )


def _whole(now: RotationMoment, still: RotationMoment) -> RotationMoment:
    return RotationMoment(*(s if x is None else x for x, s in zip(now, still, strict=True)))
