"""Hidden effects drawn at random: place, sign, order, phase, roller, delay, width; size comes last.

An effect of size x changes numbers of the plant (`physics`), of the machine it stands in
(`machine`, where the law itself has no free size), the commands or the readings.
"""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from .. import plant
from .machines import FINE, Machine
from .sensors import columns_of, lagged, shifted, smoothly_lagged

ROTATION = {
    "bearing-coulomb", "bearing-viscous", "motor-ripple", "motor-gain", "rolling-resistance",
    "spin-resistance", "air-drag", "unbalance", "creep", "torque-offset", "actuator-delay",
    "actuator-lag", "actuator-saturation", "cogging", "current-ripple", "stribeck", "load-friction",
    "friction-asymmetry", "square-drag", "wheel-radius",
}  # fmt: skip
Change = tuple[str, Any, Any]  # name in the plant, where in its array, value


def _nothing(x: float) -> list[Change]:
    return []


@dataclasses.dataclass(frozen=True)
class Hidden:
    """One effect: what it changes at size x, its true parameters there, sizes to choose from."""

    id: str
    place: str
    truth: Callable[[float], dict[str, Any]]
    nominal: float
    most: float = np.inf
    least: float = 0.0
    physics: Callable[[float], list[Change]] = _nothing
    machine: Callable[[float], dict[str, float]] | None = None  # factors of stated numbers
    command: Callable[[np.ndarray, float], np.ndarray] | None = None
    sensor: Callable[[np.ndarray, float, int], np.ndarray] | None = None  # and the first row read
    limit: Callable[[np.ndarray, float, np.ndarray], np.ndarray] | None = None  # and tops of runs
    start: tuple[int, int] | None = None  # wheel and gap over which the runs begin

    @property
    def seen(self) -> tuple[str, ...]:
        """Output groups in which it shows first: a motion that differs shifts every roller."""
        if self.sensor is not None or self.limit is not None:
            return ("dR", "a", "theta", "Omega")
        return ("Omega", "theta") if self.id in ROTATION else ("dR", "a")


