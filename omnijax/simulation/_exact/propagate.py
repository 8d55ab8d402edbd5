"""`propagate`: a whole trajectory at prescribed speeds without integrating in steps.

A long run is made in pieces of equal length: one program serves them all, and the memory that the
formulas need does not grow with the run.
"""

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ..._arrays import on_device
from ..._errors import InputError, tell
from ..._memory import SHARE, available, in_words
from ..._programs import kept
from ..._status import Status
from ...dynamics import TRANSLATIONS, Model, State, initial_memory
from ...rig import Rig, as_rig
from .._channels import trajectory
from .._drives import AbstractDrive, SpeedDrive, Values, as_times, drive_for
from .._padding import EXACT_PIECE, Gathered, RunPiece, padded, room, samples_of
from .._remarks import ends, remarks
from .._signals import Signal, Vector, is_constant, is_traced
from .._trajectory import Trajectory
from .attitude import attitudes, compose
from .constant import constant_response
from .expm import LEVELS, levels_needed
from .forcing import wheel_pieces
from .period_map import longest_passage
from .system import exact_obstacle
from .varying import Span, knots_within, rest_motion, varying_response, windowed


def propagation_obstacle(rig: Rig, drive: AbstractDrive, ts, model: str = "coupled") -> str | None:
    """Why `propagate` does not take this run, in words; None where it does."""
    if not isinstance(drive, SpeedDrive):
        return "motor torques drive the wheels"
    if not (is_constant(drive.speed) and is_constant(drive.force)) and is_traced(
        (drive.speed, rig.wheels.rollers, ts)
    ):
        return "changing speeds are not known while tracing"
    return exact_obstacle(rig, model)


def propagate(
    rig: Rig | str | Path,
    drive: SpeedDrive | Values,
    ts: Vector | float | str,
    *,
    model: str = "coupled",
) -> Trajectory:
    """Trajectory of `rig` at prescribed wheel speeds, in closed form; samples at `ts` (s).

    Rig, wheel speeds and sample times (or a duration) as `simulate` takes them.  Starts at ts[0]
    in static equilibrium, as `simulate` does, with the same channels (t, 3) and (t, n) in SI.  The
    cost does not depend on the contact's damping or stiffness.  Warns as `simulate` does.  Raises
    `InputError` for input that does not fit, and `ValueError` for a run that the closed form does
    not cover (`exact_obstacle` says why).

    Source: the paper's eqs. 32-42 at known speeds (`docs/theory.md`, prescribed speeds); Van
    Loan, IEEE Trans. Autom. Control 23 (1978).
    """
    rig, ts = as_rig(rig), as_times(ts)
    asked = drive_for(rig, drive)
    tell(remarks(rig, asked, ends(ts), model))
    return propagated(rig, asked, ts, model=model)


def propagated(rig: Rig, asked: AbstractDrive, ts, *, model: str = "coupled") -> Trajectory:
    """`propagate` of a drive that fits its rig, for studies: one of many runs warns of nothing."""
    if any(is_traced(x) for x in jax.tree.leaves((rig, asked, ts))):
        return _traced(rig, _covered(rig, asked, ts, model), ts, model)
    runs, samples = Gathered(len(ts)), min(EXACT_PIECE, room(len(ts)))
    for piece in propagate_in_pieces(rig, asked, np.asarray(ts), model=model, samples=samples):
        runs.add(piece.run)
    return runs.whole()


class Reached(NamedTuple):
    """What a run in closed form goes on from: its motion at a sample, SI."""

    motion: Float[Array, " m"]  # elastic state, memories, X, U
    attitude: Float[Array, "4"]


def propagate_in_pieces(
    rig: Rig,
    drive: AbstractDrive,
    ts: Float[np.ndarray, " t"],
    *,
    model: str = "coupled",
    begun: Reached | None = None,
    origin: float | None = None,
    samples: int = EXACT_PIECE,
) -> Iterator[RunPiece]:
    """The run of `propagate` in pieces of `samples`, each handed out as soon as it is there.

    The pieces' samples together are `ts`; a shorter piece is padded, so that all lengths of run are
    one program.  A run that goes on begins with `begun` at ts[0], which
    is not sampled again, and has the start time `origin`.  The memory needed does not grow with
    the length of the run.  Raises as `propagate`.
    """
    drive = _covered(rig, drive, ts, model)
    times = np.asarray(ts, float)
    start = on_device(times[0] if origin is None else origin)
    done = 0 if begun is None else 1
    steady = is_constant(drive.speed) and is_constant(drive.force)
    if begun is None:
        attitude = on_device([1.0, 0.0, 0.0, 0.0])
        motion = attitude[:0] if steady else _rest(rig, drive, start, model)
        begun = Reached(motion, attitude)
    reached: Reached = begun
    cuts = times[:: samples - 1]
    ahead = None if steady else _ahead(rig, drive, times, cuts, model)
    while done < len(times):
        first = max(done - 1, 0)
        part = times[first : first + samples]
        grid = padded(part, samples)
        if ahead is None:
            run, end = _constant(rig, drive, grid, start, reached.attitude, model)
        else:
            here = windowed(drive, part[0], part[-1], ahead.knots)
            run, end = _varying(
                rig, drive, here, grid, start, reached, model, ahead.counts, ahead.levels
            )
        yield RunPiece(samples_of(run, 0 if done == 0 else 1, len(part)), end)
        reached, done = end, first + len(part)


def reached_like(rig: Rig, drive: SpeedDrive, model: str = "coupled") -> Reached:
    """A `Reached` of the right shape."""
    steady = is_constant(drive.speed) and is_constant(drive.force)
    rest = (TRANSLATIONS[model](rig).rest(), initial_memory(rig))
    size = 0 if steady else len(ravel_pytree(rest)[0]) + 6
    return Reached(on_device(np.zeros(size)), on_device(np.zeros(4)))


