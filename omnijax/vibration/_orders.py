"""Order analysis of simulated and measured runs: a map over a wheel's orders, and order tracks.

Order o of a wheel is what repeats o times a turn.  With the wheel's angle theta at every sample

    X(o) = 2 sum w x exp(-i o theta) dtheta / sum w dtheta,   w a window over some turns,

is the transform in the angle domain: the peak amplitude of a sine at its order, from the samples
themselves, so nothing is interpolated.
Where o times the speed passes half the sampling rate a line folds back; such cells are marked.
"""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from .._batch import check_single
from .._errors import InputError
from ..recording import Recording, unit_of
from ..rig import typed_above_zero, typed_numbers
from ..simulation import Trajectory
from ._order_results import OrderMap, OrderTrack

OVERLAP = 4  # windows begin a quarter of their length apart
USABLE = 0.9  # share of a window's samples that must be there
TURN = 2 * np.pi
KINDS = ("peak", "rms", "power")
RANGE = (0.01, 1e4)  # of turns and orders


def rpm_order_map(
    run: Trajectory | Recording,
    channel: str = "dR_x",
    reference: str | int = "1",
    *,
    turns: float = 4.0,
    max_order: float | None = None,
    amplitude: str = "peak",
    window: str = "hann",
) -> OrderMap:
    """Map of a channel over orders and time, as MATLAB's `rpmordermap` draws it.

    `channel` is a column such as `dR_y`, or `distance` for |dR|; `reference` a wheel's name or
    number (from 1), or `sphere`.  Windows are `turns` long (resolution about 2/turns orders), or
    half the way that the reference turns if that is less.  Without `max_order`: 64, or what the
    sampling can tell.  `amplitude` of the sine at an order: its `peak`, `rms` or `power` (mean
    square).  `window` is `hann`, or `flattop`: truer heights between two orders, wider lines.

    Amplitudes (windows, orders) in the channel's unit.  Raises `InputError` for an unknown
    channel or reference, and for a run of less than a turn.

    Source: the Fourier integral in the angle domain (Fyfe and Munck, Mech. Syst. Signal
    Process. 11, 1997, resample for it).
    """
    _check(amplitude=(amplitude, KINDS), window=(window, tuple(WINDOWS)))
    turns = _within("turns", turns)
    max_order = None if max_order is None else _within("max_order", max_order)
    time, values, unit = _channel(run, channel)
    angle, name = _reference(run, reference)
    windows, turns = _windows(time, angle, turns, name)
    steps, speeds = _steps(time, windows), np.array([_speed(time[w], angle[w]) for w in windows])
    top = np.pi / steps / np.maximum(speeds, 1e-12)  # order at half the sampling rate
    highest = min(64.0, float(top.max())) if max_order is None else max_order
    orders = np.arange(0.0, highest + 1e-9, 0.25 / turns)
    peaks = np.stack([_spectrum(values[w], angle[w], orders, WINDOWS[window]) for w in windows])
    aliased = orders > top[:, None]
    middle = np.array([time[w].mean() for w in windows])
    shown = np.where(aliased, np.nan, _as(amplitude, peaks))
    rpm = speeds * 60 / TURN
    about = (channel, _unit(amplitude, unit), name)
    return OrderMap(*about, orders, middle, rpm, shown, aliased, amplitude)


def order_track(
    run: Trajectory | Recording,
    orders: Sequence[float | str] | str,
    channel: str = "dR_x",
    reference: str | int = "1",
    *,
    turns: float = 4.0,
    amplitude: str = "peak",
) -> OrderTrack:
    """Amplitude and phase of `orders` over time, as MATLAB's `ordertrack` gives them.

    All orders, the mean and a drift are fitted together in each window, so neighbours do not leak
    into each other.  The fit uses the wheel's angle at the samples: while the speed changes it
    finds an order beyond half the sampling rate too.  `amplitude` as in `rpm_order_map`.

    Amplitudes (windows, orders) in the channel's unit, phases in rad.  Raises `InputError` for an
    unknown channel or reference, and for less than a turn.

    Source: least squares on all orders of a window together, in the angle domain.
    """
    _check(amplitude=(amplitude, KINDS))
    turns = _within("turns", turns)
    chosen = np.asarray(typed_numbers("orders", orders, "1"), float)
    if chosen.ndim != 1 or not len(chosen) or not np.all((chosen > 0) & np.isfinite(chosen)):
        raise InputError(f"`orders` must be positive numbers, but is {orders!r}.")
    time, values, unit = _channel(run, channel)
    angle, name = _reference(run, reference)
    windows, _ = _windows(time, angle, turns, name)
    steps, speeds = _steps(time, windows), np.array([_speed(time[w], angle[w]) for w in windows])
    fitted = np.stack([_fit(time[w], values[w], angle[w], chosen) for w in windows])
    aliased = chosen > (np.pi / steps / np.maximum(speeds, 1e-12))[:, None]
    middle = np.array([time[w].mean() for w in windows])
    rpm = speeds * 60 / TURN
    size, phase = _as(amplitude, np.abs(fitted)), np.angle(fitted)
    about = (channel, _unit(amplitude, unit), name)
    return OrderTrack(*about, chosen, middle, rpm, size, phase, aliased, amplitude)


