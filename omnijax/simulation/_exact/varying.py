"""Exact propagation at speeds that change: steps, ramps and tables, with located gap edges.

Angles are quadratics in time between the drive's knots, so the times of all edges follow from
square roots.  Between two neighbouring times (edges, knots, samples) every input is smooth: its
Chebyshev interpolant enters the generator of one autonomous system, whose exponential is exact.

Drive forces need d(r_w omega)/dt; as at constant speed only r_w omega itself enters, by
y = s + B1 (r_w omega), s kept apart on each interval so that jumps of the speed move nothing.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ..._arrays import on_device
from ...dynamics import TRANSLATIONS, floor, initial_memory, pseudoinverse, rolling_radius
from ...laws import Pieces, chebyshev_nodes, piece_at, to_powers, value
from ...rig import Rig
from .._drives import SpeedDrive
from .._signals import Signal
from .expm import squarings
from .forcing import wheel_pieces
from .system import drive_gain, responses, state_units, static_rest

DEGREE = 20  # of the inputs on one interval: exact to rounding over a whole gap's sinusoid


class VaryingInputs(NamedTuple):
    """A, and B of every input: rho, r_w omega (by A B1), floor acceleration, platform force."""

    A: Float[Array, "m m"]
    B: Float[Array, "m u"]
    shift: Float[Array, "m n"]  # B1
    unit: Float[Array, " m"]  # SI value of one unit of each state
    rest: Float[Array, "m n"]  # y at static equilibrium per rho


def _inputs(rig: Rig, model: str) -> VaryingInputs:
    """The elastic model with the platform's place X and drift U as six more states."""
    translation = TRANSLATIONS[model](rig)
    respond = responses(translation, drive_gain(rig, jnp.ones(rig.size), creep=False))
    y = ravel_pytree((translation.rest(), initial_memory(rig)))[0]
    n, m = rig.size, len(y)
    zero = (y, jnp.zeros(n), jnp.zeros(n), jnp.zeros(3), jnp.zeros(3))
    (A, B0, B1, floor_in, force_in), out = jax.jacfwd(respond, argnums=(0, 1, 2, 3, 4))(*zero)
    X, U = out["platform"], out["drift"]
    whole = jnp.zeros((m + 6, m + 6)).at[:m, :m].set(A).at[m : m + 3, :m].set(X[0])
    whole = whole.at[m : m + 3, m + 3 :].set(jnp.eye(3))
    shift = jnp.pad(B1, ((0, 6), (0, 0)))
    columns = [
        jnp.concatenate([B0, X[1], jnp.zeros((3, n))]),
        whole @ shift,
        jnp.concatenate([floor_in, X[3], U[3]]),
        jnp.concatenate([force_in, X[4], U[4]]),
    ]
    rest = jnp.pad(static_rest(rig, model, A, B0), ((0, 6), (0, 0)))
    unit = state_units(whole)
    low = unit[:, None]
    columns = jnp.concatenate(columns, axis=1)
    return VaryingInputs(whole * unit / low, columns / low, shift / low, unit, rest / low)


class Legs(NamedTuple):
    """Stretches of one wheel's motion without a turn: angle = a + w t + acceleration t^2/2."""

    time: Float[Array, " l"]  # s, where the leg begins
    length: Float[Array, " l"]  # s
    angle: Float[Array, " l"]
    speed: Float[Array, " l"]
    acceleration: Float[Array, " l"]


def _legs(drive: SpeedDrive, start, until, wheel: int, first) -> Legs:
    """Two legs between neighbouring knots: before and after the wheel turns round."""
    knots = jnp.clip(drive.speed.knots, start, until)
    begin = jnp.concatenate([jnp.stack([start]), knots])
    end = jnp.concatenate([knots, jnp.stack([until])])
    middle = 0.5 * (begin + end)
    rate = jax.vmap(drive.speed.rate)(middle)[:, wheel]
    speed = jax.vmap(drive.speed)(middle)[:, wheel] - rate * (middle - begin)
    turns = rate * speed < 0
    turn = jnp.where(turns, -speed / jnp.where(turns, rate, 1.0), jnp.inf)
    half = jnp.minimum(turn, end - begin)
    time = jnp.stack([begin, begin + half], axis=1).reshape(-1)
    length = jnp.stack([half, end - begin - half], axis=1).reshape(-1)
    speeds = jnp.stack([speed, speed + rate * half], axis=1).reshape(-1)
    rates = jnp.repeat(rate, 2)
    moved = speeds * length + 0.5 * rates * length**2
    angle = first + jnp.cumsum(moved) - moved
    return Legs(time, length, angle, speeds, rates)


