"""What forces the elastic model at constant speeds: signals that are sums of sinusoids, by pieces.

A signal drives one input column.  While it is on piece k, begun a time tau ago,

    rho = sum_v cosine[v, k] cos(rate[v] tau) + sine[v, k] sin(rate[v] tau)

A gap profile has its active pieces and a silent one, period after period; a runout, a vibrating
floor or a force on the platform is one piece without end.  A damaged roller is one more gap
profile that comes once a turn.  A measured table is none of these: see `table_signals`.
"""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...laws import ContinuousSine, DamagedRoller, GatedSine, Rollers, TableShape, WheelRunout
from ...rig import Rig
from .table_signals import TableSignals, table_signals

NODES = 64  # of the sum that gives the series of `rollers`
FOREVER = 1e30  # s, length of a piece that no wheel leaves
CONSTANT = -1  # the phase of a constant force: none
SILENT = -2  # of a signal that is 0


class Kind(NamedTuple):
    """What is static about a signal: its input column, its pieces and its sinusoids."""

    column: int
    pieces: int
    waves: int
    phase: int  # number of the phase that it runs with, or one of the two above


class Signals(NamedTuple):
    """All signals of a design: those with edges first (g), all sinusoids beside each other (v)."""

    duration: Float[Array, "g k *c"]  # s, of each piece
    piece: Float[Array, " g *c"]  # number of the piece at the start
    since: Float[Array, " g *c"]  # s, since it began
    rate: Float[Array, " v *c"]  # rad/s
    cosine: Float[Array, "v k *c"]
    sine: Float[Array, "v k *c"]
    tables: TableSignals | None = None


class SignalShape(NamedTuple):
    """One period over the angle: widths (k), frequencies (w) in waves' rad a rad, amplitudes."""

    width: Float[Array, " k"]
    frequency: Float[Array, " w"]
    cosine: Float[Array, "k w"]
    sine: Float[Array, "k w"]


def series_needed(ratio: float) -> int:
    """Terms of the series of `rollers` at a radius ratio r_b/R."""
    return 1 + math.ceil(26 / -math.log(min(ratio, 0.99) ** 2 / 4))


def _gap_shape(profile, gap, period, series: int) -> SignalShape:
    """Active pieces of a gap and the silent rest of `period`."""
    width = gap.width
    safe, zero = jnp.where(width > 0, width, 1.0), jnp.zeros(())
    rest = period - width
    if isinstance(profile, Rollers):
        return _rollers(gap, rest, series)
    turns = 2 * math.pi if isinstance(profile, GatedSine) else math.pi
    depth = jnp.where(width > 0, gap.depth, 0.0)
    return SignalShape(
        jnp.stack([width, rest]),
        (turns / safe)[None],
        jnp.zeros((2, 1)),
        jnp.stack([-depth, zero])[:, None],
    )


def _rollers(gap, rest, terms: int) -> SignalShape:
    """r_b (cos a - 1) + R (sqrt(1 - q^2) - 1), q = (r_b/R) sin a, to mid-gap and back."""
    a = math.pi * np.arange(NODES) / NODES
    q = gap.wheel_radius / gap.sphere_radius * np.sin(a)
    sphere = -gap.sphere_radius * q * q / (1 + jnp.sqrt(1 - q * q))
    k = np.arange(terms)
    series = np.cos(2 * k[:, None] * a) * np.where(k == 0, 1, 2)[:, None] / NODES @ sphere
    level = (series[0] - gap.wheel_radius)[None]
    down = jnp.concatenate([level, gap.wheel_radius[None], series[1:]])
    frequency = jnp.asarray(np.concatenate([[0.0, 1.0], 2.0 * k[1:]]))
    half = gap.width / 2
    up = down * jnp.cos(frequency * half), down * jnp.sin(frequency * half)
    none = jnp.zeros_like(down)
    return SignalShape(
        jnp.stack([half, half, rest]),
        frequency,
        jnp.stack([down, up[0], none]),
        jnp.stack([none, up[1], none]),
    )


def _mirrored(shape: SignalShape) -> SignalShape:
    """The shape for a wheel that turns backwards."""
    phase = shape.width[:, None] * shape.frequency
    cos, sin = jnp.cos(phase), jnp.sin(phase)
    cosine = shape.cosine * cos + shape.sine * sin
    sine = shape.cosine * sin - shape.sine * cos
    return SignalShape(shape.width[::-1], shape.frequency, cosine[::-1], sine[::-1])


def _place(shape: SignalShape, angle):
    """Number of the piece at `angle` and the angle since it began."""
    place = jnp.mod(angle, jnp.sum(shape.width))
    ends = jnp.cumsum(shape.width)
    number = jnp.minimum(jnp.sum(ends[:-1] <= place), len(ends) - 1)
    return number, place - (ends[number] - shape.width[number])