def _covered(rig: Rig, drive: AbstractDrive, ts, model: str) -> SpeedDrive:
    """The drive of a run that the closed form covers; `ValueError` for another."""
    reason = propagation_obstacle(rig, drive, ts, model)
    if reason is not None:
        raise ValueError(f"no exact propagation: {reason}; use `simulate`.")
    assert isinstance(drive, SpeedDrive)  # other drives are an obstacle
    return drive


def _traced(rig: Rig, drive: SpeedDrive, ts, model: str) -> Trajectory:
    """The whole run at once: under a transformation."""
    attitude = jnp.array([1.0, 0.0, 0.0, 0.0])
    if is_constant(drive.speed) and is_constant(drive.force):
        return _constant(rig, drive, ts, ts[0], attitude, model)[0]
    ahead = _ahead(rig, drive, np.asarray(ts), np.asarray(ts[:1]), model)
    begun = Reached(_rest(rig, drive, ts[0], model), attitude)
    return _varying(rig, drive, drive, ts, ts[0], begun, model, ahead.counts, ahead.levels)[0]


BYTES_A_PERIOD = 8e3  # of what is prepared for a piece of a run


class _Ahead(NamedTuple):
    """What holds for every piece of a run, so that one program serves all."""

    counts: tuple[int, ...]  # periods that each wheel may pass between two knots
    levels: int  # of the ladder
    knots: int  # in the room for those of one piece


@jax.jit
def _speeds_at(speed: Signal, times: Float[Array, " k"]) -> tuple[Array, Array]:
    """Speeds and their slopes at some times."""
    return jax.vmap(speed)(times), jax.vmap(speed.rate)(times)


def _ahead(rig: Rig, drive: SpeedDrive, ts, cuts, model: str) -> _Ahead:
    ends = [cuts, np.asarray(ts[-1:])]
    inside = np.clip(np.asarray(drive.speed.knots), float(ts[0]), float(ts[-1]))
    knots = np.unique(np.concatenate([inside, *ends]))
    lasts = np.diff(knots)[:, None]
    early, rate = map(np.asarray, _speeds_at(drive.speed, knots[:-1]))
    fastest = np.maximum(np.abs(early), np.abs(early + rate * lasts))  # straight between knots
    turned = (fastest * lasts).max(axis=0, initial=0.0)
    shapes = [[pieces for pieces, _ in wheel_pieces(rig, i)] for i in range(rig.size)]
    periods = [min(float(jnp.sum(p.width)) for p in some) for some in shapes]
    passed = sum(a / p for a, p in zip(turned, periods, strict=True))
    if not BYTES_A_PERIOD * passed < SHARE * available():
        raise InputError(
            f"the wheels pass {passed:.3g} roller pitches between two knots of their speeds, which "
            f"needs {in_words(BYTES_A_PERIOD * passed)} of memory: turn slower, or add knots."
        )
    counts = tuple(int(np.ceil(a / p)) + 3 for a, p in zip(turned, periods, strict=True))
    step = float(np.diff(np.asarray(ts)).max(initial=1e-6))
    still = jnp.zeros(rig.size)
    levels = levels_needed(longest_passage(rig, still, still, model, jnp.asarray(step)))
    pieces = list(itertools.pairwise(np.concatenate(ends)))
    signals = (drive.speed, drive.force)
    most = max(len(knots_within(s, a, b)) for s in signals for a, b in pieces)
    return _Ahead(counts, levels, 1 << (most - 1).bit_length())


@kept
def _rest(rig: Rig, drive: SpeedDrive, start, model: str):
    return rest_motion(rig, drive, start, model)


@kept
def _varying(
    rig, drive, here, ts, origin, begun: Reached, model, counts, levels
) -> tuple[Trajectory, Reached]:
    """`here` is the drive as far as this piece needs it."""
    angles = drive.angle(ts[0], origin)
    span = Span(here, ts, origin, angles, begun.motion, begun.attitude)
    response = varying_response(rig, span, model, counts, levels, compose)
    run = _finish(rig, drive, ts, origin, model, response, response.attitude)
    motion = (response.state[-1], response.position[-1], response.drift[-1])
    return run, Reached(jnp.concatenate(motion), response.attitude[-1])


@kept
def _constant(
    rig: Rig, drive: SpeedDrive, ts, origin, attitude, model: str
) -> tuple[Trajectory, Reached]:
    """One program for every rig and speed: the ladder is as long as any rig's rates ask."""
    angles = jnp.zeros(rig.size) if drive.initial_angle is None else drive.initial_angle
    speeds, force = drive.speed.values[0], drive.force.values[0]
    response = constant_response(rig, speeds, angles, force, ts, model, None, LEVELS, origin)
    turned = attitudes(rig, drive, ts, response, attitude)
    run = _finish(rig, drive, ts, origin, model, response, turned)
    return run, Reached(attitude[:0], turned[-1])


def _finish(rig: Rig, drive: SpeedDrive, ts, origin, model: str, response, attitude) -> Trajectory:
    translation = TRANSLATIONS[model](rig)
    rest = (translation.rest(), initial_memory(rig))
    unravel = ravel_pytree(rest)[1]
    elastic, memory = jax.vmap(unravel)(response.state)
    count = len(ts)
    states = State(
        elastic=elastic,
        angle=jnp.zeros((count, rig.size)),  # the drive's own, filled in with the channels
        angular_velocity=jnp.zeros((count, 3)),
        attitude=attitude,
        position=response.position,
        drift=response.drift,
        memory=memory,
    )
    steps = jnp.zeros((), int)
    return trajectory(Model(translation), drive, ts, states, Status.OK, steps, "exact", origin)
