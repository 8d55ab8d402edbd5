"""Numbers worked out by hand from the file formats' table of effects, for every law.

Each case is law parameters, (port, what the port hands over), and what comes back; the arithmetic
stands beside it where it is more than one product.  `PROFILES` has the wheel shapes' numbers.
"""

import math

import jax.numpy as jnp
import numpy as np

from omnijax import laws

GAPS = laws.Gap(*(jnp.asarray(x) for x in (1.2, 0.06, 10.0, 0.4)))  # R, r_b, n, eta
ANGLE = 0.3  # rad


def contact(deflection=0.0, rate=0.0, stiffness=2e5, preload=150.0):
    """What a contact hands over; damping 120 N s/m and R' = 0.07 m enter no force of a law."""
    return "contact", laws.ContactSignal(
        *(jnp.asarray(x) for x in (deflection, rate, stiffness, 120.0, preload, 0.07))
    )


def mount(deflection=0.0, rate=0.0, stiffness=1e6):
    return "mount", laws.MountSignal(*map(jnp.asarray, (deflection, rate, stiffness, 60.0)))


def shaft(angle=0.0, speed=0.0, command=0.0, load=0.0):
    values = {"angle": angle, "speed": speed, "command": command, "load": load}
    known = {k: jnp.asarray(values[k]) for k in laws.ShaftSignal._fields}
    return "shaft", laws.ShaftSignal(**known)


def actuator(torque, angle=0.0, speed=0.0):
    return "actuator", laws.ActuatorSignal(*map(jnp.asarray, (torque, angle, speed)))


def rolling(roll, spin, normal_force, friction):
    return "rolling", laws.RollingSignal(*map(jnp.asarray, (roll, spin, normal_force, friction)))


def body(velocity, rotation=((1, 0, 0), (0, 1, 0), (0, 0, 1)), mass=5.0, gravity=(0, 0, -9.81)):
    arrays = (jnp.asarray(x, float) for x in (velocity, rotation, mass, gravity))
    return "sphere", laws.BodySignal(*arrays)


def sensor(time, values):
    values = np.asarray(values, float).reshape(len(time), -1)
    return "sensor", laws.SensorSignal(jnp.asarray(time, float), jnp.asarray(values))


TANH_2 = 0.9640275800758169  # tanh(2)
TANH_HALF = 0.46211715726000973
# quarter turn about z: body x points along y
QUARTER = ((0, -1, 0), (1, 0, 0), (0, 0, 1))
RAMP = [0.0, 0.1, 0.2, 0.3, 0.4], [3.0, 3.0, 3.0, 5.0, 7.0]
SQUARES = [0.0, 0.1, 0.2, 0.3, 0.4], [0.0, 1.0, 4.0, 9.0, 16.0]

