"""Orders that stand out in what is left: a fine scan over the measured position."""

import numpy as np

FINE = 4  # orders tried within one resolution of the travel
PERIODS = 2  # of a line over the travel: what does not repeat is none
PEAKS = 8
MOST = 6000


def strongest_orders(model, point) -> dict[str, list[float]]:
    """By place the orders (events a radian times 1) whose lines close most of the balance.

    The residual is the balance of accelerations at the point, whatever the criterion; the grid has
    `FINE` orders within one resolution, 2 pi over the travel, up to half a row's sampling at the
    typical speed.
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
    fastest = np.quantile(np.abs(speed), 0.5) or 1.0
    top = min(np.pi / step / fastest, fine * MOST)
    grid = np.arange(PERIODS * FINE, max(PERIODS * FINE + 1, int(top / fine))) * fine
    power = np.empty(len(grid))
    for begin in range(0, len(grid), 256):
        part = grid[begin : begin + 256]
        wave = np.exp(1j * np.outer(part, angle))
        power[begin : begin + 256] = np.abs(wave @ left) ** 2
    peaks = [
        k for k in range(len(grid))
        if power[k] >= power[max(0, k - 1)] and power[k] >= power[min(len(grid) - 1, k + 1)]
    ]  # fmt: skip
    best = sorted(peaks, key=lambda k: -power[k])[:PEAKS]
    return {place: [float(grid[k]) for k in best] for _, place in model.places}
