"""The whole vector field at one moment against the specification's equations, un-eliminated."""

import jax.numpy as jnp
import numpy as np
import pytest
from moment_cases import TIME, prepared, shapes, to_state
from moments import at, near, slope

from omnijax import laws
from omnijax.dynamics import (
    Coupled,
    Inputs,
    Model,
    State,
    StepAverage,
    incompatibility,
    instant,
    motor_torque,
    prescribed_instant,
    rolling,
    speed_driven,
    torque_driven,
)

SAME = ("speed", "shape", "deflection_rate", "normal_force", "drive_force", "shaft_torque",
        "angular_acceleration", "acceleration", "sphere_acceleration")  # fmt: skip


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


def check_instant(found, expected):
    for name in SAME:
        near(getattr(found, name), expected[name])
    near(found.motion.deflection, expected["deflection"])
    near(found.motion.mount_rate, expected["mount_rate"])


def check_torque_driven(n, with_effects, unilateral=False, seed=0, passage=None):
    rig, now, extra, memory, remembered = prepared(n, with_effects, unilateral, seed)
    expected = at(rig, now, *shapes(rig, with_effects), extra, None, passage)
    if unilateral:
        assert 0 < np.sum(expected["normal_force"] == 0) < n
    state = to_state(rig, now, expected["shape"], remembered, expected["centre_velocity"])
    model = Model(Coupled(rig))
    inputs = Inputs(jnp.asarray(now.torque), jnp.asarray(now.force), jnp.asarray(TIME))
    if passage is None:
        check_instant(instant(model, state, inputs), expected)
    average = None
    if passage is not None:
        average = StepAverage(*map(jnp.asarray, passage))
    rate = torque_driven(model, state, inputs, average)
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


def check_edges(n=4, moments=5):
    """At an edge of a gap the slope is that of the side the wheel turns to; at rest it is none."""
    rig, now, _, _, remembered = prepared(n, False)
    rng, model, rest = np.random.default_rng(2), Model(Coupled(rig)), jnp.zeros(n)
    gaps = rig.gaps
    pitch, width = np.asarray(gaps.pitch), np.asarray(gaps.width)
    slope_inside = -np.asarray(gaps.depth) * 2 * np.pi / width  # of a gated sine at both its ends
    for far in 10 ** np.linspace(0, 5, moments):
        ends = rng.integers(0, 2, n)
        speed = rng.permutation([0.0, *rng.uniform(0.5, 3.0, n - 1)]) * rng.choice([-1, 1], n)
        part = np.where(speed == 0, 0.3, ends)  # the wheel at rest stands inside a gap
        angle = np.floor(rng.uniform(-far, far, n)) * pitch + part * width
        state = to_state(rig, now._replace(angle=angle), np.zeros(n), remembered, np.zeros(3))
        inputs = Inputs(rest, jnp.zeros(3), jnp.asarray(TIME))
        found, *_ = prescribed_instant(model, state, inputs, jnp.asarray(speed), rest)
        depth = -np.asarray(gaps.depth) * np.sin(2 * np.pi * part)
        np.testing.assert_allclose(found.shape, depth, rtol=1e-6, atol=1e-12)
        inward = np.where(ends, speed < 0, speed > 0)
        closing = np.asarray(found.motion.approach_rate - found.motion.mount_rate)
        near(found.deflection_rate, closing - np.where(inward, slope_inside * speed, 0.0), 1e-6)


def check_motor_torque(laws_of, n=4, seed=5):
    """Commands taken back from what the shafts feel under them."""
    rig, now, _, _, remembered = prepared(n, False, seed=seed)
    for law, place in laws_of:
        rig = rig.add(law, place)
    state = to_state(rig, now, shapes(rig, False)[0](now.angle), remembered, np.zeros(3))
    inputs = Inputs(jnp.asarray(now.torque), jnp.asarray(now.force), jnp.asarray(TIME))
    at_once = instant(Model(Coupled(rig)), state, inputs)
    turning = state.angle, state.angular_velocity, state.attitude
    near(motor_torque(rig, at_once, *turning), now.torque)
    far = np.abs(np.asarray(at_once.shaft_torque) - now.torque)
    assert np.all((far > 1e-4) == [any(p in (w, "all") for _, p in laws_of) for w in rig.names])


def laws_of_a_drive():
    """An actuator's, two of a shaft and one of a contact patch."""
    at_motor = laws.EFFECTS["motor-gain"](jnp.asarray(0.4))
    load = laws.EFFECTS["load-friction"](jnp.asarray(0.1), jnp.asarray(0.4))
    patch = laws.RollingResistance(jnp.asarray(2e-3), jnp.asarray(0.4))
    viscous = laws.BearingViscous(jnp.asarray(0.02))
    return [(at_motor, "w1"), (viscous, "w2"), (load, "w3"), (patch, "all")]


CHECKS = {
    "edges of gaps": check_edges,
    "torques, three wheels": lambda: check_torque_driven(3, False),
    "torques, four unlike wheels": lambda: check_torque_driven(4, False),
    "torques, effects": lambda: check_torque_driven(3, True),
    "torques, four wheels, effects": lambda: check_torque_driven(4, True),
    "a wheel lifts off": lambda: check_torque_driven(3, True, unilateral=True, seed=4),
    "means over a step": lambda: check_torque_driven(
        3, True, passage=(np.array([0.074, 0.077, 0.075]), np.array([2e-3, -1e-3, 3e-3]))
    ),
    "speeds": lambda: check_speed_driven(3, True),
    "speeds, four wheels": lambda: check_speed_driven(4, False),
    "radius rate kept": check_kept_radius_rate,
    "commands of drives": lambda: check_motor_torque(laws_of_a_drive()),
    "commands of plain drives": lambda: check_motor_torque([]),
    "commands of shafts alone": lambda: check_motor_torque(laws_of_a_drive()[1:2]),
}


@pytest.mark.parametrize("name", list(CHECKS))
def test_moment(name):
    CHECKS[name]()