# effect: [(parameters, (port, signal), value), ...]
TABLE = {
    # A cos(theta - phi): cos(0.3 - 0.1)
    "wheel-runout": [
        ({"amplitude": 4e-5, "phase": 0.1}, ("shape", ANGLE), 4e-5 * 0.9800665778412416),
        ({"amplitude": 4e-5, "phase": 0.3 - math.pi / 2}, ("shape", ANGLE), 0.0),
        ({"amplitude": 4e-5, "phase": 0.3 + math.pi}, ("shape", ANGLE), -4e-5),
    ],
    # P2 = (3 u^2 - 1)/2 of u = e . R: 0.8 -> 0.46; 0 -> -1/2; an axis of any length
    "sphere-out-of-round": [
        ({"amplitude": 2e-4, "axis": (0, 0, 1)}, ("surface", (0.6, 0.0, 0.8)), 0.92e-4),
        ({"amplitude": 2e-4, "axis": (0, 0, -3)}, ("surface", (0.6, 0.0, 0.8)), 0.92e-4),
        ({"amplitude": 2e-4, "axis": (0, 2, 0)}, ("surface", (0.6, 0.0, 0.8)), -1e-4),
    ],
    "contact-cubic": [
        ({"K3": 2e12}, contact(3e-5, rate=0.7), 0.054),
        ({"K3": 2e12}, contact(-1e-5), -0.002),
    ],
    # d0 = 1.5 * 160 / 2e5 = 1.2 mm; delta = 0.9 mm leaves a quarter: 160 (1 - 1/8) - 2e5 * 9e-4
    # delta = -3.6 mm: 160 (1 - 4^1.5) + 720; gone beyond d0: 160 - 2e5 * 2e-3
    "contact-hertz": [
        ({}, contact(9e-4, rate=0.3, preload=160.0), 140.0 - 180.0),
        ({}, contact(-3.6e-3, preload=160.0), -1120.0 + 720.0),
        ({}, contact(2e-3, preload=160.0), 160.0 - 400.0),
        # exponent 2: d0 = 1.6 mm, half of it left: 160 (1 - 1/4) - 2e5 * 8e-4
        ({"exponent": 2.0}, contact(8e-4, preload=160.0), 120.0 - 160.0),
    ],
    "mount-cubic": [
        ({"k3": 5e12}, mount(2e-5, rate=0.2), 0.04),
        ({"k3": 5e12}, mount(-1e-5), -0.005),
    ],
    # k Delta becomes k sign(Delta) max(|Delta| - b, 0): inside the gap the spring is gone
    "mount-backlash": [
        ({"gap": 5e-6}, mount(3e-6, rate=0.1), -3.0),
        ({"gap": 5e-6}, mount(-3e-6), 3.0),
        ({"gap": 5e-6}, mount(2e-5), -5.0),
        ({"gap": 5e-6}, mount(-2e-5, stiffness=2e6), 10.0),
    ],
    "mount-friction": [
        ({"force": 3.0, "width": 2e-3}, mount(5e-5, rate=4e-3), 3.0 * TANH_2),
        ({"force": 3.0, "width": 2e-3}, mount(5e-5, rate=-1e-3), -3.0 * TANH_HALF),
        ({"force": 3.0}, mount(rate=2e-3), 3.0 * TANH_2),  # v0 = 1e-3 m/s where none is given
    ],
    "bearing-coulomb": [
        ({"torque": 0.04, "width": 0.1}, shaft(0.7, 0.2, 0.9), -0.04 * TANH_2),
        ({"torque": 0.04, "width": 0.1}, shaft(0.7, -0.05), 0.04 * TANH_HALF),
        ({"torque": 0.04}, shaft(speed=0.1), -0.04 * TANH_2),  # omega0 = 0.05 rad/s
    ],
    "bearing-viscous": [
        ({"b": 0.02}, shaft(0.7, 3.0, 0.9), -0.06),
        ({"b": 0.02}, shaft(0.7, -0.5), 0.01),
    ],
    # sin(7 * 0.2 + 0.1) = sin 1.5
    "motor-ripple": [
        (
            {"amplitude": 0.01, "order": 7.0, "phase": 0.1},
            shaft(0.2, 3.0, 0.9),
            0.01 * 0.9974949866040544,
        ),
        ({"amplitude": 0.01, "order": 2.5, "phase": 0.0}, shaft(-math.pi / 5), -0.01),
    ],
    "motor-gain": [
        ({"g": 0.05}, actuator(0.8, 0.2, 3.0), 0.04),
        ({"g": -0.05}, actuator(-0.6, 0.2, 3.0), 0.03),
    ],
    # (about the driven axis, about the normal, on the shaft)
    "rolling-resistance": [
        (
            {"arm": 1e-3, "width": 0.01},
            rolling(0.02, -0.5, 150.0, 0.8),
            (0.15 * TANH_2, 0.0, 0.15 * TANH_2),
        ),
        ({"arm": 1e-3}, rolling(-6e-3, 0.5, 150.0, 0.8), (-0.15 * TANH_2, 0, -0.15 * TANH_2)),
    ],
    "spin-resistance": [
        (
            {"lever": 5e-4, "width": 0.01},
            rolling(-0.5, 0.02, 150.0, 0.8),
            (0.0, 0.06 * TANH_2, 0.0),
        ),
        ({"lever": 5e-4}, rolling(0.5, -1.5e-3, 150.0, 0.8), (0, -0.06 * TANH_HALF, 0)),
    ],
    # |(0.6, 0, -0.8)| = 1 and |(3, 0, 4)| = 5
    "air-drag": [
        ({"D": 0.2}, body((0.6, 0.0, -0.8)), (-0.12, 0.0, 0.16)),
        ({"D": 0.2}, body((3.0, 0.0, 4.0)), (-3.0, 0.0, -4.0)),
    ],
    # (offset in the inertial frame) x (5 kg * 9.81 m/s^2 downwards)
    "unbalance": [
        ({"offset": (2e-3, 0, 0)}, body((0, 0, 0)), (0.0, 0.0981, 0.0)),
        ({"offset": (2e-3, 0, 0)}, body((9, 9, 9), QUARTER), (-0.0981, 0.0, 0.0)),
        ({"offset": (0, 1e-3, 4e-3)}, body((0, 0, 0), mass=10.0), (-0.0981, 0.0, 0.0)),
    ],
    # A sin(2 pi f t + phi) d, d of length 1: sin(2 pi 2.5 0.1 + 0) = 1, sin(pi/6) = 1/2
    "floor-vibration": [
        (
            {"amplitude": 0.3, "frequency": 2.5, "phase": 0.0, "direction": (0, 3, 4)},
            ("platform", 0.1),
            (0.0, 0.18, 0.24),
        ),
        (
            {"amplitude": 0.3, "frequency": 2.5, "phase": math.pi / 6, "direction": (1, 0, 0)},
            ("platform", 0.0),
            (0.15, 0.0, 0.0),
        ),
    ],
    # R axis . Omega = (1 - s) r_w omega: the factor changes by -s, at any speed
    "creep": [
        ({"creepage": 2e-3}, ("kinematics", 1.7), -2e-3),
        ({"creepage": -3e-3}, ("kinematics", -0.4), 3e-3),
    ],
    # sensors return what they add to each sample
    "sensor-gain": [
        ({"g": 0.1}, sensor([0, 1], [[2.0, -3.0, 0.0]] * 2), [[0.2, -0.3, 0.0]] * 2),
    ],
    # a ramp of 20/s from 0.2 s on, half and a whole sample later
    "sensor-delay": [
        ({"delay": 0.1}, sensor(*RAMP), [[0.0], [0.0], [0.0], [-2.0], [-2.0]]),
        ({"delay": 0.2}, sensor(*RAMP), [[0.0], [0.0], [0.0], [-2.0], [-4.0]]),
        ({"delay": 0.0}, sensor(*RAMP), [[0.0]] * 5),
        # cubic at the middle of 3 -> 3 and of 3 -> 5: mean + (tangent before - after)/8
        ({"delay": 0.15}, sensor(*RAMP), [[0], [0], [0], [2.875 - 5], [3.875 - 7]]),
        # squares, half a sample later; the first sample stands before them: 1/2 + (1/2 - 2)/8;
        # the parabola goes on behind the last one: 3.5^2
        ({"delay": 0.05}, sensor(*SQUARES), [[0], [-0.6875], [-1.75], [-2.75], [-3.75]]),
    ],
    "sensor-drift": [
        ({"a": 2e-5, "b": -1e-6}, sensor([0, 4], [[1.0], [1.0]]), [[2e-5], [1.6e-5]]),
    ],
    # row: what x, y, z measure too much; dR = (1, 10, 100)
    "sensor-crosstalk": [
        ({"X_xy": 0.01}, sensor([0, 1], [[1, 10, 100]] * 2), [[0.1, 0, 0]] * 2),
        ({"X_xz": 0.01}, sensor([0, 1], [[1, 10, 100]] * 2), [[1.0, 0, 0]] * 2),
        ({"X_yx": 0.01}, sensor([0, 1], [[1, 10, 100]] * 2), [[0, 0.01, 0]] * 2),
        ({"X_yz": 0.01}, sensor([0, 1], [[1, 10, 100]] * 2), [[0, 1.0, 0]] * 2),
        ({"X_zx": 0.01}, sensor([0, 1], [[1, 10, 100]] * 2), [[0, 0, 0.01]] * 2),
        ({"X_zy": 0.01}, sensor([0, 1], [[1, 10, 100]] * 2), [[0, 0, 0.1]] * 2),
    ],
    # N = max(0, N): what is added to the normal force
    "lift-off": [
        ({}, ("separation", -5.0), 5.0),
        ({}, ("separation", 5.0), 0.0),
    ],
    # ---- second part of the table
    "wheel-radius": [({"s": 0.02}, ("radius", 0.06), 0.0012)],
    "actuator-delay": [({"delay": 0.03}, ("command", 1.5), -0.03)],
    "actuator-saturation": [
        ({"limit": 0.5}, actuator(0.8), -0.3),
        ({"limit": 0.5}, actuator(-0.8), 0.3),
        ({"limit": 0.5}, actuator(0.3), 0.0),
    ],
    # 0.1 sin(3.5 * 0.4 + 0.1) * 0.8
    "current-ripple": [
        ({"g": 0.1, "order": 3.5, "phase": 0.1}, actuator(0.8, 0.4), 0.08 * 0.9974949866040544),
    ],
    # 0.01 (sin(theta + 0.1) - sin(0.2 + 0.1)) at theta = 0.2, 0.9, -0.4
    "encoder-eccentricity": [
        (
            {"amplitude": 0.01, "phase": 0.1},
            sensor([0.0, 0.1, 0.2], [0.2, 0.9, -0.4]),
            [0.0, 0.01 * (0.8414709848078965 - 0.29552020666133955),
             -0.02 * 0.29552020666133955],
        ),
    ],
    # a ramp of 1/0.1 s from rest lags by tau (1 - exp(-t/tau)): y = x - tau rate (1 - exp(-t/tau))
    "sensor-lag": [
        (
            {"tau": 0.1},
            sensor([0.0, 0.1, 0.3], [2.0, 3.0, 5.0]),
            [0.0, -(1 - 0.36787944117144233), -(1 - 0.049787068367863944)],
        ),
    ],
    "sensor-saturation": [
        ({"limit": 2.5}, sensor([0.0, 0.1, 0.2], [2.0, -3.0, 5.0]), [0.0, 0.5, -2.5]),
    ],
    "sensor-rectified": [({}, sensor([0.0, 0.1], [2.0, -3.0]), [0.0, 6.0])],
    "torque-offset": [({"torque": -0.03}, shaft(0.7, 2.0, 0.9), -0.03)],
    # 0.02 sin(3.5 * 0.4 + 0.1) - 0.01 sin(2 * 0.4 - 0.3)
    "cogging": [
        (
            {"amplitudes": (0.02, -0.01), "orders": (3.5, 2.0), "phases": (0.1, -0.3)},
            shaft(0.4, 2.0, 0.9),
            0.02 * 0.9974949866040544 - 0.01 * 0.479425538604203,
        ),
    ],
    # exp(-(1.5/3)^2) = exp(-1/4); tanh saturated
    "stribeck": [
        ({"torque": 0.05, "speed": 3.0}, shaft(0.7, 1.5, 0.9), -0.05 * 0.7788007830714049),
        ({"torque": 0.05, "speed": 3.0}, shaft(0.7, -3.0, 0.9), 0.05 * 0.36787944117144233),
        ({"torque": 0.05, "speed": 1e9}, shaft(speed=0.1), -0.05 * TANH_2),
    ],
    "load-friction": [
        ({"mu": 0.1}, shaft(0.7, 5.0, 0.9, -0.4), -0.04),
        ({"mu": 0.1}, shaft(0.7, -0.1, 0.9, 0.4), 0.04 * TANH_2),
    ],
    "friction-asymmetry": [
        ({"torque": 0.05}, shaft(0.7, 0.1, 0.9), -0.05 * TANH_2),
        ({"torque": 0.05}, shaft(0.7, -0.1, 0.9), -0.05 * TANH_2),
    ],
}  # fmt: skip

