"""The errata of the paper, each with one measure of wrongness computed for both readings.

A check is a function of the reading (the printed one or the one taken) that returns how wrong it
is; the row is confirmed where the printed reading lies above the limit and the other does not.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..dynamics import (
    TRANSLATIONS,
    Pointwise,
    PortInputs,
    drive_forces,
    external_force,
    flatten,
    linear_system,
    unflatten,
)
from ..laws import PROFILES, RollingResistance, RollingSignal, SpinResistance
from ..rig import Rig
from ..vibration import norm
from ._case import SPEEDS, TORQUE, baseline
from ._claim import Erratum
from ._cycle import FASTEST, pointwise_lines, wheel_lines
from ._judge_elastic import CLOSURE, MOUNT, MOUNT_DAMPING, SCANNED, C, K
from ._study import PaperStudy


class Row(NamedTuple):
    """One row: its text, the two readings, and the measure that tells them apart."""

    equation: str
    printed: str
    problem: str
    taken: str
    measure: str
    limit: float
    check: Callable[[PaperStudy, Any], float]
    reading_printed: Any
    reading_taken: Any
    unit: str = "1"


@eqx.filter_jit
def _pitch_mismatch(rig: Rig, profile: str) -> Float[Array, ""]:
    gap = jax.tree.map(lambda x: x[0], rig.gaps)
    angle = (jnp.arange(500) + 0.5) / 500 * gap.pitch
    rho = jax.vmap(lambda a: PROFILES[profile]()(a, gap))
    return jnp.max(jnp.abs(rho(angle + gap.pitch) - rho(angle))) / gap.depth


def pitch_mismatch(study: PaperStudy, profile: str) -> float:
    """Largest |rho(theta + pitch) - rho(theta)| over the depth, of a profile."""
    return float(_pitch_mismatch(study.rig, profile))


def momentum_residual(study: PaperStudy, form: str) -> float:
    """What Newton's second law of the sphere is short of, harmonic by harmonic, impulses included.

    M_s x'' + K delta + C delta' + K' y with x = Delta + delta + rho; RMS over that of M_s x''.
    """
    rig, i = study.rig, FASTEST
    contact, closure = rig.wheels.contact, rig.wheels.closure.stiffness[i]
    rates, shape, deflection, mount = (
        wheel_lines(rig, i) if form == "shifted momenta" else pointwise_lines(rig, i)
    )
    x = deflection + mount + shape
    held = x if form == "shifted momenta" else deflection + mount
    inertia = -rig.sphere.mass * rates**2 * x
    force = (contact.stiffness[i] + 1j * rates * contact.damping[i]) * deflection + closure * held
    return float(jnp.linalg.norm(inertia + force) / jnp.linalg.norm(inertia))


def resisting_power(study: PaperStudy, reading: tuple[str, int]) -> float:
    """Power in W that the resistance feeds into a sphere turning at 1 rad/s under 10 N."""
    kind, sign = reading
    size = jnp.asarray(sign * 1e-3)
    signal = RollingSignal(*(jnp.asarray(v) for v in (1.0, 1.0, 10.0, 0.9)))
    law = RollingResistance(size) if kind == "rolling" else SpinResistance(size)
    torque = law(signal)
    return -float(torque.roll * signal.roll + torque.spin * signal.spin)


@eqx.filter_jit
def _pointwise_matrices(rig: Rig, sign: int) -> Float[Array, "n 4 4"]:
    return Pointwise(rig, sign).matrices()[0]


def closure_softening(study: PaperStudy, sign: int) -> float:
    """Relative loss of the lowest natural frequency squared by the closure spring."""

    def squared(rig: Rig) -> float:
        A = np.asarray(_pointwise_matrices(rig, sign))[FASTEST]
        return float(np.min(np.abs(np.linalg.eigvals(A)) ** 2))

    loose = eqx.tree_at(lambda r: r.wheels.closure.stiffness, study.rig, jnp.zeros(study.rig.size))
    return 1 - squared(study.rig) / squared(loose)


@eqx.filter_jit
def _wheel_balance(rig: Rig, model: str) -> Float[Array, ""]:
    translation, wheels = TRANSLATIONS[model](rig), rig.wheels
    system = linear_system(translation)
    inputs = PortInputs.zeros(rig.size)._replace(force=jnp.array([0.3, 0.0, 0.0]))
    y = jnp.linalg.solve(system.A, -system.B @ flatten(inputs))
    state = unflatten(translation.rest(), y)
    motion = translation.motion(state, inputs.shape)
    needed = wheels.mass * (wheels.normal @ translation.platform_acceleration(state, inputs))
    net = translation.tension(motion) - translation.mount_tension(motion)
    return jnp.max(jnp.abs(net - needed)) / jnp.max(jnp.abs(needed))


def wheel_balance(study: PaperStudy, model: str) -> float:
    """|K delta - k Delta - m r.R_l''| / (m |r.R_l''|) of a wheel in steady acceleration by P."""
    return float(_wheel_balance(study.rig, model))


def contact_mismatch(study: PaperStudy, how: str) -> float:
    """|r_i . dR - s_i| over |s|: whether dR meets the contacts, wheels on a tripod."""
    normal = np.asarray(baseline("atlas-tripod").wheels.normal)
    wanted = np.array([1.0, 0.5, 0.2])
    dR = normal.T @ wanted if how == "sum" else np.linalg.solve(normal, wanted)
    return float(np.max(np.abs(normal @ dR - wanted)) / np.max(wanted))


@eqx.filter_jit
def _no_slip_forces(rig: Rig) -> Float[Array, " n"]:
    wheels = rig.wheels
    return drive_forces(
        wheels.spin_axis, wheels.radius, rig.sphere.radius, wheels.inertia,
        rig.sphere.inertia_matrix, jnp.asarray(TORQUE), jnp.zeros(3),
    )  # fmt: skip


@eqx.filter_jit
def _force_balance(rig: Rig, reading: str) -> Float[Array, ""]:
    wheels, M_s, M_T = rig.wheels, rig.sphere.mass, rig.total_mass
    f, P = _no_slip_forces(rig), jnp.array([0.1, 0.2, 0.3])
    mu = wheels.contact.friction
    F = external_force(f, P, wheels.normal, wheels.drive, mu, M_s, M_T, outside=True)
    if reading == "M_s/(M_T - M_s)":
        F = F * M_s / M_T
    inside = wheels.normal.T @ (f / mu) + wheels.drive.T @ f
    sphere, platform = (inside + F) / M_s, (P - inside) / (M_T - M_s)
    return jnp.linalg.norm(sphere - platform) / jnp.linalg.norm(platform)


def force_balance(study: PaperStudy, reading: str) -> float:
    """Relative acceleration of sphere and platform that the external force of eq. 45 leaves."""
    return float(_force_balance(study.rig, reading))


def unit_scaling(study: PaperStudy, reading: str) -> float:
    """How far the drive part of F, computed in mm and in m, is from one and the same force."""
    f = np.asarray(_no_slip_forces(study.rig))
    factor = (lambda R: R**2) if reading == "R²" else (lambda R: 1.0)
    R = float(study.rig.sphere.radius)
    metres, millimetres = factor(R) * f, factor(1e3 * R) * (1e3 * f)
    return float(np.max(np.abs(millimetres / 1e3 - metres) / np.abs(metres)))


def anisotropic_forces(study: PaperStudy, order: str) -> float:
    """Relative error of eq. 46's drive forces against eqs. 39, 40, 43 solved side by side."""
    wheels, R = study.rig.wheels, float(study.rig.sphere.radius)
    inertia = np.diag([4.0, 5.0, 6.5])
    axes, r, I_w = (np.asarray(x) for x in (wheels.spin_axis, wheels.radius, wheels.inertia))
    inverse = np.linalg.inv(inertia)
    product = axes @ inverse @ axes.T if order == "between" else inverse @ (axes @ axes.T)
    torque = np.asarray(TORQUE)
    f = np.linalg.solve(R**2 * product + np.diag(r**2 / I_w), r / I_w * torque)
    zero = np.zeros((3, 3))
    whole = np.block(
        [
            [np.diag(r), np.diag(I_w), zero],
            [-R * axes.T, zero, inertia],
            [zero, -np.diag(r), R * axes],
        ]
    )
    expected = np.linalg.solve(whole, np.concatenate([torque, np.zeros(6)]))[:3]
    return float(np.max(np.abs(f - expected)) / np.max(np.abs(expected)))


