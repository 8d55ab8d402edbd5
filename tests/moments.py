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
    actuator: Any = lambda torque, angle: torque  # N m, delivered
    shaft: Any = lambda angle, speed, delivered: 0.0  # N m
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


class Parts(NamedTuple):
    """A rig's numbers in numpy, in the specification's symbols; wheels' rows first."""

    R: float
    r: np.ndarray  # normals
    v: np.ndarray  # drives
    axes: np.ndarray  # that the wheels drive
    r_b: np.ndarray
    K: np.ndarray
    C: np.ndarray
    k: np.ndarray
    c: np.ndarray
    N0: np.ndarray
    closing: np.ndarray
    m: np.ndarray
    I_w: np.ndarray
    M_s: float
    M_l: float
    inertia: np.ndarray  # body frame


def parts_of(rig) -> Parts:
    """`Parts` of a rig."""
    w = rig.wheels
    r, v = np.asarray(w.normal), np.asarray(w.drive)
    rows = (w.radius, w.contact.stiffness, w.contact.damping, w.mount.stiffness, w.mount.damping,
            w.closure.preload, w.closure.stiffness, w.mass, w.inertia)  # fmt: skip
    return Parts(
        float(rig.sphere.radius), r, v, -np.cross(r, v), *map(np.asarray, rows),
        float(rig.sphere.mass), float(rig.platform.mass), np.asarray(rig.sphere.inertia_matrix),
    )  # fmt: skip


class Rolled(NamedTuple):
    """What the wheels' rolling gives at one moment."""

    speed: np.ndarray  # rad/s, omega
    omega: np.ndarray  # rad/s, Omega
    radius: np.ndarray  # m, r_w
    shape: np.ndarray  # m
    shape_rate: np.ndarray  # m/s
    turning: np.ndarray | None  # rad/s^2, where speeds are prescribed


def rolled(p: Parts, now: Moment, rho, surface, creep, spin_up, passage) -> Rolled:
    """Eqs. 39, 43, 44: speeds from Omega, or Omega from prescribed speeds, by least squares."""

    def radius_at(angle):
        return (1 - creep) * (p.r_b + rho(angle))

    def omega_after(t):
        speed, faster = spin_up
        rim = radius_at(now.angle + t * speed + t * t / 2 * faster) * (speed + t * faster)
        return np.linalg.lstsq(p.R * p.axes, rim, rcond=None)[0]

    radius = radius_at(now.angle) if passage is None else passage[0]
    omega = now.turning if spin_up is None else omega_after(0.0)
    speed = p.R * (p.axes @ omega) / radius if spin_up is None else spin_up[0]
    Q, spinning = rotation(now.attitude), np.cross(np.eye(3), omega)  # the matrix of Omega x
    if passage is None:
        rate = slope(lambda t: rho(now.angle + t * speed), 0.0, 1e-5)
        rate = rate + slope(lambda t: surface(expm(t * spinning) @ Q), 0.0, 1e-4)
    else:
        rate = passage[1]
    turning = None if spin_up is None else slope(omega_after, 0.0, 1e-5)
    return Rolled(speed, omega, radius, rho(now.angle) + surface(Q), rate, turning)


def contacts(p: Parts, now: Moment, rolls: Rolled, extra: Extra) -> dict[str, np.ndarray]:
    """Deflections, normal forces and mount tensions."""
    mount_rate = now.wheel - p.r @ now.platform
    deflection = p.r @ now.displacement - now.mount - rolls.shape
    rate = p.r @ (now.sphere - now.platform) - mount_rate - rolls.shape_rate
    normal = p.N0 - p.K * deflection - p.C * rate - extra.contact(deflection, rate)
    if extra.unilateral:
        normal = np.maximum(normal, 0.0)
    mount = p.k * now.mount + p.c * mount_rate + extra.mount(now.mount, mount_rate)
    return {"deflection": deflection, "deflection_rate": rate, "normal_force": normal,
            "mount_rate": mount_rate, "mount_tension": mount}  # fmt: skip