# theta_p = 36 deg, theta_s = 0.4 theta_p = 0.251327 rad; q = 0.05 sin(theta_s/2) = 6.266662e-3;
# Dr = 1.2 (1 - sqrt(1 - q^2)) + 0.06 (1 - cos 0.1256637) = 2.356293e-5 + 4.731192e-4
DEPTH = 1.2 * (1 - math.sqrt(1 - (0.05 * math.sin(0.04 * math.pi)) ** 2)) + 0.06 * (
    1 - math.cos(0.04 * math.pi)
)
GAP = 0.08 * math.pi  # rad, width of a gap
PITCH = 0.2 * math.pi
EDGE = 0.02 * math.pi  # a quarter of the gap: that far from its nearer edge
PIVOT = 1.2 * (1 - math.sqrt(1 - (0.05 * math.sin(EDGE)) ** 2)) + 0.06 * (1 - math.cos(EDGE))

# profile: [(angle, rho in m)]
PROFILES = {
    "gated-sine": [
        (GAP / 4, -DEPTH), (3 * GAP / 4, DEPTH), (GAP / 2, 0.0), (GAP / 12, -DEPTH / 2),
        (1.01 * GAP, 0.0), (0.99 * PITCH, 0.0), (3 * PITCH + GAP / 4, -DEPTH),
        (GAP / 4 - PITCH, -DEPTH),
    ],
    "half-sine": [
        (GAP / 2, -DEPTH), (GAP / 6, -DEPTH / 2), (1.01 * GAP, 0.0), (2 * PITCH + GAP / 2, -DEPTH),
        (0.99 * PITCH, 0.0),
    ],
    # n theta/eta = 25 theta
    "continuous-sine": [
        (math.pi / 50, -DEPTH), (3 * math.pi / 50, DEPTH), (math.pi / 150, -DEPTH / 2),
        (PITCH + math.pi / 50, -DEPTH * math.cos(5 * math.pi)),
    ],
    "rollers": [
        (GAP / 4, -PIVOT), (3 * GAP / 4, -PIVOT), (GAP / 2, -DEPTH), (1.01 * GAP, 0.0),
        (PITCH + GAP / 4, -PIVOT),
    ],
}  # fmt: skip
