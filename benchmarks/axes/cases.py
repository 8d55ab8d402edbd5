"""What a seed draws: an axis, what is hidden in it, its runs, and the files of a stranger."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np

from .plants import Plant, moved, shown

KINDS = ("motor", "slide", "disc", "two-mass", "servo")
EVERY = ("coulomb", "stribeck", "load", "asymmetry", "cogging", "lines", "ripple", "offset",
         "delay", "lag", "limit", "motor")  # fmt: skip
HIDDEN = {
    "motor": (*EVERY, "eccentric"), "slide": EVERY,
    "disc": (*EVERY, "eccentric", "late", "slow"),
    "two-mass": ("coulomb", "cogging", "ripple", "delay", "lag", "gap", "gap", "eccentric"),
    "servo": ("coulomb", "stribeck", "load", "asymmetry", "cogging", "late", "slow"),
}  # fmt: skip
IDS = {  # what is hidden -> ids, each a set of names for one thing
    "none": (), "coulomb": ({"bearing-coulomb"},), "load": ({"load-friction"},),
    "stribeck": ({"bearing-coulomb"}, {"stribeck"}),
    "asymmetry": ({"bearing-coulomb"}, {"friction-asymmetry"}),
    "cogging": ({"motor-ripple", "cogging"},), "lines": ({"motor-ripple", "cogging"},),
    "ripple": ({"current-ripple"},), "offset": ({"torque-offset"},),
    "delay": ({"actuator-delay"},), "lag": ({"actuator-lag"},),
    "limit": ({"actuator-saturation"},), "motor": ({"motor-gain"},), "gap": ({"mount-backlash"},),
    "eccentric": ({"encoder-eccentricity"},), "late": ({"sensor-delay"},),
    "slow": ({"sensor-lag"},),
}  # fmt: skip
COLUMNS = {  # quantity -> (column, SI units a unit of it)
    "time": (("t", 1.0), ("time", 1.0), ("time_ms", 1e-3), ("t_s", 1.0)),
    "rad": (("angle", 1.0), ("theta_deg", np.pi / 180), ("pos_rad", 1.0), ("encoder_mrad", 1e-3)),
    "m": (("position_mm", 1e-3), ("x_m", 1.0), ("pos_mm", 1e-3)),
    "torque": (("torque", 1.0), ("torque_Nm", 1.0), ("torque_mNm", 1e-3)),
    "force": (("force", 1.0), ("force_N", 1.0)),
    "current": (("current_A", 1.0), ("i_cmd_current_mA", 1e-3)),
    "command": (("u", 1.0), ("u_cmd", 1.0)),
    "goal": (("goal", 1.0), ("goal_deg", np.pi / 180), ("setpoint_rad", 1.0)),
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Case:
    """A drawn axis with its tables of runs (column -> values) and what is hidden in it.

    `inputs` and the position's noise `sigma` are in SI units.
    `share` is the hidden torque over the motor's, `shows` the position that the effect moves within
    a second, beside a straight line, in sigma of the noise (RMS each); `machine` the user's file,
    or "" where the file of `case new` is left as it is.
    """

    plant: Plant
    hidden: str
    effect: dict[str, Any]
    tables: list[dict[str, np.ndarray]]
    inputs: list[np.ndarray]
    sigma: float
    share: float
    shows: float
    rate: float
    held: bool
    noise: str
    machine: str

    @property
    def orders(self) -> list[float]:
        """Orders of hidden lines, a radian or a metre of the axis."""
        some = [n for _, n, _ in self.effect.get("lines", ())]
        return some + ([self.effect["ripple"][1]] if "ripple" in self.effect else [])


def drawn(seed: int) -> Case:
    """All of a seed."""
    rng = np.random.default_rng([23, seed])
    kind = str(rng.choice(KINDS))
    hidden = "none" if rng.random() < 0.15 else str(rng.choice(HIDDEN[kind]))
    rate = float(rng.choice([100, 200, 250, 500, 1000, 2000, 5000],
                            p=[0.1, 0.15, 0.2, 0.25, 0.2, 0.07, 0.03]))  # fmt: skip
    plant, size, band = _plant(rng, kind)
    held = kind == "servo" or bool(rng.random() < 0.5)
    count = round(rate * rng.uniform(8, 14))
    runs = [size * _course(rng, count, rate, band, kind) for _ in range(rng.integers(1, 3))]
    bare = [moved(plant, {}, u, 1 / rate, held) for u in runs]
    effect = _effect(rng, hidden, plant, np.concatenate(bare, axis=1), rate)
    made = [moved(plant, effect, u, 1 / rate, held) for u in runs]
    q, v, torque, added = np.concatenate(made, axis=1)
    if not (np.all(np.isfinite(q)) and np.std(v) > 0):
        raise RuntimeError("the plant ran away")
    sigma = float(np.std(q)) * _log(rng, 1e-5, 5e-4)
    coarse = float(rng.choice([0.0, 0.0, 2.0, 4.0])) * sigma
    names = _columns(rng, plant)
    tables, seen = [], []
    for u, (q, _, _, extra) in zip(runs, made, strict=True):
        y = shown(effect, q, 1 / rate)
        seen.append(y - q + _position(extra / plant.J, 1 / rate))
        measured = np.round(y / coarse) * coarse if coarse else y + sigma * rng.normal(size=len(y))
        values = (np.arange(count) / rate, u, measured)
        tables.append({k: x / unit for (k, unit), x in zip(names, values, strict=True)})
    shaken = coarse / math.sqrt(12) if coarse else sigma
    shows = _beside_lines(seen, rate) / shaken
    share, file = _rms(added) / _rms(torque), ""
    if hidden in ("motor", "offset") or kind == "two-mass" or rng.random() < 0.4:
        file = _machine(rng, plant, hidden, float(np.std(torque)))
    white = "quantised" if coarse else "white"
    return Case(plant, hidden, effect, tables, runs, shaken, share, shows, rate, held, white, file)


def _log(rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _plant(rng, kind: str) -> tuple[Plant, float, tuple[float, float]]:
    """(axis, size of its input, band of its input in Hz)."""
    J, slow = _log(rng, 1e-5, 1e-1), rng.uniform(0.3, 3.0)  # slow: 1/s, of the damping
    band = (0.15, 1.0)
    drives = str(rng.choice(["torque", "current", "command"]))
    K = 1.0 if drives == "torque" else _log(rng, 0.01, 2.0)
    speed = _log(rng, 3.0, 30.0)
    if kind == "slide":
        J, speed, drives = 1e3 * J, _log(rng, 0.1, 1.0), "force" if drives == "torque" else drives
    if kind == "disc":
        w = rng.uniform(4.0, 8.0)
        plant = Plant(kind, drives, J, 0.2 * slow * J, K, gravity=J * w**2)
        return plant, rng.uniform(0.3, 1.2) * J * w**2 / K, (0.2, 1.5)
    if kind == "servo":
        K, w = rng.uniform(0.3, 2.0), _log(rng, 12.0, 40.0)  # w: rad/s, of the closed loop
        supply, J = rng.uniform(5, 24), _log(rng, 0.05, 1.0) * K**2 / 10
        gain = J * w**2 / (K * supply)
        plant = Plant(kind, "goal", J, slow * J, K, gain=gain, supply=supply,
                      clip=float(rng.choice([1.0, 100.0])))  # fmt: skip
        return plant, rng.uniform(0.3, 1.2), (0.15, 1.2)
    second = {}
    if kind == "two-mass":
        J2, f = J * _log(rng, 0.3, 3.0), rng.uniform(6.0, 25.0)
        both = J * J2 / (J + J2)
        k = both * (2 * np.pi * f) ** 2
        second = {"J2": J2, "k": k, "c": 2 * rng.uniform(0.02, 0.1) * math.sqrt(k * both)}
        band, speed = (0.2, 4.0), speed / 3
    plant = Plant(kind, drives, J, slow * J, K, **second)
    return plant, speed * (J + plant.J2) * 2 * np.pi * math.sqrt(band[0] * band[1]) / K, band


def _course(rng, count: int, rate: float, band, kind: str) -> np.ndarray:
    """An input (t,) of size 1: four sines, of a servo with jumps of its goal."""
    t = np.arange(count) / rate
    f = np.exp(rng.uniform(*np.log(band), 4))
    u = sum(np.sin(2 * np.pi * a * t + p) for a, p in zip(f, rng.uniform(0, 6, 4), strict=True)) / 2
    if kind == "servo":
        u = u - u[0] + np.repeat(rng.uniform(-1, 1, count), round(1.5 * rate))[:count]
    return u


def _effect(rng, hidden: str, plant: Plant, run: np.ndarray, rate: float) -> dict[str, Any]:
    """Numbers of what is hidden, from clearly visible to small, by the run (4, t) without it."""
    q, v, torque, _ = run
    size, speed = float(np.std(torque)), float(np.std(v))
    part, phase = _log(rng, 0.03, 0.35), rng.uniform(0, 2 * np.pi)
    dry = {"width": speed * _log(rng, 0.005, 0.05), "torque": float(np.max(np.abs(torque)))}
    time = max(1e-3, _log(rng, 1, 6) / rate)
    top = 0.12 * rate / speed  # of an order: at this speed it is an eighth of half the rate
    turn = 2 * np.pi / rng.choice([0.005, 0.01, 0.02, 0.03]) if plant.kind == "slide" else 1.0
    whole = [n * turn for n in (1, 2, 4, 6, 7, 12, 13, 24, 36) if n * turn < top]
    whole = [n for n in whole if n * np.ptp(q) > 6 * np.pi] or [6 * np.pi / np.ptp(q)]
    n = float(rng.choice(whole))
    lines = ((part * size, n, phase), (0.6 * part * size, 13 / 6 * n, phase + 1))
    fast = {"fast": 3 * speed}
    twist = float(np.std(np.diff(v))) * rate * plant.J2 / plant.k if plant.J2 else 0.0
    return {
        "none": {}, "coulomb": dry | {"coulomb": part * size}, "load": dry | {"load": part},
        "stribeck": dry | {"coulomb": part * size, "stribeck": rng.uniform(0.4, 1) * part * size,
                           "speed": rng.uniform(0.1, 0.4) * speed},
        "asymmetry": dry
        | {"coulomb": part * size, "asymmetry": rng.uniform(0.2, 0.5) * part * size},
        "cogging": fast | {"lines": lines[:1]}, "lines": fast | {"lines": lines},
        "ripple": {"ripple": (part, n, phase)}, "offset": {"offset": part * size},
        "delay": {"delay": time}, "lag": {"lag": time},
        "limit": {"limit": float(np.quantile(np.abs(torque), rng.uniform(0.5, 0.9)))},
        "motor": {"motor": float(rng.choice([-1, 1])) * part},
        "eccentric": {"eccentric": (_log(rng, 1e-3, 3e-2), phase)}, "late": {"late": time},
        "slow": {"slow": time}, "gap": {"gap": _log(rng, 0.2, 1.0) * twist},
    }[hidden]  # fmt: skip


def _columns(rng, plant: Plant) -> list[tuple[str, float]]:
    """(column, SI units of one) of time, input, position."""
    length = "m" if plant.kind == "slide" else "rad"
    return [COLUMNS[k][rng.integers(len(COLUMNS[k]))] for k in ("time", plant.drives, length)]


def _position(acceleration: np.ndarray, step: float) -> np.ndarray:
    return np.cumsum(np.cumsum(acceleration)) * step**2


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))


def _beside_lines(parts: list[np.ndarray], rate: float) -> float:
    """RMS of signals beside a straight line in each second."""
    out = []
    for x in parts:
        for window in np.array_split(x, max(1, round(len(x) / rate))):
            t = np.linspace(-1, 1, len(window))
            out.append(window - np.polyval(np.polyfit(t, window, 1), t))
    return _rms(np.concatenate(out))


def _machine(rng, plant: Plant, hidden: str, size: float) -> str:
    """machine.toml as its user writes it: numbers within their tolerance."""
    sure = 1e-9 if hidden == "motor" else 0.08

    def near(x: float, tolerance: float) -> float:
        return x * math.exp(tolerance * float(np.clip(rng.normal(), -1.5, 1.5)))

    servo = plant.kind == "servo"
    tables = {"axis": {"inertia": (plant.J, sure), "damping": (plant.d, 0.4),
                       "gravity": (plant.gravity, sure)},
              "motor": {"torque_constant": (plant.K, 0.0), "resistance": (1.0 * servo, 0.0)},
              "servo": {"gain": (plant.gain, 0.0), "supply": (plant.supply, 0.0),
                        "limit": (plant.clip, 0.0)},
              "second": {"inertia": (plant.J2, sure), "stiffness": (plant.k, 0.1),
                         "damping": (plant.c, 0.4)}}  # fmt: skip
    if plant.drives in ("torque", "force"):
        del tables["motor"]["torque_constant"]
    drives = "torque" if plant.drives == "force" else plant.drives
    motion = "translation" if plant.kind == "slide" else "rotation"
    lines, unsure = ['kind = "axis"', f'motion = "{motion}"'], []
    for name, table in tables.items():
        rows = [f"{k} = {near(x, s)!r}" for k, (x, s) in table.items() if x]
        rows += [f'input = "{drives}"'] if name == "motor" else []
        unsure += [f'"{name}.{k}" = {s}' for k, (x, s) in table.items() if x and s > 1e-6]
        lines += ["", f"[{name}]", *rows] if rows else []
    if hidden != "offset":
        unsure.append(f'"axis.offset" = {0.05 * size!r}')
    return "\n".join([*lines, "", "[uncertainty]", *unsure, ""])


def written(folder: Path, case: Case) -> list[Path]:
    """The logs of a stranger."""
    logs = []
    for i, table in enumerate(case.tables):
        logs.append(folder / f"log{i + 1}.csv")
        np.savetxt(logs[-1], np.stack(list(table.values()), 1), delimiter=",", fmt="%.10g",
                   header=",".join(table), comments="")  # fmt: skip
    return logs
