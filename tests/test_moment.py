"""The whole vector field at one moment against the specification's equations, un-eliminated."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import SKEW, machine
from moments import Extra, Moment, at, rotation, slope

from omnijax import laws
from omnijax.dynamics import (
    Coupled,
    ElasticState,
    Inputs,
    Model,
    Paper,
    Pointwise,
    PortInputs,
    State,
    external_force,
    incompatibility,
    initial_memory,
    instant,
    linear_system,
    minimum_normal_force,
    pointwise_shape_acceleration,
    prescribed_instant,
    quaternion_of,
    quaternion_product,
    rolling,
    rotation_matrix,
    speed_driven,
    spin_axes,
    torque_driven,
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
SAME = ("speed", "shape", "deflection_rate", "normal_force", "drive_force", "shaft_torque",
        "angular_acceleration", "acceleration", "sphere_acceleration")  # fmt: skip


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

    extra = Extra(
        contact=lambda d, _: 3e12 * d**3 * one[1] + 4e4 * (d - memory),
        mount=lambda D, rate: 6e12 * D**3 * one[0] + 3.0 * np.tanh(rate / 2e-3) * one[1],
        shaft=lambda angle, speed: -0.02 * speed + 0.05 * np.sin(3 * angle + 0.2) * one[1],
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


def check_rates(rig, now, found: State, expected):
    """Rates of the state, with the shifts' own rates by the product rule."""
    w, e = rig.wheels, expected
    normal, shift = np.asarray(w.normal), np.asarray(w.contact.damping) * e["shape_rate"]
    sphere = rig.sphere.mass * (e["sphere_acceleration"] - e["drift"]) - shift @ normal
    wheel = w.mass * (e["wheel_acceleration"] - normal @ e["drift"]) + shift
    near(found.elastic.approach, now.sphere - now.platform)
    near(found.elastic.mount, e["mount_rate"])
    near(found.elastic.momentum, sphere)
    near(found.elastic.wheel_momentum, wheel)
    near(found.attitude, e["attitude"])
    near(found.position, now.platform)
    near(found.drift, e["drift"])


def near(found, expected, rtol=1e-7):
    np.testing.assert_allclose(found, expected, atol=rtol * np.abs(expected).max() + 1e-300)


def check_instant(found, expected):
    for name in SAME:
        near(getattr(found, name), expected[name])
    near(found.motion.deflection, expected["deflection"])
    near(found.motion.mount_rate, expected["mount_rate"])


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


def check_torque_driven(n, with_effects, unilateral=False, seed=0):
    rig, now, extra, memory, remembered = prepared(n, with_effects, unilateral, seed)
    expected = at(rig, now, *shapes(rig, with_effects), extra)
    if unilateral:
        assert 0 < np.sum(expected["normal_force"] == 0) < n
    state = to_state(rig, now, expected["shape"], remembered, expected["centre_velocity"])
    model = Model(Coupled(rig))
    inputs = Inputs(jnp.asarray(now.torque), jnp.asarray(now.force), jnp.asarray(TIME))
    check_instant(instant(model, state, inputs), expected)
    rate = torque_driven(model, state, inputs)
    near(rate.angle, expected["speed"])
    near(rate.angular_velocity, expected["angular_acceleration"])
    check_rates(rig, now, rate, expected)
    check_memory(rate, expected, memory)


def check_memory(rate, expected, memory):
    for z in rate.memory:
        if z is not None:
            near(z, (expected["deflection"] - memory) / 0.03)


def check_speed_driven(n, with_effects, seed=1):
    rig, now, extra, memory, remembered = prepared(n, with_effects, seed=seed)
    rng = np.random.default_rng(seed)
    speed, faster = 3 * rng.normal(size=n), 20 * rng.normal(size=n)
    expected = at(rig, now, *shapes(rig, with_effects), extra, (speed, faster))
    state = to_state(rig, now, expected["shape"], remembered, expected["centre_velocity"])
    model = Model(Coupled(rig))
    inputs = Inputs(jnp.zeros(n), jnp.asarray(now.force), jnp.asarray(TIME))
    drive = jnp.asarray(speed), jnp.asarray(faster)
    instant_now, _, omega = prescribed_instant(model, state, inputs, *drive)
    near(omega, expected["turning"])
    check_instant(instant_now, expected)
    rate = speed_driven(model, state, inputs, *drive)
    assert not np.any(rate.angle) and not np.any(rate.angular_velocity)
    check_rates(rig, now, rate, expected)
    check_memory(rate, expected, memory)
    sliding = rolling(rig, state.angle, drive[0])
    rim = expected["rolling_radius"] * speed
    slid = rig.sphere.radius * (np.asarray(sliding.axes) @ expected["turning"]) - rim
    slides = np.asarray(incompatibility(rig, sliding, drive[0]))
    np.testing.assert_allclose(slides, slid, atol=1e-9)
    assert (np.abs(slid).max() > 1e-2) == (n > 3)


