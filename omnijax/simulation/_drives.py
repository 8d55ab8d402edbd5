"""Drives: what the user imposes on the machine in time."""

from collections.abc import Sequence
from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float
from numpy.typing import ArrayLike

from .._arrays import on_device
from .._errors import InputError
from ..rig import Rig, typed_above_zero, typed_numbers
from ._signals import Signal, constant


class AbstractDrive(eqx.Module):
    """Motor torques or prescribed wheel speeds, and the force on the platform.

    `initial_angle` holds the wheels' angles at the start of the run (None: zero, where a gap
    begins at the contact).
    """

    force: eqx.AbstractVar[Signal]
    initial_angle: eqx.AbstractVar[Float[Array, " n"] | None]

    def since(self, start: float) -> Self:
        """The drive with times counted from `start` (s), as runs of studies count theirs."""

        def moved(part):
            return part.later(-start) if isinstance(part, Signal) else part

        return jax.tree.map(moved, self, is_leaf=lambda part: isinstance(part, Signal))


class TorqueDrive(AbstractDrive):
    """Motor torques in N m, one a wheel, and the force on the platform in N.

    `initial_velocity` is Omega at the start in rad/s, for a run that begins already rolling.
    """

    torque: Signal
    force: Signal
    initial_angle: Float[Array, " n"] | None = None
    initial_velocity: Float[Array, "3"] | None = None


class SpeedDrive(AbstractDrive):
    """Prescribed wheel speeds in rad/s, one a wheel, and the force on the platform in N."""

    speed: Signal
    force: Signal
    initial_angle: Float[Array, " n"] | None = None

    def angle(self, time, start) -> Float[Array, " n"]:
        """Wheel angles in rad at `time` of a run that starts at time `start`."""
        zero = 0.0 if self.initial_angle is None else self.initial_angle
        return zero + self.speed.integral(time) - self.speed.integral(start)


Numbers = Sequence[float | str] | ArrayLike  # text may hold units
Values = Signal | Numbers  # of a drive


def _signal(name: str, value: Values, unit: str) -> Signal:
    return value if isinstance(value, Signal) else constant(typed_numbers(name, value, unit))


def _force(value: Values) -> Signal:
    """A force on the platform (3,) in N."""
    if value is None:
        raise InputError("`force` must have 3 components, but is None.")
    signal = _signal("force", value, "N")
    if signal.size != 3:
        raise InputError(f"`force` must have 3 components, but has {signal.size}.")
    return signal


def torques(
    torque: Values,
    force: Values = (0.0, 0.0, 0.0),
    initial_angle: Numbers | None = None,
    initial_velocity: Numbers | None = None,
) -> TorqueDrive:
    """Drive by motor torques, one a wheel: numbers hold for the whole run, a `Signal` varies.

    Numbers are in N m, or have their unit: `torques("10 mNm, 0, 5 mNm")`, `torques(["10 mNm", 0,
    0.005])`.  `force` (3,) acts on the platform in N, `initial_angle` (n,) are the wheels' angles
    in rad and `initial_velocity` (3,) is Omega in rad/s at the start, and may have units too.
    Raises `InputError` for text that is no torque.
    """
    return TorqueDrive(
        torque=_signal("torque", torque, "N m"),
        force=_force(force),
        initial_angle=_array("initial_angle", initial_angle, "rad"),
        initial_velocity=_array("initial_velocity", initial_velocity, "rad/s"),
    )


def speeds(
    speed: Values,
    force: Values = (0.0, 0.0, 0.0),
    initial_angle: Numbers | None = None,
) -> SpeedDrive:
    """Drive by prescribed wheel speeds, one a wheel: numbers hold for the run, a `Signal` varies.

    Numbers are in rad/s, or have their unit: `speeds("30 rpm, 0, 10 rpm")`, `speeds(["30 rpm", 0,
    1.05])`.  `force` (3,) acts on the platform in N, and `initial_angle` (n,) are the wheels'
    angles in rad at the start, or have units too.  Raises `InputError` for text that is no speed.
    """
    return SpeedDrive(
        speed=_signal("speed", speed, "rad/s"),
        force=_force(force),
        initial_angle=_array("initial_angle", initial_angle, "rad"),
    )


def _array(name: str, value: Numbers | None, unit: str) -> Array | None:
    return None if value is None else jnp.asarray(typed_numbers(name, value, unit), float)


def drive_for(rig: Rig, given: Any) -> AbstractDrive:
    """A drive as it is; wheel speeds (rad/s, or text with units) as the drive by them.

    Raises `InputError` for what is neither, and for a drive that does not fit the rig.
    """
    drive = given
    if not isinstance(given, AbstractDrive):
        try:
            drive = speeds(given)
        except InputError:
            raise
        except (TypeError, ValueError):
            raise InputError(
                f"a drive is one of omnijax, or wheel speeds, but not {given!r}."
            ) from None
    check_drive(rig, drive)
    return drive


