"""Orders that stand out in what is left: a fine scan over the measured position."""

import numpy as np

FINE = 4  # orders tried within one resolution of the travel
CLOSER = 8  # times as many beside a peak
PERIODS = 2  # of a line over the travel: what does not repeat is none
PEAKS = 8
MOST = 6000
SLOW = 0.25  # share of the rows that a line must pass slowly enough to be seen in them
SEEN = 0.8  # of half the rows' sampling rate: what their low pass lets through


def strongest_orders(model, point) -> dict[str, list[float]]:
    """By place the orders (events a radian times 1) whose lines close most of the balance.

    The residual is the balance of accelerations at the point, whatever the criterion; the grid has
    `FINE` orders within one resolution, 2 pi over the travel, and finer ones beside its peaks.  An
    order is looked for in the rows whose speed keeps it within what they let through, up to where a
    quarter of them does.
    """
    which, theta = model.splits["train"], model.numbers.vector(point)
    angle, left, speed, step = [], [], [], 0.0
    for i in which:
        balance, value = model.balance(i)
        rest = value(theta)
        q, v = (balance.thinned(balance.filtered[k]) for k in ("position", "velocity"))
        angle.append(q)
        left.append(rest - rest.mean())
        speed.append(v)
        step = balance.run.step * balance.thin
    angle, left, speed = map(np.concatenate, (angle, left, speed))
    travel = float(np.ptp(angle))
    if travel <= 0:
        return {}
    fine = 2 * np.pi / travel / FINE
    fastest = SEEN * np.pi / step  # rad/s, of a line
    top = min(fastest / (np.quantile(np.abs(speed), SLOW) or 1.0), fine * MOST)
    grid = np.arange(PERIODS * FINE, max(PERIODS * FINE + 1, int(top / fine))) * fine

    def power(orders):
        """Fall of the squares by a line of each order, over the rows in which it is seen."""
        seen = np.outer(orders, np.abs(speed)) < fastest
        wave = np.where(seen, np.exp(1j * np.outer(orders, angle)), 0.0)
        return np.abs(wave @ left) ** 2 / np.maximum(seen.sum(axis=1), 1)

    parts = np.split(grid, range(256, len(grid), 256))
    powers = np.concatenate([power(part) for part in parts])
    peaks = [
        k for k in range(len(grid))
        if powers[k] >= powers[max(0, k - 1)] and powers[k] >= powers[min(len(grid) - 1, k + 1)]
    ]  # fmt: skip
    best, closer = [], np.arange(-CLOSER, CLOSER + 1) * fine / CLOSER
    for k in sorted(peaks, key=lambda k: -powers[k])[:PEAKS]:
        near = grid[k] + closer
        best.append(float(near[np.argmax(power(near))]))
    return {place: best for _, place in model.places}
