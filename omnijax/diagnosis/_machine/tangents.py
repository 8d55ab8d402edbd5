"""Signatures: what a law of small strength changes in every channel, first order in the law.

The law is evaluated at its port along the base motion and its output is pushed through the linear
transfer: rho and tensions through the elastic model, torques through the rotation.
"""

import jax
import numpy as np

from ...rig import Placed
from .elastic import refine
from .laws import along, sensed
from .linearisation import THIN, Base, transfer, turned_by
from .motion import contact_directions, integrate
from .rotation import body_signals, resistance, rolling_signals, shaft_signals, wheel_law
from .runs import FINE, SHAPE


def signature(base: Base, placed: Placed):
    """(elastic (samples, 6) or None, rotation (samples, 3 + n) or None) of one placed law."""
    return _PORTS[placed.law.port](base, placed)


def _shape(base: Base, placed: Placed):
    tables, m = base.tables, base.motion
    gaps = base.rig.gaps
    shape = np.zeros_like(m.theta_shape)
    length = np.zeros((base.run.samples, base.rig.size))
    radius = float(base.rig.sphere.radius)
    for i in placed.wheels:
        gap = jax.tree.map(lambda x, i=i: x[i], gaps)
        rho = _over_angles(placed.law, tables.angle, gap)
        shape[:, i] = base.places[i].of(rho)
        step = tables.angle[1] - tables.angle[0]
        rolled = np.concatenate([[0.0], np.cumsum((rho[1:] + rho[:-1]) / 2) * step]) / radius
        length[:, i] = -tables.places(m.theta[::FINE, i]).summed(rolled)
    change = shape[:: SHAPE // FINE * THIN] / base.lever[::THIN]
    elastic, rotation = _longer_lever(base, change, shape=shape)
    rotation[:, 3:] += length
    return elastic, rotation


def _over_angles(law, angle, gap):
    return np.asarray(_shape_law(law, angle, gap))


@jax.jit
def _shape_law(law, angle, gap):
    return jax.vmap(lambda a: law(a, gap))(angle)


def _surface(base: Base, placed: Placed):
    directions = contact_directions(base.rig, base.motion)
    value = np.stack(
        [along(placed.law, np.ascontiguousarray(directions[:, i])) for i in range(base.rig.size)], 1
    )
    return transfer(base, shape=refine(value, SHAPE // FINE)), None


def _contact(base: Base, placed: Placed):
    return transfer(base, contact=_per_wheel(base, placed, base.contact)), None


def _mount(base: Base, placed: Placed):
    return transfer(base, mount=_per_wheel(base, placed, base.mount)), None


def _per_wheel(base: Base, placed: Placed, signals) -> np.ndarray:
    """Tensions (FINE points, n) of a law, with its memory followed by exact relaxation steps."""
    out = np.zeros(base.motion.theta.shape)
    for i in placed.wheels:
        here = jax.tree.map(lambda x, i=i: np.ascontiguousarray(x[:, i]), signals)
        if placed.law.initial() is None:
            out[:, i] = along(placed.law, here)
        else:
            out[:, i] = np.asarray(_remember(placed.law, here, base.run.step / FINE))
    return out


@jax.jit
def _remember(law, signals, step):
    """A law with memory along its signals: Heun's steps from the memory at rest."""
    first = jax.tree.map(lambda x: x[0], signals)
    state = _rest_memory(law, first)

    def body(state, pair):
        now, then = pair
        rate = law.rate(now, state)
        guess = jax.tree.map(lambda z, r: z + step * r, state, rate)
        after = law.rate(then, guess)
        state = jax.tree.map(lambda z, r, q: z + step / 2 * (r + q), state, rate, after)
        return state, law(then, state)

    pairs = (jax.tree.map(lambda x: x[:-1], signals), jax.tree.map(lambda x: x[1:], signals))
    _, out = jax.lax.scan(body, state, pairs)
    return jax.numpy.concatenate([law(first, state)[None], out])


def _rest_memory(law, signal):
    """Memory at which a law's rate is zero: one Newton step, exact for linear memories."""
    from jax.flatten_util import ravel_pytree

    flat, unravel = ravel_pytree(law.initial())

    def rate(z):
        return ravel_pytree(law.rate(signal, unravel(z)))[0]

    return unravel(flat - jax.numpy.linalg.solve(jax.jacfwd(rate)(flat), rate(flat)))


def _separation(base: Base, placed: Placed):
    out = np.zeros(base.motion.theta.shape)
    for i in placed.wheels:
        out[:, i] = -along(placed.law, np.ascontiguousarray(base.normal[:, i]))
    if not out.any():
        return None, None
    return transfer(base, contact=out), None


def _shaft(base: Base, placed: Placed):
    torque = base.torque[::THIN]
    signals = shaft_signals(base.slow, torque)
    return turned_by(base, shaft=wheel_law(placed.law, placed.wheels, signals, torque.shape)[0])


def _rolling(base: Base, placed: Placed):
    signals = rolling_signals(base.rig, base.slow, base.normal[::THIN])
    shape = base.slow.theta.shape
    roll, spin, shaft = wheel_law(placed.law, placed.wheels, signals, shape)
    return turned_by(base, -shaft, resistance(base.rig, base.slow, roll, spin))


def _body(base: Base, placed: Placed):
    return turned_by(base, opposing=-along(placed.law, body_signals(base.rig, base.slow)))


def _platform(base: Base, placed: Placed):
    return transfer(base, floor=along(placed.law, base.run.fine(FINE))), None


def _kinematics(base: Base, placed: Placed):
    """The factor 1 + e of the rolling radius enters S(theta) and the drive forces."""
    m = base.motion
    change = np.zeros(m.theta.shape)
    for i in placed.wheels:
        change[:, i] = along(placed.law, np.ascontiguousarray(m.speed[:, i]))
    rate = -change * m.speed * base.lever / float(base.rig.sphere.radius)
    elastic, rotation = _longer_lever(base, change[::THIN])
    rotation[:, 3:] += integrate(rate, base.run.step / FINE)[::FINE]
    return elastic, rotation


def _longer_lever(base: Base, change: np.ndarray, **inputs: np.ndarray):
    """Both tables of rolling radii r (1 + change), `change` (thinned points, n), at fixed S(theta).

    With what `inputs` of the elastic model cause.  In the drive forces' matrix and right-hand side
    (spec section 4) r (1 + e) is, to first order, a torque e (T - 2 r f) on the shaft.
    """
    shaft = change * (base.shaft - 2 * base.lever[::THIN] * base.drive)
    return turned_by(base, shaft=shaft, **inputs)


def _sensor(base: Base, placed: Placed):
    group, _, channel = placed.place.partition("_")
    time, run = base.run.time, base.run
    if group == "theta":
        return _encoder(base, placed, channel)
    values = {
        "dR": base.predicted[:, :3],
        "a": base.predicted[:, 3:],
        "Omega": base.motion.turning[::FINE],
    }[group]
    change = sensed(placed.law, time, values)
    if channel:
        only = np.zeros_like(values)
        only[:, "xyz".index(channel)] = change[:, "xyz".index(channel)]
        change = only
    zero = np.zeros((run.samples, 3))
    if group == "Omega":
        return None, np.concatenate([change, np.zeros((run.samples, base.rig.size))], axis=1)
    return np.concatenate([change, zero] if group == "dR" else [zero, change], axis=1), None


def _encoder(base: Base, placed: Placed, channel: str):
    """An encoder's error shifts the angle of the shape's look-up, and the rolled length."""
    m, run = base.motion, base.run
    theta = m.theta[::FINE]
    change = sensed(placed.law, run.time, theta)
    if channel:
        only = np.zeros_like(theta)
        only[:, int(channel) - 1] = change[:, int(channel) - 1]
        change = only
    radius = (np.asarray(base.rig.wheels.radius) + m.shape[::FINE]) / float(base.rig.sphere.radius)
    slope = base.tables.rho_slope(m.theta_shape)
    shape = -slope * refine(change, SHAPE)
    rotation = np.concatenate([np.zeros((run.samples, 3)), change * radius], axis=1)
    return transfer(base, shape=shape), rotation


_PORTS = {
    "shape": _shape, "surface": _surface, "contact": _contact, "mount": _mount,
    "separation": _separation, "shaft": _shaft, "rolling": _rolling, "sphere": _body,
    "platform": _platform, "kinematics": _kinematics, "sensor": _sensor,
}  # fmt: skip
