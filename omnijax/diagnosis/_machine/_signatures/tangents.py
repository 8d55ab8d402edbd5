"""Signatures: what a law of small strength changes in every channel, first order in the law.

The law is evaluated at its port along the base motion and its output is pushed through the linear
transfer: rho and tensions through the elastic model, torques through the rotation.
"""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import numpy as np

from ...._programs import kept
from ....dynamics import actuated, body_torques, rolling_torques, shaft_torques
from ....rig import Placed, Rig, acting, over_wheels
from ..._settings import SETTINGS
from .._elastic import refine
from .._laws import along, follow, radii
from .._motion import WheelTables, contact_directions, integrate, shape_table
from .._rotation import commanded, each_law, each_moment
from ..runs import FINE, SHAPE
from .linearisation import THIN, Linearisation, transfer, turned_by

LANES = 8  # laws at wheels that one call evaluates along a run


def signature(base: Linearisation, placed: Placed):
    """(elastic (samples, 6) or None, rotation (samples, 3 + n) or None) of one placed law."""
    return signatures(base, [placed])[0]


def signatures(base: Linearisation, placed: Sequence[Placed]) -> list[tuple]:
    """The `signature` of each of several placed laws; those of one class are evaluated at once."""
    pushed = _torques(base, placed)
    return [
        turned_by(*pushed[j]) if j in pushed else _PORTS[p.law.port](base, p)
        for j, p in enumerate(placed)
    ]


def _shape(base: Linearisation, placed: Placed):
    gaps = [jax.tree.map(lambda x, i=i: x[i], base.rig.gaps) for i in placed.wheels]
    if all(_repeats(placed.law, base.tables, gap) for gap in gaps):
        base = base.one_turn
    change = np.zeros((len(base.tables.angle), base.rig.size))
    for i, gap in zip(placed.wheels, gaps, strict=True):
        change[:, i] = shape_along(placed.law, base.tables.angle[:, i], gap)
    return reshaped(base, change, change)


def _repeats(law, tables: WheelTables, gap) -> bool:
    """Whether a law is the same in each turn that the tables cover."""
    angles = np.random.default_rng(0).uniform(tables.first, tables.first + tables.span, PROBES)
    both = shape_along(law, np.concatenate([angles, angles + 2 * np.pi]), gap)
    here, later = np.split(both, 2)
    return np.allclose(here, later, rtol=0.0, atol=1e-9 * np.abs(here).max())


ORDERS = ("order", "orders")  # parameters that count waves a turn
RADIUS_STEP = SETTINGS.tangents.radius_step
PROBES = SETTINGS.prediction.probes


def _radius(base: Linearisation, placed: Placed):
    """Another wheel radius: longer levers and rolled lengths, deeper gaps."""
    rig, angle = base.rig, base.tables.angle
    change = np.asarray(over_wheels((placed,), rig.wheel_radius, rig.size))
    longer = eqx.tree_at(lambda r: r.wheels.radius, rig, rig.wheels.radius + RADIUS_STEP * change)
    shape = (shape_table(longer, angle) - base.tables.shape) / RADIUS_STEP
    return reshaped(base, shape, shape + change)