def size_beside_rigid(study: PaperStudy, what: str) -> float:
    """Peak of the total or of its elastic part over the rigid peak, largest over the dampings."""
    runs = [run.cycle for run in study.elastic.values()]
    rigid = np.max(norm(runs[0].rigid))
    part = {"total": [c.dR for c in runs], "elastic": [c.elastic for c in runs]}[what]
    return float(max(np.max(norm(x)) for x in part) / rigid)


def statements_wrong(study: PaperStudy, reading: str) -> float:
    """Share of (metric, damping) cells in which not both statements of section 5 are true.

    The reading taken says of each cell what its derivative says: it errs where the exact derivative
    disagrees in sign of (dominant, little) with the finite scan, which is no cell by construction.
    """
    slopes = np.stack([np.abs(getattr(study.sensitivity, name))[:, 0] for name in SCANNED])
    others = slopes[..., [C, MOUNT, MOUNT_DAMPING, CLOSURE]].max(axis=-1)
    dominant, little = slopes[..., K] >= others, slopes[..., K] <= 0.1
    if reading == "both, of every metric":
        return float(np.mean(~(dominant & little)))
    return float(np.mean((dominant & little) & (~dominant | ~little)))


ROWS = (
    Row(
        "8, 11", "the gate is lost in eq. 11", "the shape does not repeat from gap to gap, its "
        "frequency n/η would depend on η", "eq. 8, with its gate",
        "largest change of ρ from one gap to the next, over Δr_w", 1e-6,
        pitch_mismatch, "continuous-sine", "gated-sine",
    ),
    Row(
        "3, 41", "r̈_w evaluated at points", "the impulses at the gap edges are lost",
        "shifted momenta: only ρ enters",
        "what is missing from the sphere's momentum balance, impulses included, over M_s ẍ", 1e-6,
        momentum_residual, "points", "shifted momenta",
    ),
    Row(
        "20, 40", "−N l_r sign(·), then subtracted", "rolling resistance would drive the sphere",
        "it opposes the motion", "power into the sphere at 1 rad/s, 10 N, arm 1 mm", 0.0,
        resisting_power, ("rolling", -1), ("rolling", 1), "W",
    ),
    Row(
        "25, 29", "opposite signs", "one of the two drives the spin", "it opposes the motion",
        "power into the sphere at 1 rad/s, 10 N, lever 1 mm, μ 0.9", 0.0,
        resisting_power, ("spin", -1), ("spin", 1), "W",
    ),
    Row(
        "41", "−K'(Δ + δ) = K'(r_w − Z_c)", "the closure spring repels: negative stiffness",
        "restoring", "loss of the lowest natural frequency squared by the closure", 0.0,
        closure_softening, -1, 1,
    ),
    Row(
        "42", "no m R̈_l·r̂", "the wheel's inertia in the platform's frame is lost",
        "kept in `coupled`", "what is missing from the wheel's force balance, over m R̈_l·r̂", 1e-6,
        wheel_balance, "paper", "coupled",
    ),
    Row(
        "34 and “vectorially summed”", "ΔR = Σ s_i r̂_i", "differs from r̂_i·ΔR = s_i unless the r̂_i "
        "are orthonormal", "`coupled` solves eq. 34",
        "miss of the contacts' displacements on a tripod", 1e-9, contact_mismatch, "sum", "solve",
    ),
    Row(
        "45", "factor M_s/(M_T − M_s)", "the forces do not balance", "M_T/(M_T − M_s)",
        "acceleration of the sphere relative to the platform, over the platform's", 1e-9,
        force_balance, "M_s/(M_T - M_s)", "M_T/(M_T - M_s)",
    ),
    Row(
        "45", "factor R²", "makes it N m², no force", "no R²",
        "disagreement of the force computed in mm and in m", 1e-9, unit_scaling, "R²", "none",
    ),
    Row(
        "46", "[I_s]⁻¹[Ω̂]ᵀ[Ω̂]", "the order is right for an isotropic I_s only", "[Ω̂]ᵀ[I_s]⁻¹[Ω̂]",
        "error of the drive forces for principal inertias 4, 5, 6.5 kg m²", 1e-9,
        anisotropic_forces, "in front", "between",
    ),
    Row(
        "section 3.1.3", "ΔR “several orders of magnitude lower” than rigid",
        "ΔR of eqs. 33-34 follows the wheel; only the elastic part Σ(Δ+δ)r̂ is smaller",
        "both are reported", "peak over the rigid peak", 0.5, size_beside_rigid, "total", "elastic",
    ),
    Row(
        "section 5", "stiffness “dominant” and “varied little” with it", "contradict each other",
        "settled by exact derivatives, metric by metric",
        "share of metrics and dampings of which not both are true", 0.0,
        statements_wrong, "both, of every metric", "by derivative",
    ),
)  # fmt: skip