FASTEST = 1e6  # rad/s of a wheel: ten million rpm; more is a misread unit
LONGEST = 5_000_000  # samples; more is a misread unit
RATE = 500.0  # samples a second where none is given


def sample_times(length: float, rate: float | None = None) -> np.ndarray:
    """Samples from 0 to `length` s, 500 a second where no `rate` (Hz) is given.

    Every run that counts from 0 has these, in studies too: the last one is the multiple of 1/`rate`
    that is nearest to `length`.  Raises `InputError` for less than one step and for too many.
    """
    frequency = rate or RATE
    count = round(min(length * frequency, 1e18))
    if not 1 <= count <= LONGEST:
        raise InputError(
            f"`duration` times `rate` must give 1 to {LONGEST} samples, but gives {count:.15g}."
        )
    return np.arange(count + 1) / frequency


def as_times(given: Any, duration: Any = None, rate: Any = None) -> Float[Array, " t"]:
    """Sample times in s: an array as it is, or a duration (2.0, "2 s") at `rate` samples a second.

    The duration is `given` or named; `rate` (Hz, "1 kHz") is 500 where none is given.
    """
    if (given is None) == (duration is None):
        raise InputError(
            "a run takes either sample times `ts` or a `duration` (s, as in 2.0 or '2 s')."
        )
    times = duration if given is None else given
    if isinstance(times, Tracer) or (not isinstance(times, str) and np.ndim(times) > 0):
        if given is None:
            raise InputError("`duration` must be one number of seconds; sample times are `ts`.")
        if rate is not None:
            raise InputError("`rate` goes with a duration; `ts` are sample times already.")
        return _increasing(jnp.asarray(typed_numbers("ts", times, "s"), float))
    frequency = None if rate is None else typed_above_zero("rate", rate, "Hz")
    return on_device(sample_times(typed_above_zero("duration", times, "s"), frequency))


def _increasing(times: Float[Array, " t"]) -> Float[Array, " t"]:
    """Sample times as they are; `InputError` where there are none, or known ones decrease."""
    if times.ndim != 1 or not len(times):
        raise InputError(f"`ts` must be a row of sample times, but has shape {times.shape}.")
    if not isinstance(times, Tracer) and (bad := _first_wrong(np.asarray(times))) is not None:
        here = f"{times[bad]:g}"
        behind = f"{here} after {times[bad - 1]:g}" if bad else here
        raise InputError(f"`ts` must be finite and increase, but `ts[{bad}]` is {behind} s.")
    return times


def _first_wrong(times: np.ndarray) -> int | None:
    """Where the first time stands that is not finite, or below the one before it."""
    wrong = ~np.isfinite(times)
    wrong[1:] |= np.diff(times) < 0
    return int(np.argmax(wrong)) if wrong.any() else None


def check_vector(name: str, values: Any, size: int) -> None:
    """`InputError` where `values` are not (`size`,), or a known one of them is not finite."""
    if np.shape(values) != (size,):
        raise InputError(f"`{name}` must have {size} entries, but has shape {np.shape(values)}.")
    _check_finite(name, values)


def _check_finite(name: str, values: Any) -> None:
    if isinstance(values, Tracer):
        return
    known = np.asarray(values)
    if not np.isfinite(known).all():
        raise InputError(f"`{name}` must be finite, but is {known[~np.isfinite(known)][0]}.")


def _check_signal(name: str, signal: Signal) -> None:
    """`InputError` where known values are not finite, or change after the last knot for ever."""
    _check_finite(name, signal.around_knots())
    if isinstance(signal.slopes, Tracer):
        return
    last = np.asarray(signal.slopes)[-1]
    if np.any(last != 0):
        raise InputError(
            f"`{name}` must be held from its last knot on, but its last slopes are {last.tolist()}."
        )


def check_speed(name: str, values: Any) -> None:
    """`InputError` for known speeds that no wheel has."""
    known = np.zeros(1) if isinstance(values, Tracer) else np.asarray(values).ravel()
    most = known[np.argmax(np.abs(known))]
    if abs(most) > FASTEST:
        raise InputError(
            f"`{name}` must lie in [-{FASTEST:g}, {FASTEST:g}] rad/s, but is {most:g}."
        )


def check_drive(rig: Rig, drive: AbstractDrive) -> None:
    """`InputError` where the drive does not fit the rig, or a known number of it is not finite."""
    name = "torque" if isinstance(drive, TorqueDrive) else "speed"
    signal = getattr(drive, name)
    if signal.size != rig.size:
        count = f"{signal.size} wheel{'s' * (signal.size != 1)}"
        raise InputError(f"the drive has {count}, but the rig has {rig.size}.")
    _force(drive.force)
    _check_signal(name, signal)
    if name == "speed":
        check_speed(name, signal.around_knots())
    _check_signal("force", drive.force)
    if drive.initial_angle is not None:
        check_vector("initial_angle", drive.initial_angle, rig.size)
    if isinstance(drive, TorqueDrive) and drive.initial_velocity is not None:
        check_vector("initial_velocity", drive.initial_velocity, 3)
