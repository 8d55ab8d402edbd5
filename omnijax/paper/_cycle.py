"""The long-run cycle of the elastic case in closed form, and the run that starts from rest.

The wheels' speeds have a common period.  Every wheel's shape has closed-form Fourier coefficients,
each harmonic goes through the linear model by one complex solve, and one Fourier sum gives
the cycle.  A run from rest is that cycle plus the free motion exp(A t) that meets the start.
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..dynamics import Pointwise, pointwise_shape_acceleration, wheel_shape
from ..rig import Rig, get_parameter
from ..simulation import (
    ForcedSystem,
    forced_system,
    forcing,
    fourier,
    line_output,
    line_rates,
    line_state,
)
from ..vibration import norm, rms
from ._case import MULTIPLES, SPEEDS, changed

HARMONICS = 192
POINTS = 6144  # 512 a gap of the fastest wheel
TRACE_POINTS = 24576  # 2048 a gap of the fastest wheel: lines up to 8600 rad/s
FASTEST = 1  # the wheel at 1.2 rad/s
RIPPLE = 100.0  # rad/s: ripple is what lies above; the gaps pass at 37 rad/s and less


class CycleTrace(NamedTuple):
    """One common period, from the start of every wheel's gap; leading axis the time."""

    t: np.ndarray  # (t,) s
    dR: np.ndarray  # (t, 3) m
    rigid: np.ndarray  # (t, 3) m, sum of rho_i r_i
    elastic: np.ndarray  # (t, 3) m, sum of (Delta_i + delta_i) r_i


class PaperCycle(NamedTuple):
    """One common period, from the start of every wheel's gap; leading axis the time."""

    t: Float[Array, " t"]  # s
    dR: Float[Array, "t 3"]  # m
    rigid: Float[Array, "t 3"]  # m, sum of rho_i r_i
    elastic: Float[Array, "t 3"]  # m, sum of (Delta_i + delta_i) r_i
    acceleration: Float[Array, "t 3"]  # m/s^2, of the sphere's centre
    rate: Float[Array, "g h"]  # rad/s, angular frequency of each line
    lines: Complex[Array, "g h 3"]  # m, amplitudes of dR
    shape_lines: Complex[Array, "g h 3"]  # m, of the rigid part


class Metrics(NamedTuple):
    """What the paper's claims are about, in m (acceleration: m/s^2)."""

    peak: Float[Array, ""]
    rms: Float[Array, ""]
    elastic_peak: Float[Array, ""]
    elastic_rms: Float[Array, ""]
    ripple: Float[Array, ""]
    sphere_acceleration_rms: Float[Array, ""]
    strongest: Float[Array, ""]  # rad/s, the fastest wheel's strongest line of dR
    strongest_rigid: Float[Array, ""]  # rad/s, of the rigid part
    lowest: Float[Array, ""]  # rad/s, the lowest line of the fastest wheel above 1 % of its largest


READ = ("dR", "dR_elastic", "a_sphere")  # outputs of which lines are taken


def _responses(system: ForcedSystem, g: int, rate):
    """State and outputs per unit of rho_g at angular frequency `rate`."""
    state = line_state(system, g, rate)
    return {name: line_output(system, g, rate, state, name) for name in READ} | {"state": state}


def _system(rig: Rig, model: str):
    """The rig at the paper's speeds, and its wheels' shapes as signals beside each other."""
    speeds = jnp.asarray(SPEEDS)
    signals = forcing(rig, speeds, jnp.zeros(rig.size))
    return forced_system(rig, model, speeds, signals.wheel), signals


def _lines_of(rig: Rig, system: ForcedSystem, signals, g, count: int):
    """Angular frequencies (h) and amplitudes (h, o) of every output under wheel `g` alone."""
    rates, harmonic = line_rates(signals, count)[g], jnp.arange(count + 1)
    pieces = jax.tree.map(lambda x: x[g], signals.cycle.pieces)
    shape = jnp.where(harmonic == 0, 1.0, 2.0) * fourier(pieces, count)
    gains = jax.vmap(lambda w: _responses(system, g, w))(rates)
    gains |= {"shape": jnp.broadcast_to(rig.wheels.normal[g], (count + 1, 3))}
    return rates, jax.tree.map(lambda gain: shape[:, None] * gain, gains)


def _lines(rig: Rig, model: str, count: int):
    """Lines of all wheels beside each other, the same number of harmonics of each."""
    system, signals = _system(rig, model)
    return jax.vmap(lambda g: _lines_of(rig, system, signals, g, count))(jnp.arange(rig.size))


