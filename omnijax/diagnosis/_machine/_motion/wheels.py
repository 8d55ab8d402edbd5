"""Wheel shapes as tables over the angle: rho, the rolled length S(theta), and its inverse."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ...._programs import kept
from ....dynamics import wheel_shape
from ....rig import Rig
from ..._settings import SETTINGS
from .._laws import radii

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

    One turn where the shape repeats, else as many turns as the runs cover.  Points lie evenly, but
    the nearest to each edge and middle of a gap lies there: a corner between two points would be
    cut off, which a slow wheel passes for so long that it is felt.  There the slope jumps, from the
    end of one cell between two points to the begin of the next.  A wheel's own numbers lie side by
    side in memory: of many turns they are millions, of which an angle asks for two.
    """

    angle: np.ndarray  # (p, n) rad
    shape: np.ndarray  # (p, n)
    slope: np.ndarray  # (2, p - 1, n) m/rad, at the begin and at the end of every cell
    length: np.ndarray  # (p, n)
    first: float  # rad, angle of the table's start
    span: float  # rad, length of the table

    @property
    def cell(self) -> float:
        """Distance of two points that lie evenly, rad."""
        return self.span / (len(self.angle) - 1)

    def first_turn(self) -> "WheelTables":
        """The first turn alone: enough for what is the same in each."""
        last = POINTS + 1
        return self._replace(
            angle=self.angle[:last], shape=self.shape[:last], slope=self.slope[:, :POINTS],
            length=self.length[:last], span=2 * np.pi,
        )  # fmt: skip

    def rho(self, theta: np.ndarray) -> np.ndarray:
        """Shape at angles (t, n), m."""
        places = (self.places(angle, i) for i, angle in enumerate(theta.T))
        values = zip(places, self.shape.T, strict=True)
        return np.stack([at.of(table) for at, table in values], axis=1)

    def rho_slope(self, theta: np.ndarray) -> np.ndarray:
        """d rho/d theta at angles (t, n)."""
        out = np.empty_like(theta)
        for i, angle in enumerate(theta.T):
            at, (begin, end) = self.places(angle, i), self.slope[:, :, i]
            here = begin[at.index]
            out[:, i] = here + at.share * (end[at.index] - here)
        return out

    def places(self, theta: np.ndarray, wheel: int) -> WheelPlaces:
        """Where angles (t,) of a wheel lie in its tables; those of NaN have a share of NaN."""
        points, last = self.angle[:, wheel], len(self.angle) - 2
        turns = np.floor((theta - self.first) / self.span)
        here = theta - turns * self.span
        even = np.nan_to_num((here - self.first) / self.cell)
        index = np.clip(even, 0, last).astype(np.intp)
        # no point lies further than half a cell from where it were if all lay evenly
        index += (here >= points[index + 1]) & (index < last)
        index -= here < points[index]
        before = points[index]
        return WheelPlaces(index, (here - before) / (points[index + 1] - before), turns)

    def rolled(self, theta: np.ndarray) -> np.ndarray:
        """S(theta) of angles (t, n); NaN stays NaN."""
        places = (self.places(angle, i) for i, angle in enumerate(theta.T))
        lengths = zip(places, self.length.T, strict=True)
        return np.stack([at.summed(values) for at, values in lengths], axis=1)

    def unrolled(self, length: np.ndarray) -> np.ndarray:
        """theta with S(theta) = `length` (t, n)."""
        out = np.empty_like(length)
        for i in range(length.shape[1]):
            turns = np.floor(length[:, i] / self.length[-1, i])
            rest = length[:, i] - turns * self.length[-1, i]
            out[:, i] = turns * self.span + np.interp(rest, self.length[:, i], self.angle[:, i])
        return out


def shape_table(rig: Rig, angle) -> np.ndarray:
    """rho (p, n) in m of every wheel at its angles (p, n) in rad."""
    return np.asarray(_shape(rig, jnp.asarray(angle)))


def _shape(rig: Rig, angle):
    """rho (p, n) by a program that rigs share whose laws differ elsewhere."""
    return _heights(rig.with_effects([p for p in rig.effects if p.law.port in SHAPING]), angle)


@kept
def _heights(rig: Rig, angle):
    return jax.vmap(lambda a: wheel_shape(rig, a))(angle)


def wheel_tables(rig: Rig, lowest: float, highest: float) -> WheelTables:
    """Tables of the rig's wheels for angles in [`lowest`, `highest`] (rad)."""
    turn, n = 2 * np.pi, rig.size
    probe = np.random.default_rng(0).uniform(0, turn, (SETTINGS.prediction.probes, 1))
    probe = jnp.asarray(np.tile(probe, n))
    repeats = np.allclose(_shape(rig, probe), _shape(rig, probe + turn), atol=1e-12)
    turns = 1 if repeats else int(np.ceil((highest - lowest) / turn)) + 2
    first = 0.0 if repeats else turn * np.floor(lowest / turn) - turn
    even = first + np.linspace(0.0, turn * turns, POINTS * turns + 1)
    angle = np.array([with_corners(even, corners) for corners in _corners(rig)]).T
    shape = np.asfortranarray(shape_table(rig, angle))
    radius = (radii(rig) + shape) / float(rig.sphere.radius)
    rolled = (radius[1:] + radius[:-1]) / 2 * np.diff(angle, axis=0)
    length = np.zeros_like(angle)
    np.cumsum(rolled, axis=0, out=length[1:])
    return WheelTables(angle, shape, slopes(angle, shape), length, first, turn * turns)


def slopes(angle: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Slope (2, p - 1, n) of tables (p, n) at the begin and the end of every cell.

    A cell's curvature is the lesser of those towards its neighbours: across a corner it would be
    that of another curve.
    """
    width = np.diff(angle, axis=0)
    mean = np.diff(shape, axis=0) / width
    bend = np.diff(mean, axis=0) / ((width[1:] + width[:-1]) / 2)
    before, after = np.concatenate([bend[:1], bend]), np.concatenate([bend, bend[-1:]])
    half = np.where(np.abs(before) < np.abs(after), before, after) * width / 2
    return np.array([(mean - half).T, (mean + half).T]).transpose(0, 2, 1)


def _corners(rig: Rig) -> list[np.ndarray]:
    """By wheel the angles (k,) in the first turn where a gap begins, is deepest or ends, rad."""
    pitches, widths = np.asarray(rig.gaps.pitch), np.asarray(rig.gaps.width)
    out = []
    for pitch, width in zip(pitches, widths, strict=True):
        first = np.arange(np.ceil(2 * np.pi / pitch)) * pitch
        out.append((first[:, None] + width * np.array([0.0, 0.5, 1.0])).ravel())
    return out


def with_corners(even: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Even points (p,), those that lie nearest to corners (k,) of every turn moved there."""
    cell, points = even[1] - even[0], even.copy()
    turns = np.arange(np.round((even[-1] - even[0]) / (2 * np.pi))) * 2 * np.pi + even[0]
    at = (turns[:, None] + corners).ravel()
    nearest = np.round((at - even[0]) / cell).astype(int)
    inner = (nearest > 0) & (nearest < len(even) - 1)
    points[nearest[inner]] = at[inner]
    return points