def roller_orders(
    run: Trajectory | Recording, rollers: Sequence[float], reference: str | int = "1"
) -> dict[str, float]:
    """Order of the reference at which each wheel's rollers pass, by the wheel's number from 1.

    `rollers` counts each wheel's.  A wheel is left out whose angle was not measured, that does not
    turn, or not in a constant ratio to the reference: its rollers then pass at no order.
    """
    angle, _ = _reference(run, reference)
    way = angle - angle[0]
    orders = {}
    for i, count in enumerate(rollers):
        try:
            turned = _reference(run, i + 1)[0]
        except InputError:  # this wheel's angle was not measured
            continue
        turned = turned - turned[0]
        ratio = float(way @ turned / (way @ way))
        if abs(ratio) > 1e-6 and np.ptp(turned - ratio * way) < 0.05 * np.ptp(turned):
            orders[str(i + 1)] = abs(ratio) * float(count)
    return orders


def _check(**options: tuple[str, tuple[str, ...]]) -> None:
    for name, (value, known) in options.items():
        if value not in known:
            raise InputError(f"`{name}` must be one of {', '.join(known)}, but is {value!r}.")


def _within(name: str, given: float | str) -> float:
    """A number of turns or an order in `RANGE`."""
    value = typed_above_zero(name, given, "1")
    if not RANGE[0] <= value <= RANGE[1]:
        raise InputError(f"`{name}` must lie in [{RANGE[0]:g}, {RANGE[1]:g}], but is {value:g}.")
    return value


def _as(kind: str, peak: np.ndarray) -> np.ndarray:
    """The peak of a sine as its peak, its rms or its mean square."""
    return {"peak": peak, "rms": peak / np.sqrt(2), "power": peak**2 / 2}[kind]


def _unit(kind: str, unit: str) -> str:
    return f"({unit})^2" if kind == "power" else unit


def _channel(run: Trajectory | Recording, name: str) -> tuple[np.ndarray, np.ndarray, str]:
    """Time, values and unit of one channel; `InputError` names what there is."""
    if isinstance(run, Recording):
        if name == "distance":
            return run.time, np.linalg.norm(run.group("dR"), axis=1), "m"
        if name not in run.channels:
            known = ", ".join(run.channels)
            raise InputError(f"`channel` must be distance or one of {known}, but is {name!r}.")
        return run.time, np.asarray(run.channels[name]), unit_of(name)
    check_single(run.status.shape)
    values = np.zeros(0)
    if name not in run.UNITS:
        with suppress(KeyError):
            values = np.asarray(run[name])
    if values.shape != run.t.shape:
        raise InputError(f"`channel` must be such as dR_x or normal_force_1, but is {name!r}.")
    return np.asarray(run.t), values, run.unit(name)


def _reference(run: Trajectory | Recording, reference: str | int) -> tuple[np.ndarray, str]:
    """Angle of the reference at every sample, rad, and its name; gaps are bridged."""
    name = str(reference)
    measured = isinstance(run, Recording)
    if not measured:
        check_single(run.status.shape)
    time = run.time if measured else np.asarray(run.t)
    if name == "sphere":
        omega = run.group("Omega") if measured else np.asarray(run.Omega)
        speed = np.linalg.norm(omega, axis=1)
        good = np.isfinite(speed)
        if not good.any():
            raise InputError("`reference` cannot be the sphere: Omega was not measured.")
        speed = np.interp(time, time[good], speed[good])
        return np.concatenate(
            [[0.0], np.cumsum(0.5 * np.diff(time) * (speed[1:] + speed[:-1]))]
        ), "the sphere"
    names = () if measured else run.names
    theta = run.group("theta") if measured else np.asarray(run.theta)
    numbers = [str(i + 1) for i in range(theta.shape[1])]
    if name not in (*names, *numbers):
        known = ", ".join([*names, *numbers, "sphere"])
        raise InputError(f"`reference` must be one of {known}, but is {name!r}.")
    index = (numbers if name in numbers else names).index(name)  # as `run["theta_1"]` takes them
    good = np.isfinite(theta[:, index])
    if not good.any():
        raise InputError(f"`reference` cannot be wheel {name}: its angle was not measured.")
    return np.interp(time, time[good], theta[good, index]), f"wheel {name}"


