"""Wheel shapes as tables over the angle: rho, the rolled length S(theta), and its inverse."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ...dynamics import wheel_shape
from ...rig import Rig
from .._settings import SETTINGS

SHAPING = ("radius", "shape")  # ports whose laws change a wheel's shape
POINTS = SETTINGS.prediction.table_points


class WheelPlaces(NamedTuple):
    """Where angles (t,) lie in a table: its point before each, and the share of the way on.

    `turns` counts how often the table was gone through before.
    """

    index: np.ndarray
    share: np.ndarray
    turns: np.ndarray

    def of(self, table: np.ndarray) -> np.ndarray:
        """The table's values (t,), linear between its points (p,)."""
        before = table[self.index]
        return before + self.share * (table[self.index + 1] - before)

    def summed(self, table: np.ndarray) -> np.ndarray:
        """The values of a table that begins at zero and goes on where it ended."""
        return self.turns * table[-1] + self.of(table)


class WheelTables(NamedTuple):
    """rho (m) and rolled length S = integral r_w dtheta / R (rad of sphere) of every wheel.

    One turn where the shape repeats, else as many turns as the runs cover.
    """

    angle: np.ndarray  # (p,) rad
    shape: np.ndarray  # (p, n)
    slope: np.ndarray  # (p, n) m/rad
    length: np.ndarray  # (p, n)
    first: float  # rad, angle of the table's start
    span: float  # rad, length of the table

    def rho(self, theta: np.ndarray) -> np.ndarray:
        """Shape at angles (t, n), m."""
        return self._look(self.shape, theta)

    def rho_slope(self, theta: np.ndarray) -> np.ndarray:
        """d rho/d theta at angles (t, n)."""
        return self._look(self.slope, theta)

    def places(self, theta: np.ndarray) -> WheelPlaces:
        """Where angles (t,) of a wheel lie in the tables; those of NaN have a share of NaN."""
        count = len(self.angle) - 1
        at = (theta - self.first) * (count / self.span)
        turns = np.floor(at / count)
        at -= count * turns
        index = np.clip(np.nan_to_num(at), 0, count - 1).astype(np.intp)
        return WheelPlaces(index, at - index, turns)

    def _look(self, table, theta):
        columns = zip(theta.T, table.T, strict=True)
        return np.stack([self.places(angle).of(values) for angle, values in columns], axis=1)

    def rolled(self, theta: np.ndarray) -> np.ndarray:
        """S(theta) of angles (t, n); NaN stays NaN."""
        columns = zip(theta.T, self.length.T, strict=True)
        return np.stack([self.places(angle).summed(values) for angle, values in columns], axis=1)

    def unrolled(self, length: np.ndarray) -> np.ndarray:
        """theta with S(theta) = `length` (t, n)."""
        out = np.empty_like(length)
        for i in range(length.shape[1]):
            turns = np.floor(length[:, i] / self.length[-1, i])
            rest = length[:, i] - turns * self.length[-1, i]
            out[:, i] = turns * self.span + np.interp(rest, self.length[:, i], self.angle)
        return out


def shape_table(rig: Rig, angle) -> np.ndarray:
    """rho (p, n) in m of every wheel at the angles (p,) rad."""
    return np.asarray(_shape(rig, jnp.asarray(angle)))


def _shape(rig: Rig, angle):
    """rho (p, n) by a program that rigs share whose laws differ elsewhere."""
    return _heights(rig.with_effects([p for p in rig.effects if p.law.port in SHAPING]), angle)


@jax.jit
def _heights(rig: Rig, angle):
    return jax.vmap(lambda a: wheel_shape(rig, jnp.full(rig.size, a)))(angle)


def wheel_tables(rig: Rig, lowest: float, highest: float) -> WheelTables:
    """Tables of the rig's wheels for angles in [`lowest`, `highest`] (rad)."""
    turn = 2 * np.pi
    probe = jnp.asarray(np.random.default_rng(0).uniform(0, turn, SETTINGS.prediction.probes))
    repeats = np.allclose(_shape(rig, probe), _shape(rig, probe + turn), atol=1e-12)
    turns = 1 if repeats else int(np.ceil((highest - lowest) / turn)) + 2
    first = 0.0 if repeats else turn * np.floor(lowest / turn) - turn
    angle = first + np.linspace(0.0, turn * turns, POINTS * turns + 1)
    shape = shape_table(rig, angle)
    radius = (np.asarray(rig.wheel_radius) + shape) / float(rig.sphere.radius)
    step = angle[1] - angle[0]
    length = np.concatenate(
        [np.zeros((1, rig.size)), np.cumsum((radius[1:] + radius[:-1]) / 2, axis=0) * step]
    )
    slope = np.gradient(shape, step, axis=0)
    return WheelTables(angle, shape, slope, length, first, turn * turns)