def judge(row: Row, study: PaperStudy) -> Erratum:
    """The row with the measure of both readings."""
    return Erratum(
        row.equation, row.printed, row.problem, row.taken, row.measure,
        row.check(study, row.reading_printed), row.check(study, row.reading_taken),
        row.limit, row.unit,
    )  # fmt: skip


def errata(study: PaperStudy) -> list[Erratum]:
    """Every row, judged."""
    return [judge(row, study) for row in ROWS]


def recovered_radius(rig: Rig) -> float:
    """Where the printed r_w'' leaves the wheel after one gap, over the depth: 2 pi, not 0.

    Integrated twice from rest at the gap's start, with the impulse at its edge dropped.
    """
    from ..dynamics import pointwise_shape_acceleration

    gap = jax.tree.map(lambda x: x[FASTEST], rig.gaps)
    speeds = jnp.asarray(SPEEDS)
    duration = float(gap.width) / SPEEDS[FASTEST]
    t = (np.arange(4000) + 0.5) / 4000 * duration
    bend = jax.vmap(lambda s: pointwise_shape_acceleration(rig, s * speeds, speeds))(jnp.asarray(t))
    weight = duration - t  # twice integrated: integral of (T - t) r'' dt
    return float(np.mean(np.asarray(bend)[:, FASTEST] * weight) * duration / gap.depth)
