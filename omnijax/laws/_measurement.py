"""The platform's floor, and sensors: gain, delay, lag, drift, crosstalk, limits, encoders."""

import math
from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._base import Parameter
from ._ports import AbstractPlatform, AbstractSensor


class FloorVibration(AbstractPlatform):
    """Platform acceleration += A sin(2 pi f t + phi) d, t from the run's first sample."""

    amplitude: Float[Array, ""]
    frequency: Float[Array, ""]
    phase: Float[Array, ""]
    direction: Float[Array, "3"]

    id: ClassVar[str] = "floor-vibration"
    words: ClassVar[str] = "a vibrating floor"
    places: ClassVar[tuple[str, ...]] = ("platform",)
    formula: ClassVar[str] = "platform acceleration += A sin(2πft + φ) d"
    parameters: ClassVar[dict[str, Parameter]] = {
        "amplitude": Parameter("m/s^2", linear=True),
        "frequency": Parameter("Hz", low=0),
        "phase": Parameter("rad"),
        "direction": Parameter("1", shape=3),
    }

    def __call__(self, signal, state=None):
        unit = self.direction / jnp.sqrt(self.direction @ self.direction)
        return self.amplitude * jnp.sin(2 * math.pi * self.frequency * signal + self.phase) * unit


class SensorGain(AbstractSensor):
    """y = (1 + g) y."""

    g: Float[Array, ""]

    id: ClassVar[str] = "sensor-gain"
    momentary: ClassVar[bool] = True
    words: ClassVar[str] = "a wrong gain of the sensor"
    places: ClassVar[tuple[str, ...]] = ("group",)
    formula: ClassVar[str] = "y = (1 + g) y"
    parameters: ClassVar[dict[str, Parameter]] = {"g": Parameter("1", linear=True)}

    def __call__(self, signal, state=None):
        return self.g * signal.values


class SensorDelay(AbstractSensor):
    """y(t) = y(t - d), the first sample before the start; cubic between samples."""

    delay: Float[Array, ""]

    id: ClassVar[str] = "sensor-delay"
    remembers: ClassVar[bool] = True
    words: ClassVar[str] = "a delay of the sensor"
    places: ClassVar[tuple[str, ...]] = ("group",)
    formula: ClassVar[str] = "y(t) = y(t − d), rest before the start"
    parameters: ClassVar[dict[str, Parameter]] = {"delay": Parameter("s", low=0)}

    def __call__(self, signal, state=None):
        return delayed(signal.time, signal.values, self.delay) - signal.values


class SensorDrift(AbstractSensor):
    """y += a + b t."""

    a: Float[Array, ""]
    b: Float[Array, ""]

    id: ClassVar[str] = "sensor-drift"
    words: ClassVar[str] = "an offset or drift of the sensor"
    places: ClassVar[tuple[str, ...]] = ("channel",)
    formula: ClassVar[str] = "y += a + b t"
    parameters: ClassVar[dict[str, Parameter]] = {
        "a": Parameter("unit of the channel", linear=True),
        "b": Parameter("unit of the channel/s", linear=True),
    }

    def __call__(self, signal, state=None):
        line = self.a + self.b * signal.time
        return jnp.broadcast_to(line[:, None], signal.values.shape)


class SensorCrosstalk(AbstractSensor):
    """Measured dR_a += X_ab dR_b."""

    X_xy: Float[Array, ""] = 0.0  # pyright: ignore[reportAssignmentType]
    X_xz: Float[Array, ""] = 0.0  # pyright: ignore[reportAssignmentType]
    X_yx: Float[Array, ""] = 0.0  # pyright: ignore[reportAssignmentType]
    X_yz: Float[Array, ""] = 0.0  # pyright: ignore[reportAssignmentType]
    X_zx: Float[Array, ""] = 0.0  # pyright: ignore[reportAssignmentType]
    X_zy: Float[Array, ""] = 0.0  # pyright: ignore[reportAssignmentType]

    id: ClassVar[str] = "sensor-crosstalk"
    momentary: ClassVar[bool] = True
    words: ClassVar[str] = "crosstalk between the sensor's axes"
    places: ClassVar[tuple[str, ...]] = ("dR",)
    formula: ClassVar[str] = "measured dR_a += X_ab dR_b"
    parameters: ClassVar[dict[str, Parameter]] = {
        name: Parameter("1", linear=True, optional=True)
        for name in ("X_xy", "X_xz", "X_yx", "X_yz", "X_zx", "X_zy")
    }

    def __call__(self, signal, state=None):
        zero = jnp.zeros(())
        matrix = jnp.stack(
            [
                jnp.stack([zero, jnp.asarray(self.X_xy), jnp.asarray(self.X_xz)]),
                jnp.stack([jnp.asarray(self.X_yx), zero, jnp.asarray(self.X_yz)]),
                jnp.stack([jnp.asarray(self.X_zx), jnp.asarray(self.X_zy), zero]),
            ]
        )
        return signal.values @ matrix.T


