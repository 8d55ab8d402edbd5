"""What forces the elastic model: periodic signals, each with its rate, its pieces and its start."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...laws import (
    ContinuousSine,
    DamagedRoller,
    FloorVibration,
    Gap,
    Pieces,
    TableShape,
    WheelRunout,
    mirrored,
    padded,
    piece_at,
    shape_pieces,
    value,
)
from ...rig import Rig
from .._signals import is_traced

ROOM = 2.0  # times the work, where signals of unlike sizes go together
MAX_ROLLERS = 40  # room for the rollers of a turn where their number is not known ahead


class PeriodicSignal(NamedTuple):
    """One periodic signal in the direction in which it is passed through.

    `speed` is the rate of its angle (rad/s, positive) and `start` the angle at the run's start,
    both counted in the direction of motion; a wheel at rest is a constant signal.
    """

    pieces: Pieces
    speed: Float[Array, ""]
    start: Float[Array, ""]

    @property
    def period(self) -> Float[Array, "*signals"]:
        """Angle of one period, rad."""
        return jnp.sum(self.pieces.width, axis=-1)

    @property
    def duration(self) -> Float[Array, "*signals k"]:
        """Time in each piece, s."""
        return self.pieces.width / self.speed[..., None]


class Forcing(NamedTuple):
    """All signals stacked on the leading axis, and which wheel each belongs to (-1: the floor)."""

    cycle: PeriodicSignal
    wheel: tuple[int, ...]
    base: Float[Array, " g"]  # order of the first harmonic, in multiples of the wheel's rotation


def number(x) -> float | None:
    """The value of a scalar where it is known while tracing."""
    return None if is_traced(x) else float(np.asarray(x))


def directed(pieces: Pieces, speed, angle) -> PeriodicSignal:
    """The signal as the wheel passes through it: mirrored backwards, constant at rest."""
    back = mirrored(pieces)
    forward = speed >= 0
    pieces = jax.tree.map(lambda a, b: jnp.where(forward, a, b), pieces, back)
    period = jnp.sum(pieces.width)
    start = jnp.mod(jnp.where(forward, angle, -angle), period)
    start = jnp.where(start < period, start, start - period)  # of an angle just below 0
    here = value(pieces, *piece_at(pieces, start))
    rest = speed == 0
    constant = jnp.zeros_like(pieces.polynomial).at[:, 0].set(here)
    return PeriodicSignal(
        pieces._replace(
            polynomial=jnp.where(rest, constant, pieces.polynomial),
            cosine=jnp.where(rest, 0.0, pieces.cosine),
            sine=jnp.where(rest, 0.0, pieces.sine),
        ),
        jnp.where(rest, 1.0, jnp.abs(speed)),
        start,
    )


def _turn(pieces: Pieces, gap: Gap, repeats: int, damage, runouts) -> Pieces:
    """A whole turn: the profile repeated, scaled where a roller is damaged, and runout added.

    NaN for more rollers than there is room for, where their number is traced.
    """
    count = number(gap.rollers) if repeats == 0 else None
    rows = repeats or (MAX_ROLLERS if count is None else round(count))
    index = jnp.arange(rows)
    present = index < jnp.round(gap.rollers) if repeats == 0 else jnp.ones(rows, bool)
    fits = jnp.where(repeats or jnp.round(gap.rollers) <= rows, 1.0, jnp.nan)
    factor = 1 + sum(
        (jnp.where(index == jnp.round(law.roller), law.severity, 0.0) for law in damage),
        jnp.zeros(rows),
    )

    def repeated(x):
        return jnp.broadcast_to(x, (rows, *x.shape))

    scale = factor[:, None, None]
    turn = Pieces(
        repeated(pieces.width) * jnp.where(present, fits, 0.0)[:, None],
        repeated(pieces.polynomial) * scale,
        repeated(pieces.cosine) * scale,
        repeated(pieces.sine) * scale,
        repeated(pieces.frequency),
    )
    turn = jax.tree.map(lambda x: x.reshape(x.shape[0] * x.shape[1], *x.shape[2:]), turn)
    begin = jnp.cumsum(turn.width) - turn.width
    for law in runouts:  # A cos(theta - phi) = A cos(begin - phi + width v)
        phase = begin - law.phase
        turn = turn._replace(
            cosine=jnp.concatenate([turn.cosine, law.amplitude * jnp.cos(phase)[:, None]], 1),
            sine=jnp.concatenate([turn.sine, -law.amplitude * jnp.sin(phase)[:, None]], 1),
            frequency=jnp.concatenate([turn.frequency, turn.width[:, None]], 1),
        )
    return turn


def period_kind(rig: Rig, i: int) -> str:
    """`pitch`, `turn` or `own`: what the period of wheel i's profile is.

    Of a table that is traced its word is taken; else one that fits neither has a period of its own.
    """
    profile = rig.profiles[i]
    if isinstance(profile, ContinuousSine):
        return "own"
    if not isinstance(profile, TableShape):
        return "pitch"
    if profile.whole_turn:
        return "turn"
    gap = jax.tree.map(lambda x: x[i], rig.gaps)
    period, pitch = number(profile.knots[-1]), number(gap.pitch)
    if period is None or pitch is None or math.isclose(period, pitch, rel_tol=1e-6):
        return "pitch"
    return "own"


def wheel_pieces(rig: Rig, i: int) -> list[tuple[Pieces, Array]]:
    """Signals of wheel i with their base orders: one, or two where a period fits no turn."""
    gap = jax.tree.map(lambda x: x[i], rig.gaps)
    profile = rig.profiles[i]
    pieces = shape_pieces(profile, gap)
    if pieces is None:
        raise ValueError(f"wheel {rig.names[i]} has a profile without closed form.")
    laws = [placed.law for placed in rig.at("shape") if i in placed.wheels]
    damage = [law for law in laws if isinstance(law, DamagedRoller)]
    runouts = [law for law in laws if isinstance(law, WheelRunout)]
    kind = period_kind(rig, i)
    period = jnp.sum(pieces.width)
    if not laws:
        return [(pieces, 2 * math.pi / period)]
    if kind == "own":
        flat = Pieces(
            jnp.full(1, 2 * math.pi), jnp.zeros((1, 1)), *(jnp.zeros((1, 0)) for _ in range(3))
        )
        return [
            (pieces, 2 * math.pi / period),
            (_turn(flat, gap, 1, [], runouts), jnp.ones(())),
        ]
    repeats = 1 if kind == "turn" else 0
    return [(_turn(pieces, gap, repeats, damage, runouts), jnp.ones(()))]


def room_obstacle(rig: Rig, i: int) -> str | None:
    """That wheel i, one pitch long with a law on it, has more rollers than a turn has room for."""
    count = number(rig.wheels.rollers[i])
    if count is None or count <= MAX_ROLLERS:
        return None
    return (
        f"wheel {rig.names[i]} has {count:g} rollers and a law on its shape, for which the closed "
        f"form has room for {MAX_ROLLERS}"
    )


def _floor_pieces(law: FloorVibration) -> tuple[Pieces, Array, Array]:
    one = jnp.ones((1, 1))
    pieces = Pieces(
        jnp.full(1, 2 * math.pi), jnp.zeros((1, 1)), 0 * one, law.amplitude * one, 2 * math.pi * one
    )
    return pieces, 2 * math.pi * law.frequency, jnp.asarray(law.phase, float)


class ForcingSignal(NamedTuple):
    """One signal as the wheel passes it, or the floor's (wheel -1)."""

    pieces: Pieces
    speed: Array
    angle: Array
    wheel: int
    base: Array  # order of its first harmonic

    @property
    def size(self) -> tuple[int, int, int]:
        """Pieces, powers and waves."""
        return len(self.pieces.width), self.pieces.polynomial.shape[1], self.pieces.sine.shape[1]


