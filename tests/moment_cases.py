"""Moments drawn at random on rigs with a law at every port, and what the laws add by hand."""

import jax.numpy as jnp
import numpy as np
from machines import SKEW, machine
from moments import Extra, Moment

from omnijax import laws
from omnijax.dynamics import (
    ElasticState,
    State,
    initial_memory,
)

SKEW4 = (
    [[-0.7, 0.1, np.sqrt(0.5)], [0.1, -0.8, np.sqrt(0.35)], [0.6, 0.2, np.sqrt(0.6)],
     [0.2, 0.6, np.sqrt(0.6)]],
    [[0.1, 0.7, 0.0], [0.8, 0.1, 0.0], [-0.2, 0.6, 0.0], [-0.6, 0.2, 0.0]],
)  # fmt: skip
SKEW4 = tuple([list(np.asarray(row) / np.linalg.norm(row)) for row in part] for part in SKEW4)
INERTIA = jnp.array([[4.0, 0.3, 0.1], [0.3, 5.0, -0.2], [0.1, -0.2, 6.5]])
PARTS = {"sphere_inertia": INERTIA, "gravity": [0.4, -0.2, -9.8]}
TIME = 0.13


def effects_of(n):
    """(law, place) at every port, and what they add by the table of effects."""
    placed = [
        (laws.WheelRunout(*_(3e-4, 0.4)), "w1"),
        (laws.SphereOutOfRound(jnp.asarray(2e-4), jnp.array([0.48, 0.6, 0.64])), "sphere"),
        (laws.ContactCubic(*_(3e12)), "w2"),
        (laws.ContactRelaxation(*_(4e4, 0.03)), "all"),
        (laws.MountCubic(*_(6e12)), "w1"),
        (laws.MountFriction(*_(3.0, 2e-3)), "w2"),
        (laws.BearingViscous(*_(0.02)), "all"),
        (laws.MotorRipple(*_(0.05, 3.0, 0.2)), "w2"),
        (laws.EFFECTS["motor-gain"](*_(0.05)), "w1"),
        (laws.EFFECTS["current-ripple"](*_(0.1, 3.5, 0.1)), "w1"),
        (laws.EFFECTS["load-friction"](*_(0.03, 0.4)), "w2"),
        (laws.RollingResistance(*_(2e-3, 0.4)), "all"),
        (laws.SpinResistance(*_(1e-3, 0.3)), "all"),
        (laws.AirDrag(*_(0.3)), "sphere"),
        (laws.Unbalance(jnp.array([1e-3, 2e-3, -3e-3])), "sphere"),
        (laws.FloorVibration(*_(0.4, 2.0, 0.3), jnp.array([0.6, 0.0, 0.8])), "platform"),
        (laws.Creep(*_(0.01)), "w1"),
    ]
    one = np.eye(n)
    memory = 2e-5 * np.arange(1, n + 1)
    mu = 0.9 + 0.02 * np.arange(n)

    def body(weight):
        def torque(turning, Q):
            drag = -0.3 * np.linalg.norm(turning) * turning
            return drag + np.cross(Q @ [1e-3, 2e-3, -3e-3], weight)

        return torque

    def rolling(roll, spin, normal):
        return 2e-3 * normal * np.tanh(roll / 0.4), 1e-3 * mu * normal * np.tanh(spin / 0.3)

    def delivered(torque, angle):
        return torque * (1 + 0.05 * one[0]) * (1 + 0.1 * np.sin(3.5 * angle + 0.1) * one[0])

    def shaft(angle, speed, given):
        ripple = 0.05 * np.sin(3 * angle + 0.2) - 0.03 * np.abs(given) * np.tanh(speed / 0.4)
        return -0.02 * speed + ripple * one[1]

    extra = Extra(
        actuator=delivered,
        shaft=shaft,
        contact=lambda d, _: 3e12 * d**3 * one[1] + 4e4 * (d - memory),
        mount=lambda D, rate: 6e12 * D**3 * one[0] + 3.0 * np.tanh(rate / 2e-3) * one[1],
        rolling=rolling,
        floor=0.4 * np.sin(2 * np.pi * 2.0 * TIME + 0.3) * np.array([0.6, 0.0, 0.8]),
        creep=0.01 * one[0],
    )
    return placed, extra, body, memory, mu