def reshaped(base: Linearisation, rho: np.ndarray, radius: np.ndarray):
    """Both tables of changes of the wheels' shapes and rolling radii, over the tables' angles."""
    tables, m = base.tables, base.motion
    shape = np.zeros_like(m.theta_shape)
    lever = np.zeros_like(m.theta)
    length = np.zeros((base.run.samples, base.rig.size))
    for i in np.flatnonzero(radius.any(axis=0)).tolist():
        longer = base.places[i].of(radius[:, i])
        shape[:, i] = longer if rho is radius else base.places[i].of(rho[:, i])
        lever[:, i] = longer[:: SHAPE // FINE]
        mean = (radius[1:, i] + radius[:-1, i]) / 2 * np.diff(tables.angle[:, i])
        rolled = np.concatenate([[0.0], np.cumsum(mean)]) / float(base.rig.sphere.radius)
        length[:, i] = -tables.places(m.theta[::FINE, i], i).summed(rolled)
    elastic, rotation = _longer_lever(base, (lever / base.lever)[::THIN], shape=shape)
    rotation[:, 3:] += length
    return elastic, rotation


def shape_along(law, angle, gap) -> np.ndarray:
    """What a law of a wheel's shape adds to its radius (t,), m, at angles (t,) of the wheel."""
    return np.asarray(_shape_law(law, angle, gap))


@kept
def _shape_law(law, angle, gap):
    return jax.vmap(lambda a: law(a, gap))(angle)


def _surface(base: Linearisation, placed: Placed):
    directions = contact_directions(base.rig, base.motion)
    value = np.stack(
        [
            along(placed.law, np.ascontiguousarray(directions[:, i]), base.run)
            for i in range(base.rig.size)
        ],
        1,
    )
    return transfer(base, shape=refine(value, SHAPE // FINE)), None


def _contact(base: Linearisation, placed: Placed):
    return transfer(base, contact=_per_wheel(base, placed, base.contact)), None


def _mount(base: Linearisation, placed: Placed):
    return transfer(base, mount=_per_wheel(base, placed, base.mount)), None


def _per_wheel(base: Linearisation, placed: Placed, signals) -> np.ndarray:
    """Tensions (FINE points, n) of a law, with its memory followed from rest."""
    out = np.zeros(base.motion.theta.shape)
    for i in placed.wheels:
        here = jax.tree.map(lambda x, i=i: np.ascontiguousarray(x[:, i]), signals)
        if placed.law.initial() is None:
            out[:, i] = along(placed.law, here, base.run)
        else:
            here = jax.tree.map(base.run.as_longest, here)
            followed = _remember(placed.law, here, np.asarray(base.run.step / FINE))
            out[:, i] = np.asarray(followed)[: len(out)]
    return out


@kept
def _remember(law, signals, step):
    def rule(signal, state):
        return law(signal, state), law.rate(signal, state)

    return follow(rule, signals, law.initial(), step)


def _separation(base: Linearisation, placed: Placed):
    out = np.zeros(base.motion.theta.shape)
    for i in placed.wheels:
        out[:, i] = -along(placed.law, np.ascontiguousarray(base.normal[:, i]), base.run)
    if not out.any():
        return None, None
    return transfer(base, contact=out), None


WAVE_ANGLE = SETTINGS.tangents.wave_angle


def _fast(base: Linearisation, law) -> bool:
    """Whether the law's waves over the angle are fast between the thinned moments."""
    highest = max(float(np.max(getattr(law, key, 0.0))) for key in ORDERS)
    return bool(highest * np.abs(base.slow.speed).max() * base.slow.step > WAVE_ANGLE)


def _torques(base: Linearisation, placed: Sequence[Placed]) -> dict[int, tuple]:
    """By index of the laws that push on shafts and sphere: where along the run, and the torques."""
    alike: dict[Any, list[int]] = {}
    laws = {j: acting((p,), base.rig.size, masked=True)[0] for j, p in enumerate(placed)
            if p.law.port in _PUSHING}  # fmt: skip
    for j, law in laws.items():
        leaves, kind = jax.tree.flatten(law)
        shapes = tuple(np.shape(x) for x in leaves)
        alike.setdefault((kind, shapes, _fast(base, law.law)), []).append(j)
    out: dict[int, tuple] = {}
    for (*_, fast), every in alike.items():
        at, function = base.fine if fast else base, _PUSHING[placed[every[0]].law.port]
        lanes = min(LANES, 2 ** (len(every) - 1).bit_length())  # few programs to compile
        for first in range(0, len(every), lanes):
            some = every[first : first + lanes]
            full = [laws[j] for j in [*some, *[some[0]] * (lanes - len(some))]]
            caused = each_law(base.run, function, base.bare, full, at.felt)
            out |= {j: (at, *x) for j, x in zip(some, caused, strict=False)}
    return out


def _command(base: Linearisation, placed: Placed):
    moved = commanded(base.rig.add(placed.law, placed.place), base.run) - base.torque
    return turned_by(base, moved[::THIN])


def _body(base: Linearisation, placed: Placed):
    felt = base.felt._replace(rotation=base.slow.attitude)
    caused, _ = each_moment(base.run, body_torques, base.bare, placed.law, felt, None)
    return turned_by(base, opposing=caused.opposing)


def _platform(base: Linearisation, placed: Placed):
    return transfer(base, floor=along(placed.law, base.run.fine(FINE), base.run)), None


def _kinematics(base: Linearisation, placed: Placed):
    """The factor 1 + e of the rolling radius enters S(theta) and the drive forces."""
    m = base.motion
    change = np.zeros(m.theta.shape)
    for i in placed.wheels:
        change[:, i] = along(placed.law, np.ascontiguousarray(m.speed[:, i]), base.run)
    rate = -change * m.speed * base.lever / float(base.rig.sphere.radius)
    elastic, rotation = _longer_lever(base, change[::THIN])
    rotation[:, 3:] += integrate(rate, base.run.step / FINE)[::FINE]
    return elastic, rotation


def _longer_lever(base: Linearisation, change: np.ndarray, **inputs: np.ndarray):
    """Both tables of rolling radii r (1 + change), `change` (thinned points, n), at fixed S(theta).

    With what `inputs` of the elastic model cause.  In the drive forces' matrix and right-hand side
    (spec section 4) r (1 + e) is, to first order, a torque e (T - 2 r f) on the shaft.
    """
    shaft = change * (base.shaft - 2 * base.lever[::THIN] * base.drive)
    return turned_by(base, shaft=shaft, **inputs)


def _sensor(base: Linearisation, placed: Placed):
    group, run = placed.group, base.run
    if group == "theta":
        return _encoder(base, placed)
    values = base.shown[group]
    change = base.read(_alone(base.rig, placed), group, values) - values
    zero = np.zeros((run.samples, 3))
    if group == "Omega":
        return None, np.concatenate([change, np.zeros((run.samples, base.rig.size))], axis=1)
    return np.concatenate([change, zero] if group == "dR" else [zero, change], axis=1), None


def _alone(rig: Rig, placed: Placed) -> Rig:
    """The rig with this one law."""
    return rig.with_effects((placed,))


def _encoder(base: Linearisation, placed: Placed):
    theta = base.true["theta"]
    return encoder_shifted(base, base.read(_alone(base.rig, placed), "theta", theta) - theta)


def encoder_shifted(base: Linearisation, change: np.ndarray):
    """Both tables of errors (samples, n) of the encoders, rad.

    They shift the angle of the shape's look-up, and the rolled length.
    """
    m, run = base.motion, base.run
    radius = (radii(base.rig) + m.shape[::FINE]) / float(base.rig.sphere.radius)
    shape = -base.rho_slope * refine(change, SHAPE)
    rotation = np.concatenate([np.zeros((run.samples, 3)), change * radius], axis=1)
    return transfer(base, shape=shape), rotation


_PORTS = {
    "radius": _radius, "command": _command, "shape": _shape, "surface": _surface,
    "contact": _contact, "mount": _mount, "separation": _separation, "sphere": _body,
    "platform": _platform, "kinematics": _kinematics, "sensor": _sensor,
}  # fmt: skip
_PUSHING = {"actuator": actuated, "shaft": shaft_torques, "rolling": rolling_torques}
