"""Learned terms of shape: of the wheels, and of the sphere's surface."""

import dataclasses
from collections.abc import Callable
from typing import ClassVar

import jax
import numpy as np

from ..._machine import FINE, SHAPE, contact_directions, refine, reshaped, shape_along, transfer
from ..._settings import SETTINGS
from .term_port import AXES, POINTS, AbstractPort, AbstractWheelPort, TermGrid, memoryless, waves

SHAPE_HARMONICS = SETTINGS.answer_learned.shape_harmonics


@dataclasses.dataclass(frozen=True)
class ShapePort(AbstractWheelPort):
    """Wheels' shapes: sine and cosine of every wheel's angle in, change of its radius out.

    Harmonics up to the pitch of its gaps, `pitches` of a turn, and twice that.
    """

    pitches: tuple[int, ...]
    port: str = "shape"
    laws: ClassVar[tuple[str, ...]] = ("shape", "radius")
    networked: ClassVar[bool] = False

    def units(self, part):
        return "rad", "m"

    def labels(self):
        return [f"{k} of {w}" for k in ("sin θ", "cos θ") for w in self.wheels]

    def input_units(self):
        return 2 * len(self.wheels) * ["1"]

    def inputs(self, base, felt=None):
        angle = base.one_turn.tables.angle
        return np.column_stack([np.sin(angle), np.cos(angle)])

    def scales(self, raw):
        return np.ones(raw.shape[1])

    def columns(self, u):
        n, out = len(self.wheels), []
        for i, pitches in enumerate(self.pitches):
            orders = sorted({*range(1, SHAPE_HARMONICS + 1), pitches, 2 * pitches})
            own = waves(u[:, n + i], u[:, i], orders)
            out += [(i, label, x) for label, x in own.items()]
        return out

    def push(self, base, force):
        return reshaped(base.one_turn, force, force)

    def grid(self, part, scales, over=None):
        angle = np.linspace(0, 2 * np.pi, 4 * POINTS)
        return TermGrid(part, angle, {part: np.sin(angle), len(self.wheels) + part: np.cos(angle)})

    def of_law(self, base, placed, grid):
        if placed.law.port != "shape" or grid.part not in placed.wheels:
            return None
        gap = jax.tree.map(lambda x: x[grid.part], base.rig.gaps)
        return shape_along(placed.law, grid.x, gap)


SURFACE: tuple[tuple[str, Callable[..., np.ndarray]], ...] = (
    ("x", lambda x, y, z: x), ("y", lambda x, y, z: y), ("z", lambda x, y, z: z),
    ("x y", lambda x, y, z: x * y), ("y z", lambda x, y, z: y * z),
    ("z x", lambda x, y, z: z * x), ("x² - y²", lambda x, y, z: x * x - y * y),
    ("3 z² - 1", lambda x, y, z: 3 * z * z - 1),
    ("y (3 x² - y²)", lambda x, y, z: y * (3 * x * x - y * y)),
    ("x (x² - 3 y²)", lambda x, y, z: x * (x * x - 3 * y * y)),
    ("z (x² - y²)", lambda x, y, z: z * (x * x - y * y)), ("x y z", lambda x, y, z: x * y * z),
    ("x (5 z² - 1)", lambda x, y, z: x * (5 * z * z - 1)),
    ("y (5 z² - 1)", lambda x, y, z: y * (5 * z * z - 1)),
    ("z (5 z² - 3)", lambda x, y, z: z * (5 * z * z - 3)),
)  # fmt: skip
"""Spherical harmonics of degree 1 to 3 of a unit vector, not normalised."""


@dataclasses.dataclass(frozen=True)
class SurfacePort(AbstractPort):
    """The sphere's surface: the direction to each contact in its body frame in, a height out."""

    wheels: tuple[str, ...]
    port: str = "surface"
    laws: ClassVar[tuple[str, ...]] = ("surface",)
    networked: ClassVar[bool] = False

    @property
    def parts(self):
        return ("sphere",)

    def units(self, part):
        return "rad from x to y", "m"

    def labels(self):
        return list(AXES)

    def input_units(self):
        return 3 * ["1"]

    def inputs(self, base, felt=None):
        return contact_directions(base.rig, base.motion).reshape(-1, 3)

    def scales(self, raw):
        return np.ones(raw.shape[1])

    def columns(self, u):
        return [(0, label, f(*u.T)) for label, f in SURFACE]

    def push(self, base, force):
        height = force.reshape(-1, len(self.wheels))
        return transfer(base, shape=refine(height, SHAPE // FINE)), None

    def grid(self, part, scales, over=None):
        angle = np.linspace(0, 2 * np.pi, 4 * POINTS)
        return TermGrid(0, angle, {0: np.cos(angle), 1: np.sin(angle), 2: 0 * angle})

    def of_law(self, base, placed, grid):
        directions = np.column_stack([grid.varied[k] for k in range(3)])
        return memoryless(placed.law, directions) if placed.law.port == "surface" else None