def check_paper(n=3):
    """Eqs. 41-42 contact by contact: no reaction on the platform, which moves as P/M_T + floor."""
    rng = np.random.default_rng(5)
    rig = machine(SKEW, **PARTS)
    w, Ms = rig.wheels, float(rig.sphere.mass)
    x, mount, rho = 1e-4 * rng.normal(size=(3, n))
    x_rate, mount_rate, contact_law, mount_law, drive = rng.normal(size=(5, n))
    force, floor = rng.normal(size=(2, 3))
    C = np.asarray(w.contact.damping)
    state = ElasticState(
        *(jnp.asarray(y) for y in (x, mount, Ms * x_rate - C * rho, w.mass * mount_rate + C * rho))
    )
    ports = PortInputs(*map(jnp.asarray, (rho, contact_law, mount_law, drive, force, floor)))
    rate = Paper(rig).rate(state, ports)
    tension = w.contact.stiffness * (x - mount - rho) + C * (x_rate - mount_rate) + contact_law
    held = w.mount.stiffness * mount + w.mount.damping * mount_rate + mount_law
    platform = force / float(rig.total_mass) + floor
    near(rate.approach, x_rate)
    near(rate.mount, mount_rate)
    across = np.asarray(w.normal) @ platform
    near(rate.momentum, -tension - w.closure.stiffness * x - Ms * across)
    near(rate.wheel_momentum, tension - held)
    near(Paper(rig).platform_acceleration(state, ports), platform)
    near(Paper(rig).motion(state, ports.shape).displacement, x @ np.asarray(w.normal))


def check_linear_system():
    """The matrices give the rates and outputs of the formulas that they are read off."""
    rig, rng = machine(SKEW, **PARTS), np.random.default_rng(6)
    coupled = Coupled(rig)
    y, u = rng.normal(size=12), rng.normal(size=18)
    system = linear_system(coupled)
    near(system.A @ y + system.B @ u, by_formula(coupled, y, u))


def by_formula(coupled, y, u):
    state = ElasticState(*(jnp.asarray(part) for part in np.split(y, [3, 6, 9])))
    inputs = PortInputs(*(jnp.asarray(part) for part in np.split(u, [3, 6, 9, 12, 15])))
    return np.concatenate(list(coupled.rate(state, inputs)))


def check_pointwise():
    """Eqs. 41-42 as printed, with r_w'' as an input and either sign of the closure."""
    rig, rng = machine(SKEW), np.random.default_rng(7)
    w, Ms = rig.wheels, float(rig.sphere.mass)
    state, shape = rng.normal(size=(4, 3)), rng.normal(size=3)
    d, D, d_rate, D_rate = state
    for sign in (1, -1):
        tension = w.contact.stiffness * d + w.contact.damping * d_rate
        wheel = (tension - w.mount.stiffness * D - w.mount.damping * D_rate) / w.mass
        sphere = -(tension + sign * w.closure.stiffness * (d + D)) / Ms - shape
        found = Pointwise(rig, sign).rate(jnp.asarray(state), jnp.asarray(shape))
        near(found, np.stack([d_rate, D_rate, sphere - wheel, wheel]))
    angle, speed = jnp.array([0.05, 0.06, 0.04]), jnp.array([2.0, -1.0, 3.0])
    rho = shapes(rig, False)[0]
    bend = slope(lambda t: slope(lambda s: rho(angle + s), t, 1e-4), 0.0, 1e-4)
    near(pointwise_shape_acceleration(rig, angle, speed), bend * speed**2, 1e-5)


