"""Learned terms that push: at contacts and mounts, at the shafts, on the sphere."""

import dataclasses
from typing import ClassVar

import jax
import numpy as np

from ....laws import BodySignal, ShaftSignal
from ..._machine import (
    FINE,
    SIGNALS,
    THIN,
    Linearisation,
    forced,
    observe,
    propagate,
    rest_state,
    transfer,
    turned_by,
)
from ..._settings import SETTINGS
from .term_port import (
    AXES,
    BENDS,
    AbstractPort,
    AbstractWheelPort,
    Columns,
    cuts,
    memoryless,
    powers,
    waves,
)

ANGLE_HARMONICS = SETTINGS.answer_learned.angle_harmonics
SIGN_SHARPNESS = SETTINGS.answer_learned.sign_sharpness


@dataclasses.dataclass(frozen=True)
class SpringPort(AbstractWheelPort):
    """Contact or mount: every wheel's deflection and rate, and time in; tensions out."""

    port: str

    def hosts(self, port):
        return port == self.port or (self.port, port) == ("contact", "separation")

    def units(self, part):
        return "m", "N"

    def labels(self):
        letter = "δ" if self.port == "contact" else "Δ"
        deflections = [f"{letter} of {w}" for w in self.wheels]
        return [*deflections, *(f"rate of {x}" for x in deflections), "time"]

    def input_units(self):
        n = len(self.wheels)
        return [*n * ["m"], *n * ["m/s"], "s"]

    def inputs(self, base, felt=None):
        signals = self._signals(base)
        pair = (signals.deflection, signals.rate)
        if felt is not None:
            pair = (pair[0] + felt[0], pair[1] + felt[1])
        return np.column_stack([*pair, base.run.fine(FINE)])

    def _signals(self, base: Linearisation):
        return base.contact if self.port == "contact" else base.mount

    def columns(self, u):
        out: Columns = []
        for i in range(len(self.wheels)):
            out += [(i, label, u[:, k]) for k, label in enumerate(self.labels()[:-1])]
            out += [(i, label, x) for label, x in powers(u[:, i], u[:, -1]).items()]
        return out

    def own_functions(self, part):
        return (self.labels()[part], *BENDS)

    def push(self, base, force):
        return transfer(base, **{self.port: force}), None

    def felt(self, base, force):
        """What tensions change in the deflections and rates here, (FINE points, n) each."""
        m, step = base.modes, base.run.step / FINE
        pushed = {self.port: force}
        total = forced(m, step, len(force) - 1, **pushed)
        z = propagate(m, step, total, rest_state(m, **pushed))
        return tuple(np.split(observe(m, z, SIGNALS[self.port]), 2, axis=1))

    def of_law(self, base, placed, grid):
        if placed.law.port != self.port or grid.part not in placed.wheels:
            return None
        here = jax.tree.map(lambda x: float(np.mean(x[:, grid.part])), self._signals(base))
        return memoryless(placed.law, here._replace(deflection=grid.x, rate=0.0))


@dataclasses.dataclass(frozen=True)
class ShaftPort(AbstractWheelPort):
    """Shafts: every wheel's speed, command, sine and cosine of its angle, and time in; torques.

    A wheel's term may bend with its speed and with its command (a motor's dead zone, a gain that
    saturates or fades).
    """

    port: str = "shaft"
    laws: ClassVar[tuple[str, ...]] = ("shaft", "actuator", "command", "rolling", "kinematics")

    def units(self, part):
        return "rad/s", "N m"

    def labels(self):
        kinds = ("ω", "command", "sin θ", "cos θ")
        return [*(f"{k} of {w}" for k in kinds for w in self.wheels), "time"]

    def input_units(self):
        return [*(u for u in ("rad/s", "N m", "1", "1") for _ in self.wheels), "s"]

    def inputs(self, base, felt=None):
        s, time = base.slow, base.run.fine(FINE)[::THIN]
        return np.column_stack(
            [s.speed, base.torque[::THIN], np.sin(s.theta), np.cos(s.theta), time]
        )

    def columns(self, u):
        n, one, out = len(self.wheels), np.ones(len(u)), []
        for i, name in enumerate(self.wheels):
            w, command = u[:, i], u[:, n + i]
            own = {f"ω of {name}": w, f"command of {name}": command}
            own |= {"sign": np.tanh(SIGN_SHARPNESS * w), **powers(w, u[:, -1]), "constant": one}
            bends = cuts(command) | powers(command, u[:, -1])
            own |= {f"command, {label}": x for label, x in bends.items()}
            own |= waves(u[:, 3 * n + i], u[:, 2 * n + i], range(1, ANGLE_HARMONICS + 1))
            out += [(i, label, x) for label, x in own.items()]
        return out

    def own_functions(self, part):
        return (self.labels()[part], "sign", *BENDS)

    def like_own(self, part):
        return [*super().like_own(part), len(self.wheels) + part]

    def push(self, base, force):
        return turned_by(base, shaft=force)

    def of_law(self, base, placed, grid):
        if placed.law.port != "shaft" or grid.part not in placed.wheels:
            return None
        return memoryless(placed.law, ShaftSignal(0.0, grid.x, 0.0, 0.0))  # pyright: ignore[reportArgumentType]


@dataclasses.dataclass(frozen=True)
class SpherePort(AbstractPort):
    """The sphere as a body: its angular velocity, its attitude and time in; a torque out."""

    port: str = "sphere"
    laws: ClassVar[tuple[str, ...]] = ("sphere",)

    @property
    def parts(self):
        return tuple(f"about {a}" for a in AXES)

    def units(self, part):
        return "rad/s", "N m"

    def labels(self):
        turned = [f"R_{a}{b}" for a in AXES for b in AXES]  # body frame -> inertial frame
        return [*(f"Ω_{a}" for a in AXES), *turned, "time"]

    def input_units(self):
        return [*3 * ["rad/s"], *9 * ["1"], "s"]

    def inputs(self, base, felt=None):
        s, time = base.slow, base.run.fine(FINE)[::THIN]
        return np.column_stack([s.turning, s.attitude.reshape(len(time), 9), time])

    def scales(self, raw):
        scales = super().scales(raw)
        scales[3:12] = 1.0
        return scales

    def columns(self, u):
        speed, out = np.linalg.norm(u[:, :3], axis=1), []
        for i, axis in enumerate(AXES):
            w = u[:, i]
            own = {f"Ω_{axis}": w, "sign": np.tanh(SIGN_SHARPNESS * w), f"|Ω| Ω_{axis}": speed * w}
            own |= powers(w, u[:, -1]) | {f"Ω_{a}": u[:, k] for k, a in enumerate(AXES)}
            own |= {label: u[:, 3 + k] for k, label in enumerate(self.labels()[3:12])}
            out += [(i, label, x) for label, x in own.items()]
        return out

    def own_functions(self, part):
        return (self.labels()[part], "sign", f"|Ω| {self.labels()[part]}", *BENDS)

    def push(self, base, force):
        return turned_by(base, opposing=-force)

    def of_law(self, base, placed, grid):
        if placed.law.port != "sphere":
            return None
        turning = grid.x[:, None] * np.eye(3)[grid.part]
        still = np.broadcast_to(np.eye(3), (len(turning), 3, 3))
        signal = BodySignal(turning, still, float(base.rig.sphere.mass), 0 * turning)  # pyright: ignore[reportArgumentType]
        torque = memoryless(placed.law, signal)
        return None if torque is None else torque[:, grid.part]