def _passed(shape: SignalShape, speed, angle):
    """Durations, rates, amplitudes, piece and time since its begin, as the wheel passes it."""
    forward, rest = speed >= 0, speed == 0
    shape = jax.tree.map(lambda a, b: jnp.where(forward, a, b), shape, _mirrored(shape))
    pace = jnp.where(rest, 1.0, jnp.abs(speed))
    number, into = _place(shape, jnp.where(forward, angle, -angle))
    phase = shape.frequency * into
    level = shape.cosine[number] @ jnp.cos(phase) + shape.sine[number] @ jnp.sin(phase)
    still = jnp.zeros_like(shape.cosine).at[:, 0].set(level)
    return (
        jnp.where(rest, FOREVER, shape.width / pace),
        jnp.where(rest, 0.0, shape.frequency * pace),
        jnp.where(rest, still, shape.cosine),
        jnp.where(rest, 0.0, shape.sine),
        number.astype(float),
        jnp.where(rest, 0.0, into / pace),
    )


def _silent():
    """The same of a signal that is 0 on one piece without end."""
    none = jnp.zeros((1, 1))
    return _passed(SignalShape(jnp.ones(1), jnp.zeros(1), none, none), jnp.zeros(()), 0.0)


def _gapped(rig: Rig, i: int, series: int):
    """Shapes with gaps of wheel i, each with the angle at which its period begins."""
    gap, profile = jax.tree.map(lambda x: x[i], rig.gaps), rig.profiles[i]
    if not isinstance(profile, ContinuousSine | TableShape):
        yield _gap_shape(profile, gap, gap.pitch, series), 0.0
    for placed in rig.at("shape"):
        if i in placed.wheels and isinstance(placed.law, DamagedRoller):
            roller = jnp.round(placed.law.roller)
            scale = jnp.where(roller < gap.rollers, placed.law.severity, 0.0)
            shape = _gap_shape(profile, gap, 2 * math.pi, series)
            scaled = shape._replace(cosine=shape.cosine * scale, sine=shape.sine * scale)
            yield scaled, roller * gap.pitch


def _endless(rig: Rig, speeds, angles, force: bool):
    """(column, rate, cosine, sine, phase) of the signals without edges."""
    for i in range(rig.size):
        gap, profile = jax.tree.map(lambda x, i=i: x[i], rig.gaps), rig.profiles[i]
        waves = []  # A cos(frequency angle + phase)
        if isinstance(profile, ContinuousSine):
            eta = jnp.where(gap.roundness > 0, gap.roundness, 1.0)
            waves.append((gap.rollers / eta, gap.depth, math.pi / 2))
        for placed in rig.at("shape"):
            if i in placed.wheels and isinstance(placed.law, WheelRunout):
                waves.append((jnp.ones(()), placed.law.amplitude, -placed.law.phase))
        alone = isinstance(profile, ContinuousSine)  # its period fits no turn
        for number, (frequency, amplitude, phase) in enumerate(waves):
            at, own = frequency * angles[i] + phase, SILENT - 1 - i if alone and number else i
            wave = amplitude * jnp.cos(at), -amplitude * jnp.sin(at)
            yield i, frequency * speeds[i], *wave, own
    column = rig.size
    for placed in rig.at("platform"):
        law: Any = placed.law
        rate, at = 2 * math.pi * law.frequency, law.phase
        yield column, rate, law.amplitude * jnp.sin(at), law.amplitude * jnp.cos(at), column
        column += 1
    if force:
        yield column, jnp.zeros(()), jnp.ones(()), jnp.zeros(()), CONSTANT


def wheels_with_tables(rig: Rig) -> tuple[int, ...]:
    """Numbers of the wheels whose profile is a measured table."""
    return tuple(i for i, profile in enumerate(rig.profiles) if isinstance(profile, TableShape))


def signals_of(
    rig: Rig, speeds, angles, force: bool, series: int
) -> tuple[Signals, tuple[Kind, ...]]:
    """Every signal of one design at constant `speeds` (rad/s) from `angles` (rad), and its kind.

    `force`: whether one acts on the platform; `series`: terms of the profile `rollers`.  Tables
    have no kind.
    """
    gapped = [
        (i, _passed(shape, speeds[i], angles[i] - begin))
        for i in range(rig.size)
        for shape, begin in _gapped(rig, i, series)
    ]
    kinds = [Kind(i, shape[2].shape[0], shape[2].shape[1], i) for i, shape in gapped]
    if not gapped:  # the kernels pass one signal with edges at least
        gapped, kinds = [(0, _silent())], [Kind(0, 1, 1, SILENT)]
    endless, tables = list(_endless(rig, speeds, angles, force)), wheels_with_tables(rig)
    most = max(kind.pieces for kind in kinds)

    def padded(x):
        return jnp.pad(x, ((0, 0), (0, most - x.shape[1])))

    alone = jnp.asarray([wave[1:4] for wave in endless], float).reshape(-1, 3)
    return Signals(
        jnp.concatenate([padded(shape[0][None]) for _, shape in gapped]),
        jnp.asarray([shape[4] for _, shape in gapped]),
        jnp.asarray([shape[5] for _, shape in gapped]),
        jnp.concatenate([*(shape[1] for _, shape in gapped), alone[:, 0]]),
        jnp.concatenate([*(padded(shape[2].T) for _, shape in gapped), padded(alone[:, 1:2])]),
        jnp.concatenate([*(padded(shape[3].T) for _, shape in gapped), padded(alone[:, 2:3])]),
        table_signals(rig, tables, speeds, angles) if tables else None,
    ), (*kinds, *(Kind(wave[0], 1, 1, wave[4]) for wave in endless))
