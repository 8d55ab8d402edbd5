"""Orders that stand out in what is left: a fine scan over the measured position."""

import numpy as np

from .candidates import commanded

FINE = 4  # orders tried within one resolution of the travel
CLOSER = 8  # times as many beside a peak
PERIODS = 2  # of a line over the travel: what does not repeat is none
PEAKS = 8
MOST = 6000
SLOW = 0.25  # share of the rows that a line must pass slowly enough to be seen in them
SEEN = 0.8  # of half the rows' sampling rate: what their low pass lets through


def strongest_orders(model, point) -> dict[tuple[str, str], list[float]]:
    """By port and place the orders (events a radian times 1) whose lines close most of the balance.

    A line of an actuator multiplies the motor's torque, which changes its sign: the balance itself
    has no line there, but the balance beside the torque has.

    The residual is the balance of accelerations at the point, whatever the criterion; the grid has
    `FINE` orders within one resolution, 2 pi over the travel, and finer ones beside its peaks.  An
    order is looked for in the rows whose speed keeps it within what they let through, up to where a
    quarter of them does.
    """
    which, theta = model.splits["train"], model.numbers.vector(point)
    angle, left, speed, torque, step = [], [], [], [], 0.0
    for i in which:
        balance, value = model.balance(i)
        rest = value(theta)
        q, v = (balance.thinned(balance.filtered[k]) for k in ("position", "velocity"))
        angle.append(q)
        left.append(rest - rest.mean())
        speed.append(v)
        at = balance.filtered
        u = commanded(model.machine, at["position"], at["velocity"], balance.run.inputs)
        torque.append(balance.thinned(u))
        step = balance.run.step * balance.thin
    angle, left, speed, torque = map(np.concatenate, (angle, left, speed, torque))
    travel = float(np.ptp(angle))
    if travel <= 0:
        return {}
    fine = 2 * np.pi / travel / FINE
    fastest = SEEN * np.pi / step  # rad/s, of a line
    top = min(fastest / (np.quantile(np.abs(speed), SLOW) or 1.0), fine * MOST)
    grid = np.arange(PERIODS * FINE, max(PERIODS * FINE + 1, int(top / fine))) * fine

    weights = np.stack([np.ones_like(torque), torque], axis=1)

    def power(orders):
        """Fall of the squares (orders, 2) by a line, and by one times the torque, where seen."""
        seen = np.outer(orders, np.abs(speed)) < fastest
        wave = np.where(seen, np.exp(1j * np.outer(orders, angle)), 0.0)
        fall = np.abs(wave @ (left[:, None] * weights)) ** 2
        return fall / np.maximum(seen @ weights**2, 1e-300)

    parts = np.split(grid, range(256, len(grid), 256))
    powers = np.concatenate([power(part) for part in parts])
    bare, times = (
        _highest(grid, fine, powers[:, k], lambda x, k=k: power(x)[:, k]) for k in (0, 1)
    )
    ports = {(model.laws[i].port, place) for i, place in model.places}
    return {(port, at): times if port == "actuator" else bare for port, at in ports}


def _highest(grid, fine: float, powers, power) -> list[float]:
    """Orders of the highest peaks of `powers` on `grid`, more finely looked for by `power`."""
    peaks = [
        k for k in range(len(grid))
        if powers[k] >= powers[max(0, k - 1)] and powers[k] >= powers[min(len(grid) - 1, k + 1)]
    ]  # fmt: skip
    best, closer = [], np.arange(-CLOSER, CLOSER + 1) * fine / CLOSER
    for k in sorted(peaks, key=lambda k: -powers[k])[:PEAKS]:
        near = grid[k] + closer
        best.append(float(near[np.argmax(power(near))]))
    return best
