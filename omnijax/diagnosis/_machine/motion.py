"""What the wheel angles say of the motion: rolled lengths, speeds, attitude, on fine grids."""

import dataclasses
import functools

import numpy as np
from scipy.interpolate import CubicSpline

from ..._errors import InputError
from ...dynamics import spin_axes
from ...laws import DualRow
from ...rig import Rig
from .._settings import SETTINGS
from .laws import along, readings
from .runs import FINE, SHAPE, Run, filled
from .smooth import smooth_by_likelihood
from .wheels import WheelTables, wheel_tables


@dataclasses.dataclass(frozen=True)
class RunMotion:
    """Motion of one run at `FINE` points a sample, from smoothed wheel angles.

    `length` is the measured rolled length S(theta) at the samples, `theta` the angle at `SHAPE`
    points a sample.
    """

    length: np.ndarray  # (samples, n) rad of sphere, measured
    smoothed: np.ndarray  # (samples, n)
    theta_shape: np.ndarray  # (.., n) rad at SHAPE points
    theta: np.ndarray  # (.., n) rad
    speed: np.ndarray  # (.., n) rad/s
    rho: np.ndarray  # (.., n) m at SHAPE points, the wheels' shapes
    shape: np.ndarray  # (.., n) m
    shape_rate: np.ndarray  # (.., n) m/s
    factor: np.ndarray  # (.., n) creep factor of the rolling radius
    axes: np.ndarray  # (.. or 1, n, 3)
    turning: np.ndarray  # (.., 3) rad/s, Omega from the wheels
    step: float  # s, of the FINE points

    @functools.cached_property
    def attitude(self) -> np.ndarray:
        """Rotation matrices body -> inertial, (.., 3, 3)."""
        return attitude(self.turning, self.step)


def true_angles(rig: Rig, run: Run, wheels: int) -> np.ndarray:
    """Wheel angles behind the encoders: the sensors' laws taken off by fixed-point iteration."""
    measured = run.outputs.get("theta")
    if measured is None:
        return np.full((run.samples, wheels), np.nan)
    if not any(p.group == "theta" for p in rig.at("sensor")):
        return measured
    known = filled(measured)  # a law with memory must not carry a gap on
    angle = known
    for _ in range(SETTINGS.prediction.angle_turns):
        angle = angle + known - readings(rig, "theta", run.time, angle)
    return np.where(np.isfinite(measured), angle, np.nan)


def measured_lengths(rig: Rig, tables: WheelTables, run: Run) -> np.ndarray:
    """S(theta) at the samples; a wheel without encoder gets the integral of Omega."""
    length = tables.rolled(true_angles(rig, run, rig.size))
    missing = np.isnan(length).all(axis=0)
    if missing.any():
        turning = run.outputs.get("Omega")
        if turning is None:
            raise InputError(
                f"{run.name}: neither theta nor Omega of wheel "
                f"{', '.join(np.array(rig.names)[missing])} was measured;"
                " one of them is needed."
            )
        rate = smooth_by_likelihood(turning, _scatter(turning)) @ np.asarray(rig.wheels.spin_axis).T
        mean = (rate[1:] + rate[:-1]) / 2 * run.step
        integral = np.concatenate([np.zeros((1, rig.size)), np.cumsum(mean, axis=0)])
        start = np.zeros(rig.size) if run.start is None else run.start
        length[:, missing] = (integral + tables.rolled(start[None]))[:, missing]
    return length


def _scatter(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(np.diff(values, 3, axis=0) ** 2) / 20)) or 1e-12


def motion(rig, tables: WheelTables, run: Run, length, smoothed: np.ndarray) -> RunMotion:
    """Everything the elastic and the rotation model need, from smoothed rolled lengths."""
    radius = float(rig.sphere.radius)
    spline = CubicSpline(run.time, smoothed)
    theta_shape = tables.unrolled(spline(run.fine(SHAPE)))
    theta = theta_shape[:: SHAPE // FINE]
    rate = spline.derivative()(run.fine(FINE))
    rho = tables.rho(theta_shape)
    shape = rho[:: SHAPE // FINE]
    speed = rate * radius / (np.asarray(rig.wheel_radius) + shape)
    factor = np.ones_like(speed)
    for placed in rig.at("kinematics"):
        for i in placed.wheels:
            factor[:, i] += along(placed.law, speed[:, i])
    axes = _axes(rig, theta)
    rim = factor * rate
    turning = np.einsum("tij,tj->ti", np.linalg.pinv(axes), rim)
    return RunMotion(
        length=length,
        smoothed=smoothed,
        theta_shape=theta_shape,
        theta=theta,
        speed=speed,
        rho=rho,
        shape=shape,
        shape_rate=tables.rho_slope(theta) * speed,
        factor=factor,
        axes=axes,
        turning=turning,
        step=run.step / FINE,
    )


def _axes(rig: Rig, theta) -> np.ndarray:
    if any(isinstance(p, DualRow) for p in rig.profiles):
        import jax

        return np.asarray(jax.vmap(lambda a: spin_axes(rig, a))(theta))
    return np.asarray(rig.wheels.spin_axis)[None]


def attitude(turning: np.ndarray, step: float) -> np.ndarray:
    """Rotation matrices from Omega (t, 3): products of small turns about a step's mean Omega.

    The algebra of `dynamics` over whole arrays at once, for products by doubling; a test holds the
    two together.
    """
    half = (turning[1:] + turning[:-1]) / 2 * step / 2
    size = np.linalg.norm(half, axis=1)
    sinc = np.sinc(size / np.pi)
    q = np.concatenate([[[1.0, 0, 0, 0]], np.column_stack([np.cos(size), half * sinc[:, None]])])
    jump = 1
    while jump < len(q):  # prefix products by doubling: later turns stand on the left
        q[jump:] = _product(q[jump:], q[:-jump].copy())
        jump *= 2
    w, x, y, z = q.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _product(a, b):
    w, v, u, r = a[:, :1], a[:, 1:], b[:, :1], b[:, 1:]
    scalar = w * u - np.sum(v * r, axis=1, keepdims=True)
    return np.concatenate([scalar, w * r + u * v + np.cross(v, r)], axis=1)


def tables_for(rig: Rig, runs: list[Run]) -> WheelTables:
    """Tables that cover the runs' angles."""
    angles = [r.outputs["theta"] for r in runs if "theta" in r.outputs]
    low = min((np.nanmin(a) for a in angles), default=-1e3)
    high = max((np.nanmax(a) for a in angles), default=1e3)
    return wheel_tables(rig, float(low), float(high))


def rolling_radius(rig: Rig, m: RunMotion) -> np.ndarray:
    """Radius (FINE points, n) m at which every wheel rolls: with its shape and its creep."""
    return m.factor * (np.asarray(rig.wheel_radius) + m.shape)


def contact_directions(rig: Rig, m: RunMotion) -> np.ndarray:
    """Unit vectors to the contacts in the body frame, (t, n, 3)."""
    return np.einsum("tji,nj->tni", m.attitude, -np.asarray(rig.wheels.normal))


def integrate(rate: np.ndarray, step: float) -> np.ndarray:
    """Integral from 0 at the same points (trapezoids)."""
    mean = (rate[1:] + rate[:-1]) * (step / 2)
    return np.concatenate([np.zeros((1, rate.shape[1])), np.cumsum(mean, axis=0)])
