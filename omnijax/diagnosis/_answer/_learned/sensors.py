"""Learned terms of the sensors: what a channel shows beside what it should."""

import dataclasses
from typing import ClassVar

import numpy as np

from ....dynamics import sensor_readings
from ....laws import AbstractSensor
from ..._machine import encoder_shifted
from ..._settings import SETTINGS
from ..channels import channel_index
from ..gap import UNITS
from .term_port import AXES, BENDS, POINTS, AbstractPort, TermGrid, cuts, powers, waves

ANGLE_HARMONICS = SETTINGS.answer_learned.angle_harmonics
MOVING = ("dR", "a", "Omega")  # groups of three axes
ANGLES = 2 * len(MOVING) * len(AXES)  # inputs before those of the wheels' angles


@dataclasses.dataclass(frozen=True)
class SensorPort(AbstractPort):
    """Sensors: all they are given with its rate, and time in; what a channel shows beside it out.

    It is given what the machine does: of a reading at its limit nothing tells how far beyond that
    is.  An encoder's own input is its wheel's angle.  `channels` are those that were measured, of
    `size` wheels.
    """

    channels: tuple[str, ...]
    size: int
    port: str = "sensor"
    laws: ClassVar[tuple[str, ...]] = ("sensor",)
    networked: ClassVar[bool] = False

    @property
    def parts(self):
        return self.channels

    def units(self, part):
        unit = UNITS[self.channels[part].partition("_")[0]]
        return unit, unit

    def own(self, part):
        group, at = self.channels[part].partition("_")[0], channel_index(self.channels[part])
        return ANGLES + at if group == "theta" else 3 * MOVING.index(group) + at

    def labels(self):
        shown = [f"{g}_{a}" for g in MOVING for a in AXES]
        angles = [f"{k} θ_{i + 1}" for k in ("sin", "cos") for i in range(self.size)]
        return [*shown, *(f"rate of {x}" for x in shown), *angles, "time"]

    def input_units(self):
        shown = [UNITS[g] for g in MOVING for _ in AXES]
        return [*shown, *(f"{u}/s" for u in shown), *2 * self.size * ["1"], "s"]

    def inputs(self, base, felt=None):
        given = np.concatenate([base.true[g] for g in MOVING], axis=1)
        rates, theta = np.gradient(given, base.run.step, axis=0), base.true["theta"]
        return np.column_stack([given, rates, np.sin(theta), np.cos(theta), base.run.time])

    def scales(self, raw):
        scales = super().scales(raw)
        scales[ANGLES:-1] = 1.0
        return scales

    def columns(self, u):
        one, out = np.ones(len(u)), []
        for i, channel in enumerate(self.channels):
            k = self.own(i)
            if channel.startswith("theta"):
                own = waves(u[:, k + self.size], u[:, k], range(1, ANGLE_HARMONICS + 1))
            else:
                x, group = u[:, k], 3 * (k // 3)
                beside = {f"{channel.partition('_')[0]}_{a}": u[:, group + j]
                          for j, a in enumerate(AXES)}  # fmt: skip
                own = {"constant": one, **beside, f"rate of {channel}": u[:, 9 + k],
                       "|x|": np.abs(x), **powers(x, u[:, -1])}  # fmt: skip
            out += [(i, label, x) for label, x in own.items()]
        return out

    def own_functions(self, part):
        channel = self.channels[part]
        return () if channel.startswith("theta") else (channel, "|x|", *BENDS)

    def own_bends(self, part, u):
        return {} if self.channels[part].startswith("theta") else cuts(u[:, self.own(part)])

    def push(self, base, force):
        change = {g: np.zeros((base.run.samples, 3)) for g in MOVING}
        change["theta"] = np.zeros((base.run.samples, self.size))
        for i, channel in enumerate(self.channels):
            change[channel.partition("_")[0]][:, channel_index(channel)] = force[:, i]
        elastic = np.concatenate([change["dR"], change["a"]], axis=1)
        rotation = np.concatenate([change["Omega"], 0 * change["theta"]], axis=1)
        if change["theta"].any():
            shifted, longer = encoder_shifted(base, change["theta"])
            elastic, rotation = elastic + shifted, rotation + longer
        return elastic, rotation

    def grid(self, part, scales, over=None):
        if not self.channels[part].startswith("theta"):
            return super().grid(part, scales, over)
        angle, k = np.linspace(0, 2 * np.pi, POINTS), self.own(part)
        return TermGrid(part, angle, {k: np.sin(angle), k + self.size: np.cos(angle)})

    def of_law(self, base, placed, grid):
        channel, law = self.channels[grid.part], placed.law
        group, at = channel.partition("_")[0], channel_index(channel)
        assert isinstance(law, AbstractSensor)
        momentary = law.momentary or (group == "theta" and not law.remembers)
        if placed.place not in (group, channel) or not momentary:
            return None
        values = np.zeros((len(grid.x), self.size if group == "theta" else 3))
        values[:, at] = grid.x
        alone = base.rig.with_effects((placed,))
        return np.asarray(sensor_readings(alone, group, 0 * grid.x, values) - values)[:, at]