def check_dual_row():
    """A contact on one row: the arm turns by asin(s/R) about `drive`, the axis with it."""
    rig = machine(SKEW, profile=laws.DualRow(jnp.asarray(0.3)))
    r, v, R = np.asarray(rig.wheels.normal), np.asarray(rig.wheels.drive), 1.22
    angle = jnp.array([0.0, 0.25, 0.1])
    axle = -np.cross(r, v)
    lateral = [
        float(p.lateral(angle[i], jax.tree.map(lambda x, i=i: x[i], rig.gaps)))
        for i, p in enumerate(rig.profiles)
    ]
    sine = np.array(lateral)[:, None] / R
    assert len({round(x, 6) for x in lateral}) == 2
    arm = -np.sqrt(1 - sine**2) * r + sine * axle
    near(spin_axes(rig, angle), np.cross(arm, v))


def check_external_force():
    """Eq. 45 as rederived in section 5 of the specification."""
    rng = np.random.default_rng(8)
    rig = machine(SKEW, friction=[0.9, 0.7, 0.5])
    w, Ms, Mt = rig.wheels, float(rig.sphere.mass), float(rig.total_mass)
    f, P = rng.normal(size=(2, 3))
    v, back, mu = np.asarray(w.drive).T, -np.asarray(w.normal).T, np.asarray(w.contact.friction)
    expected = Ms * P / Mt - (v - back @ np.diag(1 / mu)) @ f
    given = (f, P, w.normal, w.drive, w.contact.friction, Ms, Mt)
    near(external_force(*given), expected)
    near(external_force(*given, outside=True), Mt / (Mt - Ms) * expected)
    near(minimum_normal_force(f, w.contact.friction), np.abs(f) / mu)


def check_kept_radius_rate():
    """The other reading of (dr_w/dt) omega: kept among the drive forces' right-hand sides."""
    rig, now, extra, _, remembered = prepared(3, False)
    model = Model(Coupled(rig), keep_radius_rate=True)
    rho, surface = shapes(rig, False)
    e = at(rig, now, rho, surface, extra)
    state = to_state(rig, now, e["shape"], remembered, e["centre_velocity"])
    found = instant(model, state, Inputs(*map(jnp.asarray, (now.torque, now.force, TIME))))
    w, R = rig.wheels, float(rig.sphere.radius)
    axes, r = np.asarray(w.spin_axis), e["rolling_radius"]
    # r_w w' + r_w' w = R axes . W', with I_w w' = T - r_w f
    left = r * (e["shaft_torque"] - r * found.drive_force) / w.inertia
    left = left + slope(lambda t: rho(now.angle + t * e["speed"]), 0.0, 1e-5) * e["speed"]
    near(left, R * axes @ found.angular_acceleration, 1e-6)


def check_rotation_matrix():
    """A quaternion of any length, not of one axis: q e q* of the body's axes."""
    q = np.array([0.5, -0.1, 0.7, 0.5])
    near(rotation_matrix(jnp.asarray(3 * q)), rotation(q))
    product = quaternion_product(jnp.array([1.0, 2.0, 3.0, 4.0]), jnp.array([5.0, 6.0, 7.0, 8.0]))
    near(product, np.array([-60.0, 12.0, 30.0, 24.0]))  # Hamilton's rule by hand
    turn = np.array([0.4, -0.8, 0.8])  # 1.2 rad about (1, -2, 2)/3
    by_hand = np.array([np.cos(0.6), *(np.sin(0.6) * np.array([1.0, -2.0, 2.0]) / 3)])
    near(quaternion_of(jnp.asarray(turn)), by_hand)
    near(quaternion_of(jnp.zeros(3)), np.array([1.0, 0.0, 0.0, 0.0]))


CHECKS = {
    "rotation": check_rotation_matrix,
    "torques, three wheels": lambda: check_torque_driven(3, False),
    "torques, four unlike wheels": lambda: check_torque_driven(4, False),
    "torques, effects": lambda: check_torque_driven(3, True),
    "torques, four wheels, effects": lambda: check_torque_driven(4, True),
    "a wheel lifts off": lambda: check_torque_driven(3, True, unilateral=True, seed=4),
    "speeds": lambda: check_speed_driven(3, True),
    "speeds, four wheels": lambda: check_speed_driven(4, False),
    "paper": check_paper,
    "linear system": check_linear_system,
    "pointwise": check_pointwise,
    "dual row": check_dual_row,
    "external force": check_external_force,
    "radius rate kept": check_kept_radius_rate,
}


@pytest.mark.parametrize("name", list(CHECKS))
def test_moment(name):
    CHECKS[name]()
