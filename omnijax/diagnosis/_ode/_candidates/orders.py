"""Orders that stand out in what is left: a fine scan over the measured position."""

import dataclasses

import numpy as np

from ..._settings import SETTINGS
from .candidates import commanded

FINE = SETTINGS.free_orders.fine
FINER = SETTINGS.free_orders.finer
PERIODS = SETTINGS.free_orders.periods
PEAKS = SETTINGS.free_orders.peaks
HIGHEST = SETTINGS.free_orders.highest
MOST_PEAKS = SETTINGS.free_orders.most_peaks
MOST_ORDERS = SETTINGS.free_orders.most_orders
SLOW_ROWS = SETTINGS.free_orders.slow_rows
PASSED_BAND = SETTINGS.free_rows.passed_band
LINES = SETTINGS.free_model.lines
LEAST_LINE = SETTINGS.free_orders.least_line


def strongest_orders(model, point) -> dict[tuple[str, str], list[float]]:
    """By port and place the orders (events a radian times 1) whose lines close most of the balance.

    A line of an actuator multiplies the motor's torque, which changes its sign: the balance itself
    has no line there, but the balance beside the torque has.

    The residual is the balance of accelerations at the point, whatever the criterion; the grid has
    `FINE` orders within one resolution of the travel, and finer ones beside its peaks.  An
    order is looked for in the rows whose speed keeps it within what they let through, up to where
    one in twenty of them does.  A line that is passed unevenly has many side lobes: beside the
    `HIGHEST` peaks stand those that are left once the lines before them are taken away, so that
    a second cogging of the same motor is among them.  The first `LINES` lines are each looked for
    once more beside the others, for a side lobe of several may stand above all lines.
    """
    which, theta = model.measured.splits["train"], model.numbers.vector(point)
    angle, left, speed, torque, step = [], [], [], [], 0.0
    for i in which:
        balance, value = model.evaluation.balance(i)
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
    if np.ptp(angle) == 0:
        return {}
    fine = model.measured.resolution / FINE
    fastest = PASSED_BAND * np.pi / step  # rad/s, of a line
    top = min(fastest / (np.quantile(np.abs(speed), SLOW_ROWS) or 1.0), fine * MOST_ORDERS)
    grid = np.arange(PERIODS * FINE, max(PERIODS * FINE + 1, int(top / fine))) * fine

    ports = {(model.laws[i].port, place) for i, place in model.places}
    bare, times = (
        _Lines(angle, speed, left, weight, fastest).strongest(grid, fine)
        for weight in (np.ones_like(torque), torque)
    )
    return {(port, at): times if port == "actuator" else bare for port, at in ports}


@dataclasses.dataclass(frozen=True)
class _Lines:
    """Lines of an `angle` (rows,) in what is `left`, times a `weight`, at orders.

    A row sees the orders that its `speed` keeps below `fastest`, rad/s.
    """

    angle: np.ndarray
    speed: np.ndarray
    left: np.ndarray
    weight: np.ndarray
    fastest: float

    def waves(self, orders) -> np.ndarray:
        """Waves (orders, rows) exp(i n angle), 0 in rows that do not see the order."""
        seen = np.outer(orders, np.abs(self.speed)) < self.fastest
        turned = 1j * np.outer(orders, self.angle)
        return np.exp(turned, where=seen, out=np.zeros(seen.shape, complex))

    def power(self, orders, waves=None) -> np.ndarray:
        """Fall of the squares (orders,) by a line each."""
        waves = self.waves(orders) if waves is None else waves
        size = (waves != 0) @ self.weight**2
        return np.abs(waves @ (self.weight * self.left)) ** 2 / np.maximum(size, 1e-300)

    def along(self, grid, fine: float) -> np.ndarray:
        """`power` of a grid with steps `fine`: exp(i (m + n) q) = exp(i m q) exp(i n q).

        So blocks of 8 by 8 orders take 8 waves of their own and a product of matrices.  A row
        counts in the blocks of which it sees all orders.
        """
        near = np.exp(1j * np.outer(np.arange(8) * fine, self.angle))
        out, weighed, speed = [], self.weight * self.left, np.abs(self.speed)
        for block in np.split(grid, range(64, len(grid), 64)):
            seen = block[-1] * speed < self.fastest
            waves = np.exp(1j * np.outer(block[::8], self.angle[seen])) * weighed[seen]
            size = max(float(np.sum(self.weight[seen] ** 2)), 1e-300)
            out.append(np.abs(waves @ near[:, seen].T).ravel()[: len(block)] ** 2 / size)
        return np.concatenate(out)

    def without(self, orders) -> "_Lines":
        """The same less the best lines of some orders together."""
        waves = self.waves(orders) * self.weight
        table = np.concatenate([np.real(waves), np.imag(waves)]).T
        size = np.linalg.lstsq(table, self.left, rcond=LEAST_LINE)[0]
        return dataclasses.replace(self, left=self.left - table @ size)

    def strongest(self, grid, fine: float) -> list[float]:
        """`PEAKS` orders on a `grid` with steps `fine`, more finely looked for beside each."""
        powers = self.along(grid, fine)
        peaks = grid[_peaks(powers)[:MOST_PEAKS]]
        highest = [self.closer(x, fine) for x in peaks[:HIGHEST]]
        waves, lines = self.waves(peaks), highest[:1]
        while lines and len(lines) < min(PEAKS, len(peaks)):
            again = [self.beside(lines, peaks, waves, fine)]
            for _ in range(len(lines) if len(lines) < LINES else 0):  # each one beside the others
                again.append(self.beside([*lines[1:], *again], peaks, waves, fine))
                lines = lines[1:]
            lines += again
        return list(dict.fromkeys([*highest, *lines]))[:PEAKS]

    def beside(self, lines, peaks, waves, fine: float) -> float:
        """The best order of `peaks` beside some lines."""
        rest = self.without(lines) if lines else self
        return rest.closer(peaks[np.argmax(rest.power(peaks, waves))], fine)

    def closer(self, order: float, fine: float) -> float:
        """The best order within a step of the grid."""
        near = order + np.arange(-FINER, FINER + 1) * fine / FINER
        return float(near[np.argmax(self.power(near))])


def _peaks(powers) -> np.ndarray:
    """Indices of the local maxima, highest first."""
    wide = np.pad(powers, 1, mode="edge")
    peaks = np.flatnonzero((powers >= wide[:-2]) & (powers >= wide[2:]))
    return peaks[np.argsort(-powers[peaks], kind="stable")]