def _edge_times(legs: Legs, pieces: Pieces, count: int) -> Float[Array, " e"]:
    """Times at which one wheel passes an edge; those beyond a leg's end fall on its end.

    The nearer root of a + w t + acc t^2/2 = edge is 2 d/(w + sign sqrt(w^2 + 2 acc d)).
    """
    period, edges = jnp.sum(pieces.width), jnp.cumsum(pieces.width)

    def leg(time, length, angle, speed, acceleration):
        ahead = jnp.where(speed + acceleration * length / 2 >= 0, 1.0, -1.0)
        base = jnp.floor(jax.lax.stop_gradient(angle / period))
        number = base + ahead * jnp.arange(-1, count - 1)
        target = (number[:, None] * period + edges[None, :]).reshape(-1)
        distance = target - angle
        square = speed**2 + 2 * acceleration * distance
        real = (square > 0) & (distance * ahead > 0)
        root = jnp.sqrt(jnp.where(real, square, 1.0))
        below = jnp.where(real, speed + ahead * root, 1.0)
        after = 2 * distance / jnp.where(below == 0, 1.0, below)
        return time + jnp.where(real & (after > 0) & (after < length), after, length)

    return jax.vmap(leg)(*legs).reshape(-1)


class Span(NamedTuple):
    """One piece of a run, and what it goes on from."""

    drive: SpeedDrive
    ts: Float[Array, " t"]  # s; the piece begins at the first
    origin: Float[Array, ""]  # s, where the run began
    angles: Float[Array, " n"]  # of the wheels at the piece's begin
    motion: Float[Array, " m"]  # there, SI: elastic state, memories, X, U
    attitude: Float[Array, "4"]


class Setting(NamedTuple):
    """What the inputs are read from."""

    rig: Rig
    span: Span
    pieces: list[list[Pieces]]  # of each wheel


def knots_within(signal: Signal, start: float, until: float) -> np.ndarray:
    """Numbers of the knots that a signal needs on [start, until]."""
    knots = np.asarray(signal.knots)
    first = max(int(np.searchsorted(knots, start, side="right")) - 1, 0)
    return np.arange(first, max(int(np.searchsorted(knots, until, side="right")), first + 1))


def windowed(drive: SpeedDrive, start: float, until: float, count: int) -> SpeedDrive:
    """The drive's signals on [start, until] alone, with `count` knots: the first is repeated."""

    def cut(signal: Signal) -> Signal:
        at = knots_within(signal, start, until)
        at = np.pad(at, (count - len(at), 0), mode="edge")
        return jax.tree.map(lambda x: on_device(np.asarray(x)[at]), signal)

    return SpeedDrive(speed=cut(drive.speed), force=cut(drive.force), initial_angle=None)


def rest_motion(rig: Rig, drive: SpeedDrive, start, model: str) -> Float[Array, " m"]:
    """Static equilibrium at the time `start` (s), SI: elastic state, memories, X, U."""
    angles = jnp.zeros(rig.size) if drive.initial_angle is None else drive.initial_angle
    system = _inputs(rig, model)
    span = Span(drive, start[None], start, angles, system.unit, jnp.zeros(4))
    first = _read(Setting(rig, span, _shapes(rig)), start, start, -1.0)
    return system.rest @ first[: rig.size] * system.unit


def _shapes(rig: Rig) -> list[list[Pieces]]:
    return [[pieces for pieces, _ in wheel_pieces(rig, i)] for i in range(rig.size)]


def _read(setting: Setting, a, b, x):
    """Inputs (u,) at x in [-1, 1] of the interval [a, b], by the formulas of its middle."""
    rig, span = setting.rig, setting.span
    drive, start = span.drive, span.ts[0]
    t, middle = a + (b - a) * (x + 1) / 2, jax.lax.stop_gradient((a + b) / 2)
    rate = drive.speed.rate(middle)
    speed = drive.speed(middle) + rate * (t - middle)
    turned = span.angles + drive.speed.integral(middle) - drive.speed.integral(start)
    angle = turned + drive.speed(middle) * (t - middle) + 0.5 * rate * (t - middle) ** 2
    rho = []
    for i, shapes in enumerate(setting.pieces):
        rho.append(sum(_shape(p, jax.lax.stop_gradient(turned[i]), angle[i]) for p in shapes))
    rho = jnp.stack(rho)
    radius = rolling_radius(rig, rho, speed)
    force = drive.force(middle) + drive.force.rate(middle) * (t - middle)
    return jnp.concatenate([rho, radius * speed, floor(rig, t - span.origin), force])


