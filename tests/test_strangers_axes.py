"""Axes of plants that stand here in numpy, from a stranger's log to the answer."""

import numpy as np
import pytest

from omnijax import cli
from omnijax.diagnosis import diagnose
from tests.seeds import drawn_anew


def sines(rng, low, high):
    """A slow input of size 1 (function of time)."""
    f, p = np.exp(rng.uniform(np.log(low), np.log(high), 4)), rng.uniform(0, 6, 4)
    return lambda t: sum(np.sin(2 * np.pi * a * t + b) for a, b in zip(f, p, strict=True)) / 2


def run(acceleration, drive, rate, seconds, fine=4, held=False):
    """(t, drive, position), Runge-Kutta steps from rest; nothing of the library.

    The acceleration is of (position, speed, drive); a drive that is `held` changes at samples only.
    """
    t, h = np.arange(round(seconds * rate)) / rate, 1 / rate / fine
    x, out = np.zeros(2), []

    def slope(x, s):
        return np.array([x[1], acceleration(x[0], x[1], now if held else drive(s))])

    for s in t:
        out.append(x[0])
        now = drive(s)
        for j in range(fine):
            a = s + j * h
            k1 = slope(x, a)
            k2 = slope(x + h / 2 * k1, a + h / 2)
            k3 = slope(x + h / 2 * k2, a + h / 2)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(x + h * k3, a + h))
    return t, drive(t), np.array(out)


def cogging_behind_a_gear(rng):
    """A motor with current as its input; angle in degrees, order 6 and 13 of the motor's turn."""
    J, K, n = 10 ** rng.uniform(-4, -2), rng.uniform(0.02, 0.2), rng.uniform(1.0, 2.0)
    first, second = 6 * n, 13 * n
    g, phase = sines(rng, 0.15, 0.9), rng.uniform(0, 6, 2)

    def a(q, v, i):
        lines = 5 * np.sin(first * q + phase[0]) + 3 * np.sin(second * q + phase[1])
        return K * i / J - v + lines

    t, i, q = run(a, lambda t: 15 * J / K * g(t), 500.0, 10)
    table = {"t_s": t, "current_A": i, "theta_deg": np.rad2deg(q + 2e-5 * rng.normal(size=len(t)))}
    return table, {"cogging", "motor-ripple"}, (first, second)


def disc_over_the_top(rng):
    """A disc with a mass that its motor throws over the top, dry friction, time in ms."""
    J, w, g = 10 ** rng.uniform(-3, -1), rng.uniform(4, 8), sines(rng, 0.2, 1.5)

    def a(q, v, u):
        return u / J - w**2 * np.sin(q) - 0.15 * w * v - 0.12 * w**2 * np.tanh(v / 0.03)

    t, u, q = run(a, lambda t: 1.2 * J * w**2 * g(t), 250.0, 14, fine=6)
    q = q + 1e-4 * rng.normal(size=len(t))
    return {"time_ms": 1e3 * t, "torque_Nm": u, "pos_rad": q}, {"bearing-coulomb"}, ()


def swinging_disc(rng):
    """A disc with a mass that swings, two cogging torques that bend its motion far together."""
    J, w, n = 10 ** rng.uniform(-4, -2), rng.uniform(4, 6), float(rng.integers(20, 26))
    g, phase = sines(rng, 0.3, 1.2), rng.uniform(0, 6, 2)

    def a(q, v, u):
        lines = 0.3 * np.sin(n * q + phase[0]) + 0.18 * np.sin(13 / 6 * n * q + phase[1])
        return u / J - w**2 * (np.sin(q) + 0.03 * v / w - 0.06 * lines)

    t, u, q = run(a, lambda t: 0.5 * J * w**2 * g(t), 500.0, 9)
    q = q + 1e-5 * rng.normal(size=len(t))
    return {"t": t, "torque": u, "angle": q}, {"cogging", "motor-ripple"}, (n, 13 / 6 * n)


def slide(rng):
    """A linear drive in millimetres with dry friction."""
    M, c, g = 10 ** rng.uniform(0, 2), rng.uniform(0.3, 0.6), sines(rng, 0.2, 1.0)
    t, u, q = run(lambda q, v, f: f / M - v - c * np.tanh(v / 0.01), lambda t: 4 * M * g(t), 500.0,
                  10, fine=6)  # fmt: skip
    q = 1e3 * (q + 2e-6 * rng.normal(size=len(t)))
    return {"time": t, "force_N": u, "position_mm": q}, {"bearing-coulomb"}, ()


def behind_a_controller(rng):
    """A controller holds the torque; the motor has a limit, an encoder off its centre, neither."""
    J, g, rate = 10 ** rng.uniform(-4, -2), sines(rng, 0.15, 0.9), rng.uniform(150, 400)
    which = rng.choice(["actuator-saturation", "encoder-eccentricity", ""])
    top = 16 if which == "actuator-saturation" else np.inf
    t, u, q = run(lambda q, v, u: np.clip(u / J, -top, top) - v, lambda t: 25 * J * g(t), rate, 10,
                  fine=2, held=True)  # fmt: skip
    if which == "encoder-eccentricity":
        q = q + 0.01 * (np.sin(q + 1) - np.sin(q[0] + 1))
    table = {"t": t, "torque": u, "angle": q + 1e-5 * rng.normal(size=len(t))}
    return table, {which} - {""}, ()


def nothing(rng):
    """A motor with viscous friction alone."""
    J, g = 10 ** rng.uniform(-4, -2), sines(rng, 0.15, 0.9)
    t, u, q = run(lambda q, v, u: u / J - v, lambda t: 20 * J * g(t), 500.0, 8, fine=2)
    return {"time": t, "torque": u, "angle": q + 1e-4 * rng.normal(size=len(t))}, set(), ()


PLANTS = (cogging_behind_a_gear, disc_over_the_top, behind_a_controller, slide, swinging_disc,
          nothing)  # fmt: skip


@pytest.mark.full  # in the gate held inputs: test_axis_rivals; friction: test_machine_speed
@pytest.mark.parametrize("plant", PLANTS)
def test_what_the_axis_lacks_is_named_and_nothing_else(tmp_path, plant):
    table, truth, orders = plant(drawn_anew(plant.__name__))
    log = tmp_path / "log.csv"
    np.savetxt(log, np.stack(list(table.values()), 1), delimiter=",", header=",".join(table),
               comments="", fmt="%.9g")  # fmt: skip
    assert cli.run(["case", "new", str(log), "--out", str(tmp_path / "case"), "--yes"]) == 0
    found = diagnose(tmp_path / "case")
    named = {e.id for e in found.effects}
    assert named <= truth and bool(named) == bool(truth), found
    said = any("torque_constant` is not given" in x for x in found.faults)
    assert said == ("current_A" in table), found.faults  # else N m are those of the input
    seen = [
        x for e in found.effects for k, p in e.parameters.items() if k in ("order", "orders")
        for x in np.atleast_1d(p["value"])
    ]  # fmt: skip
    for x in seen:
        assert min(abs(x / order - 1) for order in orders) < 5e-3, (seen, orders)
    assert len(seen) == len(orders), (seen, orders)
