"""What the wheel angles say of the motion: rolled lengths, speeds, attitude, on fine grids."""

import dataclasses
import functools
from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline

from ...._white_noise import noise_squares
from ....rig import Rig
from ..._settings import SETTINGS
from .._laws import (
    along,
    begin_of,
    changed_beside_delays,
    folds,
    outputs_on_time,
    radii,
    reading_of,
    values_behind,
)
from ..runs import FINE, SHAPE, Run
from .dual_rows import driven_axes
from .smooth import smooth_by_likelihood
from .wheels import WheelTables

WIDER_ANGLES = SETTINGS.prediction.wider_angles


@dataclasses.dataclass(frozen=True)
class RunMotion:
    """Motion of one run at `FINE` points a sample, from smoothed wheel angles.

    `length` is the measured rolled length S(theta) at the samples, without what sensors add,
    `theta` the angle at `SHAPE` points a sample.
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
    turning: np.ndarray  # (.., 3) rad/s, Omega from the wheels; about a free axis as measured
    step: float  # s, of the FINE points
    rolls: bool  # already at the first sample
    # (samples or 1, n) by how much the encoders' readings change with the angle
    slope: np.ndarray

    @functools.cached_property
    def missed_rate(self) -> np.ndarray:
        """What integrals of the shape's rates at the FINE points, (.., n) m/s, lack.

        Trapezoids put a rate that jumps between two points, as at the edge of a gap, up to half a
        step off.  Added to the points these make its integral and the first moment of it exact.
        """
        parts, rate = SHAPE // FINE, self.shape_rate
        middle = (self.rho[1:] + self.rho[:-1]) / (2 * parts)
        mean = np.add.reduceat(middle, np.arange(0, len(middle), parts))  # of each step
        out = np.zeros_like(rate)
        out[1:-1] = np.diff(mean, axis=0) / self.step
        out[1:-1] -= (rate[:-2] + 4 * rate[1:-1] + rate[2:]) / 6
        return out

    @functools.cached_property
    def attitude(self) -> np.ndarray:
        """Rotation matrices body -> inertial, (.., 3, 3)."""
        return attitude(self.turning, self.step)


def measured_lengths(
    rig: Rig, tables: WheelTables, run: Run, rolls: bool, about: np.ndarray,
    smoother: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:  # fmt: skip
    """S(theta) (samples, n) at the samples, without what the sensors add; NaN where not measured.

    `about` are lengths near them, or zero where none are known; `smoother` smooths such lengths.
    """
    angle = outputs_on_time(rig, run, "theta", rig.size)
    if changed_beside_delays(rig, "theta"):

        def smoothed(angle: np.ndarray) -> np.ndarray:
            return tables.unrolled(smoother(_lengths(rig, tables, run, angle, rolls)))

        start = _about(rig, tables, run, about, angle, rolls) if about.any() else smoothed(angle)
        angle = values_behind(rig, "theta", run, angle, start, rolls, smoothed)
    return _lengths(rig, tables, run, angle, rolls)


def _about(rig: Rig, tables: WheelTables, run: Run, about, angle, rolls: bool) -> np.ndarray:
    """The angles (samples, n) of the lengths `about`, begun where the measured ones say."""
    if folds(rig, "theta"):
        course = tables.unrolled(about)
        begin = tables.rolled(begin_of(rig, "theta", run, angle, course, rolls)[None])
        return tables.unrolled(about + begin)
    apart = tables.rolled(angle) - about
    first = np.argmax(np.isfinite(apart), axis=0)
    return tables.unrolled(about + np.nan_to_num(apart[first, np.arange(len(first))]))


def _lengths(rig: Rig, tables: WheelTables, run: Run, angle, rolls: bool) -> np.ndarray:
    """S (samples, n) of measured angles; a wheel without encoder gets the integral of Omega."""
    length = tables.rolled(angle)
    missing = np.isnan(length).all(axis=0)
    if missing.any():
        rate = _turning(rig, run, rolls) @ np.asarray(rig.wheels.spin_axis).T
        start = np.zeros(rig.size) if run.start is None else run.start
        length[:, missing] = (integrate(rate, run.step) + tables.rolled(start[None]))[:, missing]
    return length


def _turning(rig: Rig, run: Run, rolls: bool) -> np.ndarray:
    """Omega (samples, 3), smoothed, without what its sensors add."""
    turning = outputs_on_time(rig, run, "Omega", 3)

    def smoothed(values: np.ndarray) -> np.ndarray:
        return smooth_by_likelihood(values, _scatter(values))

    if changed_beside_delays(rig, "Omega"):
        start = smoothed(turning)
        turning = values_behind(rig, "Omega", run, turning, start, rolls, smoothed)
    return smoothed(turning)


def leaves_an_axis_free(rig: Rig) -> bool:
    """Whether the sphere may turn about an axis that no wheel drives."""
    return bool(np.linalg.matrix_rank(np.asarray(rig.wheels.spin_axis)) < 3)


def groups_of_motion(rig: Rig, runs: list[Run]) -> tuple[str, ...]:
    """Output groups that tell the motions: Omega where an axis is free or an encoder is missing."""
    if leaves_an_axis_free(rig) or any(run.lacks_an_encoder for run in runs):
        return ("theta", "Omega")
    return ("theta",)


def _scatter(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(noise_squares(values, 3)))) or 1e-12


def motion(
    rig, tables: WheelTables, run: Run, length, smoothed: np.ndarray, rolls: bool,
    shares: np.ndarray | None,
) -> RunMotion:  # fmt: skip
    """Everything the elastic and the rotation model need, from smoothed rolled lengths.

    `shares` are those of `dual_rows`; None leaves it to the angles alone which row touches.
    """
    radius = float(rig.sphere.radius)
    spline = CubicSpline(run.time, smoothed)
    theta_shape = tables.unrolled(spline(run.fine(SHAPE)))
    theta = theta_shape[:: SHAPE // FINE]
    rate = spline.derivative()(run.fine(FINE))
    rho = tables.rho(theta_shape)
    shape = rho[:: SHAPE // FINE]
    speed = rate * radius / (radii(rig) + shape)
    factor = np.ones_like(speed)
    for placed in rig.at("kinematics"):
        for i in placed.wheels:
            factor[:, i] += along(placed.law, np.ascontiguousarray(speed[:, i]), run)
    axes = driven_axes(rig, theta, shares)
    rim = factor * rate
    inverse = np.linalg.pinv(axes)
    turning = np.einsum("tij,tj->ti", inverse, rim)
    if leaves_an_axis_free(rig) and "Omega" in run.outputs:
        free = np.eye(3) - inverse @ axes
        measured = CubicSpline(run.time, _turning(rig, run, rolls))(run.fine(FINE))
        turning = turning + np.einsum("tij,tj->ti", free, measured)
    length, slope = _as_read(rig, run, length, smoothed, theta[::FINE], shape[::FINE], rolls)
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
        rolls=rolls,
        slope=slope,
    )


def _as_read(
    rig: Rig, run: Run, length, smoothed, theta, shape, rolls: bool
) -> tuple[np.ndarray, np.ndarray]:
    """The rolled lengths (samples, n): smoothed, and the scatter that the encoders show about them.

    And the slope (samples or 1, n) of the readings by the angle.  What they read late tells of the
    moment at which it is read: none is lost at the run's end.  One that stands at its limit tells
    by how much that is not the limit of its law.
    """
    measured = run.outputs.get("theta")
    if measured is None or not any(p.group == "theta" for p in rig.at("sensor")):
        return length, np.ones((1, rig.size))
    reading = reading_of(rig, "theta", run, theta, rolls, late=True)
    apart = measured - reading.shown
    scatter = np.where(reading.tells, reading.back(apart), apart)
    lever = (radii(rig) + shape) / float(rig.sphere.radius)
    seen = np.isfinite(measured).any(axis=0)
    length = np.where(seen, smoothed + lever * scatter, length)
    return length, np.where(seen & reading.tells, np.abs(reading.slope), 1.0)


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


def angles_of(rig: Rig, runs: list[Run]) -> tuple[float, float]:
    """The lowest and the highest angle of any wheel in the runs, rad, as measured.

    Of a wheel without encoder by the integral of Omega, and so much more as parts may be off.
    """
    ratio = float(rig.sphere.radius) / radii(rig)
    ends = [0.0]
    for run in runs:
        missing = np.full(rig.size, True)
        if "theta" in run.outputs:
            angle = run.outputs["theta"]
            missing = np.isnan(angle).all(axis=0)
            ends += [f(angle[:, ~missing]) for f in (np.nanmin, np.nanmax) if not missing.all()]
        if missing.any() and "Omega" in run.outputs:
            turning = np.nan_to_num(run.outputs["Omega"]) @ np.asarray(rig.wheels.spin_axis).T
            angle = WIDER_ANGLES * (integrate(turning, run.step) * ratio)[:, missing]
            ends += [angle.min(), angle.max()]
    return float(min(ends)), float(max(ends))


def rolling_radius(rig: Rig, m: RunMotion) -> np.ndarray:
    """Radius (FINE points, n) m at which every wheel rolls: with its shape and its creep.

    `dynamics.rolling_radius` of a whole motion, whose creep factors were evaluated once.
    """
    return m.factor * (radii(rig) + m.shape)


def contact_directions(rig: Rig, m: RunMotion) -> np.ndarray:
    """Unit vectors to the contacts in the body frame, (t, n, 3)."""
    return np.einsum("tji,nj->tni", m.attitude, -np.asarray(rig.wheels.normal))


def integrate(rate: np.ndarray, step: float) -> np.ndarray:
    """Integral from 0 at the same points (trapezoids)."""
    mean = (rate[1:] + rate[:-1]) * (step / 2)
    return np.concatenate([np.zeros((1, rate.shape[1])), np.cumsum(mean, axis=0)])