def _shape(pieces: Pieces, here, angle):
    """rho at `angle` by the formula of the piece that holds at the angle `here`."""
    period = jnp.sum(pieces.width)
    turns = jnp.floor(jax.lax.stop_gradient(here / period))
    index, _ = piece_at(pieces, here - turns * jax.lax.stop_gradient(period))
    width = pieces.width[index]
    begin = jnp.cumsum(pieces.width)[index] - width
    v = (angle - turns * period - begin) / jnp.where(width > 0, width, 1.0)
    return value(pieces, index, jnp.where(width > 0, v, 0.0))


class Varying(NamedTuple):
    """Response at the samples, SI units."""

    state: Float[Array, "t m"]
    position: Float[Array, "t 3"]
    drift: Float[Array, "t 3"]
    attitude: Float[Array, "t 4"]


def _times(setting: Setting, counts) -> Float[Array, " i"]:
    """Samples, knots, turns and gap edges in order."""
    drive, ts = setting.span.drive, setting.span.ts
    start, until = ts[0], ts[-1]
    times = [ts, *(jnp.clip(s.knots, start, until) for s in (drive.speed, drive.force))]
    for i, shapes in enumerate(setting.pieces):
        legs = _legs(drive, start, until, i, setting.span.angles[i])
        times += [legs.time, *(_edge_times(legs, p, counts[i]) for p in shapes)]
    return jnp.sort(jnp.concatenate(times))


def varying_response(rig: Rig, span: Span, model: str, counts, levels, compose) -> Varying:
    """Response at the span's times; `counts` are the periods that a wheel may pass on a leg."""
    setting = Setting(rig, span, _shapes(rig))
    times = _times(setting, counts)
    system = _inputs(rig, model)
    from_nodes, ends = jnp.asarray(to_powers(DEGREE)), jnp.array([-1.0, 1.0])
    n, size = rig.size, len(system.A)
    powers = np.zeros((DEGREE + 1, DEGREE + 1))
    powers[np.arange(1, DEGREE + 1), np.arange(DEGREE)] = 2 * np.arange(1, DEGREE + 1)
    terms = jnp.asarray((-1.0) ** np.arange(DEGREE + 1))
    to_sphere = pseudoinverse(rig.wheels.spin_axis) / rig.sphere.radius
    gauss, weight = np.polynomial.legendre.leggauss(8)

    def on(y, interval):
        a, b = interval
        h = b - a
        read = jax.vmap(lambda x: _read(setting, a, b, x))
        coefficients = from_nodes @ read(jnp.asarray(chebyshev_nodes(DEGREE)))
        edge = read(ends)[:, n : 2 * n] @ system.shift.T
        F = jnp.zeros((size + DEGREE + 1,) * 2).at[:size, :size].set(h * system.A)
        F = F.at[:size, size:].set(h * system.B @ coefficients.T).at[size:, size:].set(powers)
        rungs, _ = squarings(F, size, 0, levels)
        z = rungs[-1] @ jnp.concatenate([y - edge[0], terms])
        y = z[:size] + edge[1]
        spin = read(jnp.asarray(gauss))[:, n : 2 * n] @ to_sphere.T
        whole = h / 2 * jnp.asarray(weight) @ spin
        moment = h / 4 * jnp.asarray(weight * gauss) @ spin  # over h^2: h J = moment h
        return y, (y, whole + jnp.cross(moment, whole))

    y0 = span.motion / system.unit
    states, turns = jax.lax.scan(on, y0, (times[:-1], times[1:]))[1]
    states = jnp.concatenate([y0[None], states])
    at = jnp.searchsorted(jax.lax.stop_gradient(times), jax.lax.stop_gradient(span.ts))
    y = states[at] * system.unit
    m = size - 6
    return Varying(y[:, :m], y[:, m : m + 3], y[:, m + 3 :], compose(turns, span.attitude)[at])