def _windows(time, angle, turns: float, name: str) -> tuple[list[slice], float]:
    """Stretches of `turns` turns in one direction, and their length in turns."""
    smooth = max(int(0.02 * len(time)), 5)
    speed = np.convolve(np.gradient(angle, time), np.ones(smooth) / smooth, mode="same")
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(angle)))]) / TURN
    if way[-1] < 1:
        raise InputError(f"{name} turns {way[-1]:.2g} times in this run; orders need a whole turn.")
    length = min(turns, max(way[-1] / 2, 1.0))
    windows = []
    for start in np.arange(0.0, way[-1] - length + 1e-9, length / OVERLAP):
        first, last = np.searchsorted(way, [start, start + length])
        here = slice(int(first), int(min(last + 1, len(way))))
        one_way = np.all(speed[here] > 0) or np.all(speed[here] < 0)
        if one_way and here.stop - here.start >= 16:
            windows.append(here)
    if not windows:
        raise InputError(f"{name} never turns {length:.2g} times in one direction.")
    return windows, length


def _steps(time: np.ndarray, windows: Sequence[slice]) -> np.ndarray:
    """Step of the samples in each window, s: the rate of a run may change."""
    return np.array([np.median(np.diff(time[w])) for w in windows])


def _speed(time: np.ndarray, angle: np.ndarray) -> float:
    """Mean speed in rad/s, without sign."""
    return float(abs(angle[-1] - angle[0]) / (time[-1] - time[0]))


def _hann(angle: np.ndarray) -> np.ndarray:
    """Hann window over the angle."""
    return np.sin(np.pi * (angle - angle[0]) / (angle[-1] - angle[0])) ** 2


def _flat_top(angle: np.ndarray) -> np.ndarray:
    """Flat-top window over the angle, with MATLAB's coefficients."""
    turn = TURN * (angle - angle[0]) / (angle[-1] - angle[0])
    a = (0.21557895, -0.41663158, 0.277263158, -0.083578947, 0.006947368)
    return np.sum([a[k] * np.cos(k * turn) for k in range(5)], axis=0)


WINDOWS = {"hann": _hann, "flattop": _flat_top}


def _spectrum(values, angle, orders, window) -> np.ndarray:
    """Amplitude at each order; NaN where too much of the window is missing."""
    good = np.isfinite(values)
    if good.mean() < USABLE:
        return np.full(len(orders), np.nan)
    weight = window(angle) * np.abs(np.gradient(angle)) * good
    values = np.where(good, values, 0.0)
    trend = np.stack([np.ones(len(angle)), angle - angle.mean()], axis=1)
    root = np.sqrt(np.abs(weight))[:, None]
    line, *_ = np.linalg.lstsq(root * trend, root[:, 0] * values, rcond=None)
    values = np.where(good, values - trend @ line, 0.0)
    return 2 * np.abs(np.exp(-1j * np.outer(orders, angle)) @ (weight * values)) / weight.sum()


def _fit(time, values, angle, orders) -> np.ndarray:
    """Complex amplitudes of the orders, fitted together with a mean and a drift."""
    good = np.isfinite(values)
    unknowns = 2 * len(orders) + 2
    if good.mean() < USABLE or good.sum() < 2 * unknowns:
        return np.full(len(orders), np.nan + 0j)
    phase = np.outer(angle[good], orders)
    drift = np.stack([np.ones(good.sum()), time[good] - time.mean()], axis=1)
    columns = np.concatenate([np.cos(phase), -np.sin(phase), drift], axis=1)
    root = np.sqrt(_hann(angle)[good])
    amplitudes, *_ = np.linalg.lstsq(root[:, None] * columns, root * values[good], rcond=None)
    return amplitudes[: len(orders)] + 1j * amplitudes[len(orders) : 2 * len(orders)]
