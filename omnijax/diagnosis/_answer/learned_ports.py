"""Where a learned term may act: what it feels there, and what its output changes.

A term's output is one force (or torque) a wheel.  Its inputs are scaled to RMS 1 over the train
runs; `own(i)` is the input that is wheel i's own.
"""

import dataclasses

import numpy as np

from .._machine import (
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
from .._settings import SETTINGS

WAVES = SETTINGS.answer_learned.waves
SHARP = SETTINGS.answer_learned.sharp
Columns = list[tuple[int, str, np.ndarray]]  # (wheel, label, values)


def powers(x: np.ndarray, time: np.ndarray) -> dict[str, np.ndarray]:
    """Smooth functions of one wheel's own input, and its product with time.

    Products: NumPy's general power takes ten times as long.
    """
    square = x * x
    cube = square * x
    return {
        "square": square,
        "cube": cube,
        "|x| x": np.abs(x) * x,
        "fifth": cube * square,
        "times t": x * time,
    }


@dataclasses.dataclass(frozen=True)
class SpringPort:
    """Contact or mount: every wheel's deflection and rate, and time in; tensions out."""

    port: str
    wheels: tuple[str, ...]
    unit: str = "N"
    own_unit: str = "m"

    def own(self, i: int) -> int:
        """Index of wheel i's deflection."""
        return i

    def labels(self) -> list[str]:
        """Names of the inputs."""
        letter = "δ" if self.port == "contact" else "Δ"
        deflections = [f"{letter} of {w}" for w in self.wheels]
        return [*deflections, *(f"rate of {x}" for x in deflections), "time"]

    def inputs(self, base: Linearisation, felt=None) -> np.ndarray:
        """Inputs (FINE points, 2 n + 1), not scaled; `felt` is what the term itself adds."""
        signals = base.contact if self.port == "contact" else base.mount
        pair = (signals.deflection, signals.rate)
        if felt is not None:
            pair = (pair[0] + felt[0], pair[1] + felt[1])
        return np.column_stack([*pair, base.run.fine(FINE)])

    def columns(self, u: np.ndarray) -> Columns:
        """The smooth basis: every input, and powers of a wheel's own."""
        out: Columns = []
        for i in range(len(self.wheels)):
            out += [(i, label, u[:, k]) for k, label in enumerate(self.labels()[:-1])]
            out += [(i, label, x) for label, x in powers(u[:, i], u[:, -1]).items()]
        return out

    def push(self, base: Linearisation, force: np.ndarray):
        """dR and a (samples, 6) of tensions (FINE points, n), from their static rest."""
        return transfer(base, **{self.port: force}), None

    def felt(self, base: Linearisation, force: np.ndarray):
        """What tensions change in the deflections and rates here, (FINE points, n) each."""
        m, step = base.modes, base.run.step / FINE
        pushed = {self.port: force}
        total = forced(m, step, len(force) - 1, **pushed)
        z = propagate(m, step, total, rest_state(m, **pushed))
        return tuple(np.split(observe(m, z, SIGNALS[self.port]), 2, axis=1))


@dataclasses.dataclass(frozen=True)
class ShaftPort:
    """Shafts: every wheel's speed, command, sine and cosine of its angle, and time in; torques."""

    wheels: tuple[str, ...]
    port: str = "shaft"
    unit: str = "N m"
    own_unit: str = "rad/s"

    def own(self, i: int) -> int:
        """Index of wheel i's speed."""
        return i

    def labels(self) -> list[str]:
        """Names of the inputs."""
        kinds = ("ω", "command", "sin θ", "cos θ")
        return [*(f"{k} of {w}" for k in kinds for w in self.wheels), "time"]

    def inputs(self, base: Linearisation, felt=None) -> np.ndarray:
        """Inputs (thinned points, 4 n + 1), not scaled; the motion is the measured one."""
        s = base.slow
        assert s is not None
        time = base.run.fine(FINE)[::THIN]
        return np.column_stack(
            [s.speed, base.torque[::THIN], np.sin(s.theta), np.cos(s.theta), time]
        )

    def columns(self, u: np.ndarray) -> Columns:
        """The smooth basis: speed with powers and sign, command, harmonics of the angle."""
        n, one, out = len(self.wheels), np.ones(len(u)), []
        for i, name in enumerate(self.wheels):
            w, wave = u[:, i], u[:, 3 * n + i] + 1j * u[:, 2 * n + i]
            own = {f"ω of {name}": w, f"command of {name}": u[:, n + i], "constant": one}
            own |= powers(w, u[:, -1]) | {"sign": np.tanh(SHARP * w)}
            for k in range(1, WAVES + 1):
                own |= {f"sin {k}θ": (wave**k).imag, f"cos {k}θ": (wave**k).real}
            out += [(i, label, x) for label, x in own.items()]
        return out

    def push(self, base: Linearisation, force: np.ndarray):
        """Both tables of shaft torques at thinned points."""
        return turned_by(base, shaft=force)

    def felt(self, base: Linearisation, force: np.ndarray) -> None:
        """Nothing: shafts feel the measured motion."""