def rotating(p: Parts, now: Moment, rolls: Rolled, normal, extra: Extra, spin_up):
    """Drive forces, dOmega/dt and shaft torques: eqs. 39, 40, 43 in one system, un-eliminated."""
    omega, axes, n, zero = rolls.omega, p.axes, len(p.r), np.zeros
    roll, spin = extra.rolling(axes @ omega, -p.r @ omega, np.maximum(normal, 0.0))
    Q = rotation(now.attitude)
    inertia = Q @ p.inertia @ Q.T
    opposing = np.cross(omega, inertia @ omega) + axes.T @ (roll + 0 * normal)
    opposing = opposing - p.r.T @ (spin + 0 * normal) - extra.body(omega, Q)
    if spin_up is not None:
        drive = np.linalg.lstsq(p.R * axes.T, inertia @ rolls.turning + opposing, rcond=None)[0]
        return drive, rolls.turning, p.I_w * spin_up[1] + rolls.radius * drive
    given = extra.actuator(now.torque, now.angle)
    torque = given + extra.shaft(now.angle, rolls.speed, given) - roll
    rows = [  # I_w w' = T - r_w f,  I W' = R [axes] f - g,  r_w w' = R axes . W'
        np.hstack([np.diag(rolls.radius), np.diag(p.I_w), zero((n, 3))]),
        np.hstack([-p.R * axes.T, zero((3, n)), inertia]),
        np.hstack([zero((n, n)), -np.diag(rolls.radius), p.R * axes]),
    ]
    right = np.concatenate([torque, -opposing, zero(n)])
    found = np.linalg.lstsq(np.vstack(rows), right, rcond=None)[0]
    return found[:n], found[2 * n :], torque


def translating(p: Parts, now: Moment, contact, drive, floor) -> dict[str, np.ndarray]:
    """Newton's second law of sphere, wheels and platform, and of the centre of mass."""
    normal, mount = contact["normal_force"], contact["mount_tension"]
    closure = -((p.N0 + p.closing * (p.r @ now.displacement)) @ p.r)
    across = p.M_l * np.eye(3) + sum(
        mass * (np.eye(3) - np.outer(e, e)) for mass, e in zip(p.m, p.r, strict=True)
    )
    push = now.force + (mount - p.N0) @ p.r - drive @ p.v - closure
    total = p.M_s + p.M_l + p.m.sum()
    momentum = p.M_s * now.sphere + across @ now.platform + (p.m * now.wheel) @ p.r
    return {
        "acceleration": np.linalg.solve(across, push) + floor,
        "sphere_acceleration": (normal @ p.r + drive @ p.v + closure) / p.M_s,
        "wheel_acceleration": (p.N0 - normal - mount) / p.m,
        "drift": (now.force + across @ floor) / total,  # of the centre of mass
        "centre_velocity": momentum / total,
    }


def at(
    rig, now: Moment, rho, surface, extra: Extra, spin_up=None, passage=None
) -> dict[str, np.ndarray]:
    """Everything that follows; `rho(angle)` and `surface(rotation)` are the shapes in m.

    `spin_up` = (speed, its rate) where a drive prescribes them: then Omega follows, as nearly as
    the wheels agree, and the torques are those that it takes.  `passage` = (rolling radius, rate
    of the shape) where a step's mean stands for the moment's own.
    """
    p = parts_of(rig)
    rolls = rolled(p, now, rho, surface, extra.creep, spin_up, passage)
    contact = contacts(p, now, rolls, extra)
    drive, turning, torque = rotating(p, now, rolls, contact["normal_force"], extra, spin_up)
    q0, qv, omega = now.attitude[0], now.attitude[1:], rolls.omega
    return {
        **contact,
        **translating(p, now, contact, drive, extra.floor),
        "speed": rolls.speed,
        "shape": rolls.shape,
        "shape_rate": rolls.shape_rate,
        "drive_force": drive,
        "shaft_torque": torque,
        "angular_acceleration": turning,
        "attitude": 0.5 * np.concatenate([[-omega @ qv], q0 * omega + np.cross(omega, qv)]),
        "turning": omega,
        "rolling_radius": rolls.radius,
    }


def near(found, expected, rtol=1e-7):
    """Equal to `rtol` of the largest of `expected`."""
    np.testing.assert_allclose(found, expected, atol=rtol * np.abs(expected).max() + 1e-300)
