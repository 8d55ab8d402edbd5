"""The machine at one moment by the specification alone: forces and accelerations, in numpy.

Equations 32-46 as they stand in docs/theory.md, nothing eliminated and no shifted momenta:
positions and velocities in, accelerations out.  Laws' contributions are handed in as numbers.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import expm


class Moment(NamedTuple):
    """Positions and velocities of every body, wheels' rows first; inertial frame."""

    displacement: np.ndarray  # m, dR = R_s - R_l
    mount: np.ndarray  # m, Delta
    sphere: np.ndarray  # m/s, velocity of the sphere's centre
    platform: np.ndarray  # m/s
    wheel: np.ndarray  # m/s, each wheel's velocity along its normal
    angle: np.ndarray  # rad
    turning: np.ndarray  # rad/s, Omega
    attitude: np.ndarray  # unit quaternion
    torque: np.ndarray  # N m
    force: np.ndarray  # N, P


class Extra(NamedTuple):
    """What laws add at the ports; functions where a law hears what the moment holds."""

    contact: Any = lambda deflection, rate: 0.0  # N
    mount: Any = lambda deflection, rate: 0.0  # N
    shaft: Any = lambda angle, speed: 0.0  # N m
    rolling: Any = lambda roll, spin, normal: (0.0, 0.0)  # N m, oppose
    body: Any = lambda turning, rotation: np.zeros(3)  # N m
    floor: np.ndarray = np.zeros(3)  # m/s^2
    creep: Any = 0.0
    unilateral: bool = False


def rotation(q) -> np.ndarray:
    """Matrix body frame -> inertial frame: columns are the body's axes, by q e q*."""
    w, v = q[0], np.asarray(q[1:])
    columns = [e + 2 * w * np.cross(v, e) + 2 * np.cross(v, np.cross(v, e)) for e in np.eye(3)]
    return np.stack(columns, axis=1)


def slope(function, x, step) -> np.ndarray:
    """Derivative by central differences of the fourth order."""
    near, far = (function(x + k * step) - function(x - k * step) for k in (1, 2))
    return (8 * near - far) / (12 * step)


def at(rig, now: Moment, rho, surface, extra: Extra, spin_up=None) -> dict[str, np.ndarray]:
    """Everything that follows; `rho(angle)` and `surface(rotation)` are the shapes in m.

    `spin_up` = (speed, its rate) where a drive prescribes them: then Omega follows, as nearly as
    the wheels agree, and the torques are those that it takes.
    """
    w, R = rig.wheels, float(rig.sphere.radius)
    r, v = np.asarray(w.normal), np.asarray(w.drive)
    K, C = np.asarray(w.contact.stiffness), np.asarray(w.contact.damping)
    k, c = np.asarray(w.mount.stiffness), np.asarray(w.mount.damping)
    N0, closing = np.asarray(w.closure.preload), np.asarray(w.closure.stiffness)
    m, Iw = np.asarray(w.mass), np.asarray(w.inertia)
    Ms, Ml = float(rig.sphere.mass), float(rig.platform.mass)
    axes, Q, omega = -np.cross(r, v), rotation(now.attitude), now.turning

    def rolling_radius_at(angle):
        return (1 - extra.creep) * (np.asarray(w.radius) + rho(angle))

    rolling_radius = rolling_radius_at(now.angle)
    speed = R * (axes @ omega) / rolling_radius
    if spin_up is not None:
        speed, faster = spin_up

        def omega_after(t):
            rim = rolling_radius_at(now.angle + t * speed + t * t / 2 * faster)
            return np.linalg.lstsq(R * axes, rim * (speed + t * faster), rcond=None)[0]

        omega = omega_after(0.0)

    spinning = np.cross(np.eye(3), omega)  # the matrix of Omega x
    shape = rho(now.angle) + surface(Q)
    shape_rate = slope(lambda t: rho(now.angle + t * speed), 0.0, 1e-5)
    shape_rate = shape_rate + slope(lambda t: surface(expm(t * spinning) @ Q), 0.0, 1e-4)

    mount_rate = now.wheel - r @ now.platform
    deflection = r @ now.displacement - now.mount - shape
    deflection_rate = r @ (now.sphere - now.platform) - mount_rate - shape_rate
    normal = N0 - K * deflection - C * deflection_rate - extra.contact(deflection, deflection_rate)
    if extra.unilateral:
        normal = np.maximum(normal, 0.0)
    mount = k * now.mount + c * mount_rate + extra.mount(now.mount, mount_rate)

    roll, spin = extra.rolling(axes @ omega, -r @ omega, np.maximum(normal, 0.0))
    inertia = Q @ np.asarray(rig.sphere.inertia_matrix) @ Q.T
    opposing = np.cross(omega, inertia @ omega) + axes.T @ (roll + 0 * normal)
    opposing = opposing - r.T @ (spin + 0 * normal) - extra.body(omega, Q)
    torque = now.torque + extra.shaft(now.angle, speed) - roll
    n, zero = len(r), np.zeros
    rows = [  # I_w w' = T - r_w f,  I W' = R [axes] f - g,  r_w w' = R axes . W'
        np.hstack([np.diag(rolling_radius), np.diag(Iw), zero((n, 3))]),
        np.hstack([-R * axes.T, zero((3, n)), inertia]),
        np.hstack([zero((n, n)), -np.diag(rolling_radius), R * axes]),
    ]
    right = np.concatenate([torque, -opposing, zero(n)])
    found = np.linalg.lstsq(np.vstack(rows), right, rcond=None)[0]
    drive, turning = found[:n], found[2 * n :]
    if spin_up is not None:
        turning = slope(omega_after, 0.0, 1e-5)
        drive = np.linalg.lstsq(R * axes.T, inertia @ turning + opposing, rcond=None)[0]
        torque = Iw * faster + rolling_radius * drive

    closure = -((N0 + closing * (r @ now.displacement)) @ r)
    across = Ml * np.eye(3) + sum(
        mass * (np.eye(3) - np.outer(e, e)) for mass, e in zip(m, r, strict=True)
    )
    push = now.force + (mount - N0) @ r - drive @ v - closure
    total = Ms + Ml + m.sum()
    q0, qv = now.attitude[0], now.attitude[1:]
    return {
        "speed": speed,
        "shape": shape,
        "shape_rate": shape_rate,
        "deflection": deflection,
        "deflection_rate": deflection_rate,
        "mount_rate": mount_rate,
        "normal_force": normal,
        "drive_force": drive,
        "shaft_torque": torque,
        "angular_acceleration": turning,
        "acceleration": np.linalg.solve(across, push) + extra.floor,
        "sphere_acceleration": (normal @ r + drive @ v + closure) / Ms,
        "wheel_acceleration": (N0 - normal - mount) / m,
        "drift": (now.force + across @ extra.floor) / total,  # of the centre of mass
        "attitude": 0.5 * np.concatenate([[-omega @ qv], q0 * omega + np.cross(omega, qv)]),
        "centre_velocity": (Ms * now.sphere + across @ now.platform + (m * now.wheel) @ r) / total,
        "turning": omega,
        "rolling_radius": rolling_radius,
    }