def _log(rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _wheel(rng, m: Machine) -> tuple[int, str]:
    i = int(rng.integers(m.wheels))
    return i, f"w{i + 1}"


def _where(rng, m: Machine) -> tuple[Any, str]:
    """One wheel, or all."""
    return (slice(None), "all") if rng.random() < 0.5 else _wheel(rng, m)


def _sign(rng) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _strength(id: str, key: str, name: str, nominal: float, signed: bool, most=np.inf, one=False):
    """A law of one strength at a wheel (`one`), or at a wheel or all."""

    def draw(rng, m):
        at, place = _wheel(rng, m) if one else _where(rng, m)
        s = _sign(rng) if signed else 1.0
        return Hidden(id, place, lambda x: {key: s * x}, nominal, most,
                      physics=lambda x: [(name, at, s * x)])  # fmt: skip

    return draw


def _global(id: str, key: str, name: str, nominal: float, place: str):
    def draw(rng, m):
        return Hidden(id, place, lambda x: {key: x}, nominal,
                      physics=lambda x: [(name, ..., x)])  # fmt: skip

    return draw


def _runout(rng, m):
    (i, place), phase = _wheel(rng, m), rng.uniform(-np.pi, np.pi)
    return Hidden("wheel-runout", place, lambda x: {"amplitude": x, "phase": phase}, 3e-5, 1e-3,
                  physics=lambda x: [("runout", i, x), ("runout_phase", i, phase)])  # fmt: skip


def _roller(rng, m):
    (i, place), s = _wheel(rng, m), _sign(rng)
    j = int(rng.integers(m.stated["n"]))
    return Hidden("damaged-roller", place, lambda x: {"roller": j, "severity": s * x}, 0.3,
                  1.5 if s > 0 else 0.9, start=(i, j),
                  physics=lambda x: [("roller", i, j), ("severity", i, s * x)])  # fmt: skip


def _round(rng, m):
    axis, s = rng.normal(size=3), _sign(rng)
    axis /= np.linalg.norm(axis)
    return Hidden(
        "sphere-out-of-round", "sphere", lambda x: {"amplitude": s * x, "axis": axis}, 2e-5,
        physics=lambda x: [("round", ..., s * x), ("round_axis", ..., axis)],
    )  # fmt: skip


def _preload(id: str, name: str):
    """A law without a size of its own: the lighter the preload, the more it shows."""

    def draw(rng, m):
        at, place = _where(rng, m)
        return Hidden(id, place, lambda x: {}, 1.0, 60.0, physics=lambda x: [(name, at, 1.0)],
                      machine=lambda x: {"N0": 1 / x})  # fmt: skip

    return draw


def _relaxation(rng, m):
    (at, place), tau = _where(rng, m), _log(rng, 3e-3, 0.1)
    return Hidden("contact-relaxation", place, lambda x: {"K1": x, "tau": tau}, 2e4,
                  physics=lambda x: [("K1", at, x), ("tau", at, tau)])  # fmt: skip


def _order(rng) -> float:
    return float(rng.integers(1, 25)) if rng.random() < 0.5 else rng.uniform(1.0, 60.0)


def _line(id: str, size: str, name: str, nominal: float):
    """A line in the angle: the torque's, or the current's."""

    def draw(rng, m):
        (i, place), order, phase = _wheel(rng, m), _order(rng), rng.uniform(-np.pi, np.pi)
        return Hidden(
            id, place, lambda x: {size: x, "order": order, "phase": phase}, nominal,
            physics=lambda x: [(name, i, x), (f"{name}_order", i, order),
                               (f"{name}_phase", i, phase)],
        )  # fmt: skip

    return draw


def _cogging(rng, m):
    (i, place), phases = _wheel(rng, m), rng.uniform(-np.pi, np.pi, 2)
    orders = np.array([_order(rng), _order(rng)])
    shares = np.array([1.0, rng.uniform(0.4, 1.0)])
    return Hidden(
        "cogging", place, lambda x: {"amplitudes": x * shares, "orders": orders, "phases": phases},
        0.01, physics=lambda x: [("cog", i, x * shares), ("cog_order", i, orders),
                                 ("cog_phase", i, phases)],
    )  # fmt: skip


def _unbalance(rng, m):
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    return Hidden("unbalance", "sphere", lambda x: {"offset": x * way}, 2e-4,
                  physics=lambda x: [("offset", ..., x * way)])  # fmt: skip


def _floor(rng, m):
    f, phase, way = _log(rng, 1.0, 60.0), rng.uniform(-np.pi, np.pi), rng.normal(size=3)
    way /= np.linalg.norm(way)
    return Hidden(
        "floor-vibration", "platform",
        lambda x: {"amplitude": x, "frequency": f, "phase": phase, "direction": way}, 0.05,
        physics=lambda x: [("floor", ..., x), ("floor_f", ..., f), ("floor_phase", ..., phase),
                           ("floor_d", ..., way)],
    )  # fmt: skip


def _stribeck(rng, m):
    (at, place), speed = _where(rng, m), _log(rng, 0.3, 4.0)
    return Hidden(
        "stribeck", place, lambda x: {"torque": x, "speed": speed}, 0.02,
        physics=lambda x: [("stribeck", at, x), ("stribeck_speed", at, speed)],
    )  # fmt: skip


def _late_drive(rng, m):
    at, place = _where(rng, m)

    def late(torque, x):
        return _some(torque, at, shifted(torque, list(range(m.wheels)), x))

    return Hidden("actuator-delay", place, lambda x: {"delay": x}, 4e-3, 0.05, 1e-3, command=late)


def _some(before, at, after):
    out = before.copy()
    out[:, at] = after[:, at]
    return out


def _slow_drive(rng, m):
    at, place = _where(rng, m)
    return Hidden("actuator-lag", place, lambda x: {"tau": x}, 4e-3, 0.08, 1e-3,
                  command=lambda u, x: _some(u, at, lagged(u, x)))  # fmt: skip


def _weak_drive(rng, m):
    """At its limit L: size x leaves the share 1 - x of the largest torque of a usual motion."""
    at, place = _where(rng, m)
    usual = plant.wander(np.random.default_rng(0), 4.0, 0.55 * 1.22 / m.stated["R"])
    peak = float(np.abs(plant.torques(m.stated, usual)[:, at]).max())

    def clipped(torque, x):
        return _some(torque, at, np.clip(torque, -(1 - x) * peak, (1 - x) * peak))

    return Hidden("actuator-saturation", place, lambda x: {"limit": (1 - x) * peak}, 0.2, 0.7, 0.02,
                  command=clipped)  # fmt: skip


def _group(rng) -> str:
    return str(rng.choice(["dR", "a", "Omega", "theta"], p=[0.4, 0.3, 0.15, 0.15]))


def _sensor_gain(rng, m):
    group, s = _group(rng), _sign(rng)
    columns = columns_of(group, m.wheels)

    def gained(out, x, first):
        out = out.copy()
        out[:, columns] *= 1 + s * x
        return out

    return Hidden("sensor-gain", group, lambda x: {"g": s * x}, 0.03, 0.5, sensor=gained)


def _sensor_time(id: str, key: str):
    def draw(rng, m):
        group = _group(rng)
        columns = columns_of(group, m.wheels)

        def late(out, x, first):
            if id == "sensor-delay":
                return shifted(out, columns, x)
            return _some(out, columns, smoothly_lagged(out, x))

        return Hidden(id, group, lambda x: {key: x}, 4e-3, 0.05, 2e-3, sensor=late)

    return draw


def _channel(rng, m, groups=("dR", "a")) -> tuple[int, str]:
    names = plant.columns(m.wheels)
    j = int(rng.choice([j for j, c in enumerate(names) if c.split("_")[0] in groups]))
    return j, names[j]


def _drift(rng, m, groups=("dR", "a")):
    (j, name), share = _channel(rng, m, groups), rng.uniform(-1, 1)
    s, sigma = _sign(rng), plant.NOISE[name.split("_")[0]]

    def drifting(out, x, first):
        out, t = out.copy(), (np.arange(len(out)) - first) / FINE
        out[:, j] += sigma * x * (share + s * t)
        return out

    return Hidden("sensor-drift", name, lambda x: {"a": sigma * x * share, "b": sigma * x * s}, 0.5,
                  sensor=drifting)  # fmt: skip


def _crosstalk(rng, m):
    matrix = rng.normal(size=(3, 3)) * (rng.random((3, 3)) < 0.4) * (1 - np.eye(3))
    a, b = rng.choice(3, 2, replace=False)
    matrix[a, b] = _sign(rng)

    def crossed(out, x, first):
        out = out.copy()
        out[:, :3] += x * out[:, :3] @ matrix.T
        return out

    pairs = [(i, j) for i in range(3) for j in range(3) if i != j]
    return Hidden("sensor-crosstalk", "dR",
                  lambda x: {f"X_{'xyz'[i]}{'xyz'[j]}": x * matrix[i, j] for i, j in pairs}, 0.05,
                  0.5, sensor=crossed)  # fmt: skip


def _clipped(rng, m):
    """A channel at its limit: size x cuts what is above 1 - x of the first run's peak."""
    j, name = _channel(rng, m, ("dR",))

    def clipped(out, x, tops):
        out, limit = out.copy(), (1 - x) * tops[j]
        out[:, j] = np.clip(out[:, j], -limit, limit)
        return out

    return Hidden("sensor-saturation", name, lambda x: {}, 0.3, 0.8, 0.02, limit=clipped)


def _rectified(rng, m):
    j, name = _channel(rng, m)

    def rectified(out, x, first):
        out = out.copy()
        out[:, j] = np.abs(out[:, j])
        return out

    return Hidden("sensor-rectified", name, lambda x: {}, 1.0, 1.0, 1.0, sensor=rectified)


def _eccentric(rng, m):
    (i, _), phase = _wheel(rng, m), rng.uniform(-np.pi, np.pi)

    def eccentric(out, x, first):
        out, theta = out.copy(), out[:, 3 + i]
        out[:, 3 + i] = theta + x * (np.sin(theta + phase) - np.sin(theta[first] + phase))
        return out

    place = f"theta_{i + 1}"
    return Hidden("encoder-eccentricity", place, lambda x: {"amplitude": x, "phase": phase}, 1e-3,
                  0.1, sensor=eccentric)  # fmt: skip


KNOWN = {
    "wheel-runout": _runout,
    "damaged-roller": _roller,
    "sphere-out-of-round": _round,
    "contact-cubic": _strength("contact-cubic", "K3", "K3", 1e12, True),
    "contact-hertz": _preload("contact-hertz", "hertz"),
    "contact-relaxation": _relaxation,
    "lift-off": _preload("lift-off", "lift"),
    "mount-cubic": _strength("mount-cubic", "k3", "k3", 3e13, True),
    "mount-backlash": _strength("mount-backlash", "gap", "backlash", 2e-6, False),
    "mount-friction": _strength("mount-friction", "force", "dry", 0.5, False),
    "bearing-coulomb": _strength("bearing-coulomb", "torque", "coulomb", 0.01, False),
    "bearing-viscous": _strength("bearing-viscous", "b", "viscous", 1e-4, False),
    "motor-ripple": _line("motor-ripple", "amplitude", "ripple", 0.01),
    "motor-gain": _strength("motor-gain", "g", "gain", 0.01, True, 0.5, one=True),
    "rolling-resistance": _global("rolling-resistance", "arm", "arm", 1e-4, "all"),
    "spin-resistance": _global("spin-resistance", "lever", "lever", 1e-4, "all"),
    "air-drag": _global("air-drag", "D", "drag", 0.02, "sphere"),
    "unbalance": _unbalance,
    "floor-vibration": _floor,
    "creep": _strength("creep", "creepage", "creep", 1e-3, True, 0.1, one=True),
    "sensor-gain": _sensor_gain,
    "sensor-delay": _sensor_time("sensor-delay", "delay"),
    "sensor-drift": _drift,
    "sensor-crosstalk": _crosstalk,
    "torque-offset": _strength("torque-offset", "torque", "bias", 0.01, True, one=True),
    "actuator-delay": _late_drive,
    "actuator-lag": _slow_drive,
    "actuator-saturation": _weak_drive,
    "cogging": _cogging,
    "current-ripple": _line("current-ripple", "g", "current", 0.05),
    "stribeck": _stribeck,
    "load-friction": _strength("load-friction", "mu", "load", 0.02, False, 0.7),
    "friction-asymmetry": _strength("friction-asymmetry", "torque", "asymmetry", 0.01, True),
    "encoder-eccentricity": _eccentric,
    "sensor-lag": _sensor_time("sensor-lag", "tau"),
    "sensor-saturation": _clipped,
    "sensor-rectified": _rectified,
}
DRIFT_ANYWHERE = functools.partial(_drift, groups=("dR", "a", "Omega", "theta"))
RADIUS = _strength("wheel-radius", "s", "radius", 1e-3, True, 0.1, one=True)
FRICTION = ("bearing-coulomb", "bearing-viscous", "rolling-resistance", "spin-resistance",
            "air-drag")  # fmt: skip


def _cross(rng, m):
    a, b = rng.choice(m.wheels, 2, replace=False)
    s = _sign(rng)
    return Hidden("cross-coupling", f"w{a + 1}-w{b + 1}", lambda x: {}, 1e4, physics=lambda x: [
        ("cross", (a, b), s * x), ("cross", (b, a), s * x)])  # fmt: skip


def _fading(rng, m):
    at, place = _where(rng, m)
    s = _sign(rng)
    return Hidden("fading-stiffness", place, lambda x: {}, 5e-3, 0.1,
                  physics=lambda x: [("fade", at, s * x)])  # fmt: skip


def _soft(rng, m):
    j, name = _channel(rng, m, ("dR",))

    def soft(out, x, tops):
        out, limit = out.copy(), tops[j] / x
        out[:, j] = limit * np.tanh(out[:, j] / limit)
        return out

    return Hidden("soft-saturation", name, lambda x: {}, 0.7, 5.0, limit=soft)


OUTSIDE = {
    "cross-coupling": _cross,
    "quadratic-contact": _strength("quadratic-contact", "K2", "K2", 2e7, True),
    "quadratic-mount": _strength("quadratic-mount", "k2", "k2", 1e9, True),
    "fading-stiffness": _fading,
    "square-drag": _strength("square-drag", "d", "square", 1e-4, False, one=True),
    "soft-saturation": _soft,
}