def forcing_signals(
    rig: Rig, speeds: Float[Array, " n"], angles: Float[Array, " n"]
) -> list[ForcingSignal]:
    """Every signal that forces the rig at constant `speeds` (rad/s) from `angles` (rad)."""
    signals = [
        ForcingSignal(pieces, speeds[i], angles[i], i, order)
        for i in range(rig.size)
        for pieces, order in wheel_pieces(rig, i)
    ]
    floors: list[Any] = [placed.law for placed in rig.at("platform")]
    return signals + [ForcingSignal(*_floor_pieces(law), -1, jnp.ones(())) for law in floors]


def stacked(signals: Sequence[ForcingSignal]) -> Forcing:
    """Signals beside each other, each with room for as much as any of them has."""
    count, powers, waves = np.max([signal.size for signal in signals], axis=0)
    cycles = [
        directed(padded(s.pieces, count, powers - 1, waves), s.speed, s.angle) for s in signals
    ]
    together = jax.tree.map(lambda *xs: jnp.stack(xs), *cycles)
    base = jnp.stack([jnp.asarray(s.base, float) for s in signals])
    return Forcing(together, tuple(s.wheel for s in signals), base)


def forcing(rig: Rig, speeds: Float[Array, " n"], angles: Float[Array, " n"]) -> Forcing:
    """`forcing_signals` the rig, stacked."""
    return stacked(forcing_signals(rig, speeds, angles))


def like_groups(signals: Sequence[ForcingSignal], states: int) -> list[np.ndarray]:
    """Numbers of signals in groups of like sizes; the first group has the first one.

    Work on a piece grows with the cube of its terms beside `states` of the elastic model.  One
    group does where the room for the largest signal costs the others less than `ROOM` times that.
    """
    sizes = [signal.size for signal in signals]

    def work(size) -> float:
        pieces, powers, waves = size
        return float(pieces * (states + powers + 2 * waves) ** 3)

    if len(signals) * work(np.max(sizes, axis=0)) <= ROOM * sum(map(work, sizes)):
        return [np.arange(len(signals))]
    return [np.flatnonzero([s == size for s in sizes]) for size in dict.fromkeys(sizes)]