def synthesis(lines: Complex[Array, "g h o"], points: int) -> Float[Array, "t o"]:
    """Sum over wheels and harmonics on a grid of one common period (`points` a multiple of 12)."""
    total = jnp.zeros((points, lines.shape[-1]))
    for multiple, line in zip(MULTIPLES, lines, strict=True):
        own = points // multiple  # points of this wheel's own period
        kept = line[: own // 2]
        turn = jnp.arange(own)[:, None] * jnp.arange(len(kept)) % own
        wave = 2 * math.pi / own * turn
        once = jnp.cos(wave) @ jnp.real(kept) - jnp.sin(wave) @ jnp.imag(kept)
        total = total + jnp.tile(once, (multiple, 1))
    return total


def _times(rig: Rig, points: int) -> Float[Array, " t"]:
    period = 2 * math.pi / rig.wheels.rollers[0] / (SPEEDS[0] / MULTIPLES[0])
    return period * jnp.arange(points) / points


def rigid_part(rig: Rig, t: Float[Array, " t"]) -> Float[Array, "t 3"]:
    """Sum of rho_i r_i, m: what round, stiff bodies would follow."""
    shape = jax.vmap(lambda time: wheel_shape(rig, time * jnp.asarray(SPEEDS)))(t)
    return shape @ rig.wheels.normal


def cycle(
    rig: Rig, model: str = "paper", count: int = HARMONICS, points: int = POINTS
) -> PaperCycle:
    """The long-run cycle of `rig` at the paper's speeds."""
    rates, lines = _lines(rig, model, count)
    return _cycle(rig, rates, lines, points)


def _cycle(rig: Rig, rates, lines, points: int) -> PaperCycle:
    t = _times(rig, points)
    return PaperCycle(
        t=t,
        dR=synthesis(lines["dR"], points),
        rigid=rigid_part(rig, t),
        elastic=synthesis(lines["dR_elastic"], points),
        acceleration=synthesis(lines["a_sphere"], points),
        rate=rates,
        lines=lines["dR"],
        shape_lines=lines["shape"],
    )


@eqx.filter_jit
def _trace_parts(rig: Rig, points: int):
    """Lines of equal bandwidth of all wheels, the rigid part, and the free motion from rest."""
    counts = tuple(points // (4 * multiple) for multiple in MULTIPLES)
    system, signals = _system(rig, "paper")
    by_wheel = [_lines_of(rig, system, signals, g, count) for g, count in enumerate(counts)]
    t = _times(rig, points)
    step = jax.scipy.linalg.expm(system.A * t[1])
    start = -sum(jnp.sum(jnp.real(lines["state"]), axis=0) for _, lines in by_wheel)

    def advance(state, _):
        return step @ state, state

    free = jax.lax.scan(advance, start, None, length=points)[1]
    outputs = {name: free @ system.state[name].T for name in ("dR", "dR_elastic")}
    lines = {name: [wheel[name] for _, wheel in by_wheel] for name in outputs}
    return t, rigid_part(rig, t), lines, outputs


def from_rest(rig: Rig, points: int = TRACE_POINTS) -> tuple[CycleTrace, CycleTrace]:
    """The long-run cycle, and the first period of a run from rest (every gap begins, rho = 0).

    Every wheel's lines go up to the same frequency, so that no kink rings.
    """
    t, rigid, lines, free = jax.tree.map(np.asarray, _trace_parts(rig, points))
    long_run = {name: _transform(lines[name], points) for name in lines}
    rest = {name: long_run[name] + free[name] for name in lines}
    first, second = (
        CycleTrace(t, part["dR"], rigid, part["dR_elastic"]) for part in (long_run, rest)
    )
    return first, second


def _transform(lines: list[np.ndarray], points: int) -> np.ndarray:
    """Sum over wheels and harmonics by one inverse Fourier transform."""
    spectrum = np.zeros((points // 2 + 1, lines[0].shape[1]), complex)
    for multiple, line in zip(MULTIPLES, lines, strict=True):
        spectrum[multiple * np.arange(len(line))] += line
    spectrum[1:] /= 2
    return points * np.fft.irfft(spectrum, n=points, axis=0)


def _pointwise_states(rig: Rig, sign: int, count: int):
    """By wheel: angular frequencies (n, h), lines of (delta, Delta) as printed (n, h, 2)."""
    A, b = Pointwise(rig, sign).matrices()
    pitch = 2 * math.pi / rig.wheels.rollers
    u = (jnp.arange(2048) + 0.5) / 2048
    speeds = jnp.asarray(SPEEDS)
    samples = jax.vmap(lambda x: pointwise_shape_acceleration(rig, x * pitch, speeds))(u)
    factor = jnp.where(jnp.arange(count + 1) == 0, 1.0, 2.0)[:, None]
    waves = jnp.exp(-2j * math.pi * jnp.arange(count + 1)[:, None] * u)
    force = factor * (waves @ samples) / len(u)  # (h, n)
    rates = (2 * math.pi / pitch * speeds)[:, None] * jnp.arange(count + 1)

    def gain(A, b, rate):
        return jnp.linalg.solve(1j * rate * jnp.eye(4) - A, b.astype(complex))[:2]

    gains = jax.vmap(jax.vmap(gain, (None, None, 0)))(A, b, rates)
    return rates, force.T[..., None] * gains


@eqx.filter_jit
def pointwise_elastic(
    rig: Rig, closure_sign: int = 1, count: int = HARMONICS, points: int = POINTS
):
    """Elastic part of the printed form, r_w'' at points, over the long-run cycle, (t, 3) m."""
    _, states = _pointwise_states(rig, closure_sign, count)
    return synthesis(jnp.sum(states, axis=2)[..., None] * rig.wheels.normal[:, None], points)


@eqx.filter_jit
def wheel_lines(rig: Rig, i: int, count: int = HARMONICS):
    """Lines of wheel i alone: angular frequency, rho, delta and Delta, m."""
    rates, lines = _lines(rig, "paper", count)
    n = rig.size
    state = lines["state"][i]
    shape = lines["shape"][i] @ rig.wheels.normal[i]
    approach, mount = state[:, i], state[:, n + i]
    return rates[i], shape, approach - mount - shape, mount


@eqx.filter_jit
def pointwise_lines(rig: Rig, i: int, count: int = HARMONICS):
    """Lines of wheel i alone as printed: angular frequency, rho, delta and Delta, m."""
    rates, states = _pointwise_states(rig, 1, count)
    _, lines = _lines(rig, "paper", count)
    shape = lines["shape"][i] @ rig.wheels.normal[i]
    return rates[i], shape, states[i, :, 0], states[i, :, 1]


def _ripple(c: PaperCycle) -> Float[Array, ""]:
    """RMS of the lines of dR less the wheels' own shape above `RIPPLE`, m (Parseval)."""
    power = 0.5 * jnp.sum(jnp.abs(c.lines - c.shape_lines) ** 2, axis=-1)
    return jnp.sqrt(jnp.sum(jnp.where(c.rate > RIPPLE, power, 0.0)))


def _size(lines) -> Float[Array, "..."]:
    """Amplitude of every line, its mean left out."""
    square = jnp.sum(jnp.real(lines) ** 2 + jnp.imag(lines) ** 2, axis=-1)
    return square.at[..., 0].set(0.0)


def _strongest(rate, lines) -> Float[Array, ""]:
    return rate[jnp.argmax(_size(lines))]


def _lowest(rate, lines) -> Float[Array, ""]:
    size = _size(lines)
    return rate[jnp.argmax(size > 1e-4 * jnp.max(size))]


def metrics(c: PaperCycle) -> Metrics:
    """The figures that the claims speak of."""
    return Metrics(
        peak=jnp.max(norm(c.dR)),
        rms=rms(c.t, c.dR),
        elastic_peak=jnp.max(norm(c.elastic)),
        elastic_rms=rms(c.t, c.elastic),
        ripple=_ripple(c),
        sphere_acceleration_rms=rms(c.t, c.acceleration),
        strongest=_strongest(c.rate[FASTEST], c.lines[FASTEST]),
        strongest_rigid=_strongest(c.rate[FASTEST], c.shape_lines[FASTEST]),
        lowest=_lowest(c.rate[FASTEST], c.lines[FASTEST]),
    )


FACTORS = (
    "wheel.contact.stiffness",
    "wheel.contact.damping",
    "wheel.mount.stiffness",
    "wheel.mount.damping",
    "wheel.closure.stiffness",
    "wheel.roundness",
)


@eqx.filter_jit
def sensitivities_over(rig: Rig, values, model: str = "paper", count: int = HARMONICS) -> Metrics:
    """Exact d log(metric)/d log(factor) for every row of `values`; a column each of `FACTORS`."""

    def one(row):
        base = changed(rig, row)
        logs = jnp.log(jnp.stack([get_parameter(base, path)[0] for path in FACTORS]))

        def logged(x):
            here = changed(base, dict(zip(FACTORS, jnp.exp(x), strict=True)))
            return jax.tree.map(jnp.log, metrics(cycle(here, model, count, 24 * count)))

        return jax.jacfwd(logged)(logs)

    return jax.lax.map(one, values)


@eqx.filter_jit
def metrics_over(rig: Rig, values, model: str = "paper", count: int = HARMONICS) -> Metrics:
    """Metrics for every row of `values` (parameter path -> array of one length), in one program."""

    def one(row):
        return metrics(cycle(changed(rig, row), model, count, 24 * count))

    return jax.lax.map(one, values, batch_size=4)
