"""Axes that move: equations of their own in plain Python, nothing of the package."""

import dataclasses
import math
from collections.abc import Callable, Mapping

import numpy as np

FOLLOWED = 0.25  # of a time constant, that a Runge-Kutta step lasts at most


@dataclasses.dataclass(frozen=True)
class Plant:
    """An axis in SI units; gravity in N m, K in N m a unit of the input, angles for a slide in m.

    A servo's voltage is `supply` clip(`gain` (goal - q), -`clip`, `clip`), its torque
    K (voltage - K v).  A second inertia hangs on k and c; gravity turns the first.
    """

    kind: str
    drives: str
    J: float
    d: float
    K: float = 1.0
    gravity: float = 0.0
    J2: float = 0.0
    k: float = 0.0
    c: float = 0.0
    gain: float = 0.0
    supply: float = 0.0
    clip: float = 0.0

    def wanted(self, u: float, q: float, v: float) -> float:
        """Torque that the motor is to deliver."""
        if self.kind != "servo":
            return self.K * u
        duty = min(max(self.gain * (u - q), -self.clip), self.clip)
        return self.K * (self.supply * duty - self.K * v)


def shaft(e: Mapping, q: float, v: float, load: float) -> float:
    """Torque that hidden effects add at the shaft; `load` is what the gear passes on."""
    sign = math.tanh(v / e["width"]) if "width" in e else 0.0
    dry = e.get("coulomb", 0.0) + e.get("load", 0.0) * abs(load)
    if "stribeck" in e:
        dry += e["stribeck"] * math.exp(-((v / e["speed"]) ** 2))
    lines = sum(a * math.sin(n * q + p) for a, n, p in e.get("lines", ()))
    return e.get("offset", 0.0) + lines - dry * sign - e.get("asymmetry", 0.0) * abs(sign)


def moved(plant: Plant, e: Mapping, u: np.ndarray, step: float, held: bool, start=(0.0, 0.0)):
    """(position, speed, motor's torque, torque that is hidden) (t,) from `start`, by Runge-Kutta.

    The start is position and speed, of four numbers those of a second inertia too, else of both.
    The input (t,) is held between its samples or runs linear; `e` holds the hidden effects.
    """
    command = _between(u.tolist(), step, held, e.get("delay", 0.0))
    prompt = _between(u.tolist(), step, held, 0.0)
    limit, tau, gap = e.get("limit", math.inf), e.get("lag", 0.0), e.get("gap", 0.0)
    g, n, p = e.get("ripple", (0.0, 0.0, 0.0))
    strength = 1 + e.get("motor", 0.0)

    def delivered(x, t):
        torque = plant.wanted(command(t), x[0], x[1])
        torque = x[4] if tau else torque
        return strength * min(max(torque, -limit), limit) * (1 + g * math.sin(n * x[0] + p))

    def drive(x):
        twist = x[0] - x[2]
        sprung = math.copysign(max(abs(twist) - gap, 0.0), twist)
        return plant.k * sprung + plant.c * (x[1] - x[3])

    def rate(x, t):
        q, v, _, v2, slow = x
        torque, passed = delivered(x, t), drive(x) if plant.J2 else 0.0
        total = torque - passed - plant.d * v - plant.gravity * math.sin(q)
        total += shaft(e, q, v, passed if plant.J2 else torque)
        lag = (plant.wanted(command(t), q, v) - slow) / tau if tau else 0.0
        return v, total / plant.J, v2, passed / plant.J2 if plant.J2 else 0.0, lag

    def hidden(x, t):
        q, v, q2 = x[:3]
        torque, passed = delivered(x, t), drive(x) if plant.J2 else 0.0
        play = plant.k * (q - q2) + plant.c * (v - x[3]) - passed if plant.J2 else 0.0
        return torque - plant.wanted(prompt(t), q, v) + play + shaft(e, q, v, passed or torque)

    fine = math.ceil(step / _longest(plant, e))
    h, x, out = step / fine, (*(*start, *start)[:4], 0.0), []
    for i in range(len(u)):
        out.append((x[0], x[1], delivered(x, i * step), hidden(x, i * step)))
        for j in range(fine):
            x = _stepped(rate, x, (i + j / fine) * step, h)
    return tuple(np.array(out).T)


def _longest(plant: Plant, e: Mapping) -> float:
    """The longest Runge-Kutta step that follows all that is fast, s."""
    steep = (sum(e.get(k, 0.0) for k in ("coulomb", "stribeck", "asymmetry"))
             + e.get("load", 0.0) * e.get("torque", 0.0))  # fmt: skip
    rates = [plant.d / plant.J, 1 / e["lag"] if "lag" in e else 0.0, 100.0]
    rates.append(steep / plant.J / e["width"] / 4 if "width" in e else 0.0)
    if plant.J2:
        rates.append(math.sqrt(plant.k * (1 / plant.J + 1 / plant.J2)))
    if plant.kind == "servo":
        rates.append(math.sqrt(plant.K * plant.supply * plant.gain / plant.J))
    rates.append(math.sqrt(plant.gravity / plant.J))
    rates += [n * e.get("fast", 0.0) for _, n, _ in e.get("lines", ())]
    return FOLLOWED / max(rates)


def _between(u: list[float], step: float, held: bool, delay: float) -> Callable[[float], float]:
    last = len(u) - 1

    def command(t: float) -> float:
        at = max((t - delay) / step + 1e-9, 0.0)
        i = min(int(at), last)
        return u[i] if held or i == last else u[i] + (at - i) * (u[i + 1] - u[i])

    return command


def _stepped(rate, x, t, h):
    """A Runge-Kutta step; what the input does at its end is seen just before it."""
    k1 = rate(x, t)
    k2 = rate(tuple(a + h / 2 * b for a, b in zip(x, k1, strict=True)), t + h / 2)
    k3 = rate(tuple(a + h / 2 * b for a, b in zip(x, k2, strict=True)), t + h / 2)
    k4 = rate(tuple(a + h * b for a, b in zip(x, k3, strict=True)), t + h * (1 - 1e-6))
    return tuple(a + h / 6 * (p + 2 * q + 2 * r + s)
                 for a, p, q, r, s in zip(x, k1, k2, k3, k4, strict=True))  # fmt: skip


def shown(e: Mapping, q: np.ndarray, step: float) -> np.ndarray:
    """What the sensor makes of the position (t,): late, slow, off its centre."""
    t = np.arange(len(q)) * step
    if "late" in e:
        q = np.interp(t - e["late"], t, q)
    if "slow" in e:  # a first-order lag of what is linear between samples
        keep = math.exp(-step / e["slow"])
        y, fade = np.empty_like(q), (1 - keep) * e["slow"] / step
        y[0] = q[0]
        for i in range(1, len(q)):
            y[i] = keep * y[i - 1] + (fade - keep) * q[i - 1] + (1 - fade) * q[i]
        q = y
    if "eccentric" in e:
        a, p = e["eccentric"]
        q = q + a * (np.sin(q + p) - np.sin(q[0] + p))
    return q