class SensorLag(AbstractSensor):
    """dy/dt = (x - y)/tau: a first-order low pass, at rest before the start."""

    tau: Float[Array, ""]

    id: ClassVar[str] = "sensor-lag"
    remembers: ClassVar[bool] = True
    words: ClassVar[str] = "a slow sensor"
    places: ClassVar[tuple[str, ...]] = ("group",)
    formula: ClassVar[str] = "ẏ = (x − y)/τ, rest before the start"
    parameters: ClassVar[dict[str, Parameter]] = {"tau": Parameter("s", low=0, above=True)}

    def __call__(self, signal, state=None):
        return low_passed(signal.time, signal.values, self.tau) - signal.values


class SensorSaturation(AbstractSensor):
    """y limited to [-L, L]."""

    limit: Float[Array, ""]

    id: ClassVar[str] = "sensor-saturation"
    momentary: ClassVar[bool] = True
    words: ClassVar[str] = "a sensor at its limit"
    places: ClassVar[tuple[str, ...]] = ("group", "channel")
    formula: ClassVar[str] = "y limited to ±L"
    parameters: ClassVar[dict[str, Parameter]] = {"limit": Parameter("unit of the channel", low=0)}

    def __call__(self, signal, state=None):
        return jnp.clip(signal.values, -self.limit, self.limit) - signal.values


class SensorRectified(AbstractSensor):
    """y = |y|."""

    id: ClassVar[str] = "sensor-rectified"
    momentary: ClassVar[bool] = True
    words: ClassVar[str] = "a sensor that loses the sign"
    places: ClassVar[tuple[str, ...]] = ("channel",)
    formula: ClassVar[str] = "y = |y|"
    parameters: ClassVar[dict[str, Parameter]] = {}

    def __call__(self, signal, state=None):
        return jnp.abs(signal.values) - signal.values


class EncoderEccentricity(AbstractSensor):
    """Measured theta += A (sin(theta + phi) - sin(theta_0 + phi)), theta_0 the first sample."""

    amplitude: Float[Array, ""]
    phase: Float[Array, ""]

    id: ClassVar[str] = "encoder-eccentricity"
    words: ClassVar[str] = "an encoder off its centre"
    places: ClassVar[tuple[str, ...]] = ("encoder",)
    formula: ClassVar[str] = "measured θ += A sin(θ + φ), zero at the first sample"
    parameters: ClassVar[dict[str, Parameter]] = {
        "amplitude": Parameter("rad", linear=True),
        "phase": Parameter("rad"),
    }

    def __call__(self, signal, state=None):
        wave = self.amplitude * jnp.sin(signal.values + self.phase)
        return wave - wave[:1]


def delayed(time: Float[Array, " t"], values: Float[Array, "t c"], delay) -> Float[Array, "t c"]:
    """`values` at `time - delay`: cubic between samples, the first sample before them.

    Its slope at a sample is that of the parabola through the sample and its neighbours, at the last
    one through the last three: Catmull-Rom where the steps are even.  Of two samples at one time
    neither feels the other.
    """
    at, last = time - delay, len(time) - 2
    i = jnp.clip(jnp.searchsorted(time, at, side="right") - 1, 0, last)
    steps = jnp.diff(time)
    slopes = jnp.diff(values, axis=0) / jnp.where(steps > 0, steps, 1.0)[:, None]

    def piece(k):
        k = jnp.clip(k, 0, last)
        return steps[k][:, None], slopes[k]

    (h0, d0), (h1, d1), (h2, d2) = piece(i - 1), piece(i), piece(i + 1)
    d0 = jnp.where((i == 0)[:, None], 0.0, d0)
    before = jnp.where(h0 > 0, h0 + h1, 1.0)
    tangent = jnp.where(h0 > 0, (h1 * d0 + h0 * d1) / before, d1)
    ahead = jnp.where(h2 > 0, (h2 * d1 + h1 * d2) / jnp.where(h2 > 0, h1 + h2, 1.0), d1)
    end = jnp.where(h0 > 0, d1 + h1 * (d1 - d0) / before, d1)
    ahead = jnp.where((i == last)[:, None], end, ahead)
    since = jnp.clip(at - time[i], 0.0, steps[i])[:, None]
    u = since / jnp.where(h1 > 0, h1, 1.0)
    cubic = u * (3 - 2 * u) * d1 + (1 - u) ** 2 * tangent - u * (1 - u) * ahead
    return values[i] + since * cubic


def low_passed(time: Float[Array, " t"], values: Float[Array, "t c"], tau) -> Float[Array, "t c"]:
    """`values` behind a first-order low pass: exact where they are linear between samples."""
    step = jnp.diff(time)[:, None] / tau
    share = jnp.where(step > 0, -jnp.expm1(-step) / jnp.where(step > 0, step, 1.0), 1.0)
    kept = jnp.exp(-step)
    # y' = kept y + (share - kept) x + (1 - share) x', x and x' the samples before and after
    gained = (share - kept) * values[:-1] + (1 - share) * values[1:]

    def after(y, now):
        y = now[0] * y + now[1]
        return y, y

    _, out = jax.lax.scan(after, values[0], (kept, gained))
    return jnp.concatenate([values[:1], out])