def _(*numbers):
    return tuple(jnp.asarray(float(x)) for x in numbers)


def draw(rng, n) -> Moment:
    """A moment in which every term of the equations counts; wheels well inside their gaps."""
    attitude = rng.normal(size=4)
    return Moment(
        2e-4 * rng.normal(size=3), 5e-5 * rng.normal(size=n), 0.02 * rng.normal(size=3),
        0.02 * rng.normal(size=3), 0.02 * rng.normal(size=n),
        2 * np.pi / 14 * rng.integers(0, 14, n) + rng.uniform(0.03, 0.08, n),
        0.5 * rng.normal(size=3), attitude / np.linalg.norm(attitude), 0.3 * rng.normal(size=n),
        3.0 * rng.normal(size=3),
    )  # fmt: skip


def shapes(rig, with_effects):
    """rho(angle) by eq. 8 with runout, and the sphere's surface, in numpy."""
    eta, rb = np.asarray(rig.wheels.roundness), np.asarray(rig.wheels.radius)
    R, r = float(rig.sphere.radius), np.asarray(rig.wheels.normal)
    pitch = 2 * np.pi / 14
    half = np.arcsin(rb / R * np.sin(eta * pitch / 2))
    depth = R * (1 - np.cos(half)) + rb * (1 - np.cos(eta * pitch / 2))

    def rho(angle):
        into = np.mod(angle, pitch)
        gap = -depth * np.sin(2 * np.pi * into / (eta * pitch)) * (into < eta * pitch)
        runout = 3e-4 * np.cos(angle - 0.4) * (np.arange(len(r)) == 0)
        return gap + runout * with_effects

    def surface(Q):
        along = (-r @ Q) @ np.array([0.48, 0.6, 0.64])
        return 2e-4 * (3 * along**2 - 1) / 2 * with_effects

    return rho, surface


def prepared(n, with_effects, unilateral=False, seed=0):
    """Rig, moment, and what the specification's laws add to it."""
    rng = np.random.default_rng(seed)
    placed, extra, body, memory, mu = effects_of(n)
    offset = jnp.array([2e-3, -1e-3, 1e-3])
    rig = machine(SKEW if n == 3 else SKEW4, friction=mu, centre_of_mass=offset, **PARTS)
    now, weight = draw(rng, n), float(rig.sphere.mass) * np.asarray(rig.platform.gravity)
    own = body(weight) if with_effects else lambda *_: 0.0
    extra = (extra if with_effects else Extra())._replace(
        unilateral=unilateral,
        body=lambda W, Q: own(W, Q) + np.cross(Q @ np.asarray(offset), weight),
    )
    for law, place in placed if with_effects else ():
        rig = rig.add(law, place)
    if unilateral:
        rig = rig.add(laws.LiftOff(), "all")
        now = now._replace(displacement=now.displacement * 8)
    remembered = tuple(None if z is None else jnp.asarray(memory) for z in initial_memory(rig))
    return rig, now, extra, memory, remembered


def to_state(rig, now: Moment, shape, memory, drift) -> State:
    """Shifted momenta (spec section 2) relative to the centre of mass's velocity."""
    w = rig.wheels
    shift = np.asarray(w.contact.damping) * shape
    normal = np.asarray(w.normal)
    elastic = ElasticState(
        jnp.asarray(now.displacement),
        jnp.asarray(now.mount),
        jnp.asarray(rig.sphere.mass * (now.sphere - drift) - shift @ normal),
        jnp.asarray(w.mass * (now.wheel - normal @ drift) + shift),
    )
    angle, turning, attitude = (jnp.asarray(x) for x in (now.angle, now.turning, now.attitude))
    return State(elastic, angle, turning, attitude, jnp.zeros(3), jnp.asarray(drift), memory)
