"""The next run of a machine: the input among a few under which rivals differ most."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from ...._errors import RunError
from ....machine import free_run
from ..._answer import APART, AbstractProposed, weaker
from ..._search import Point
from ..._settings import SETTINGS
from .._rows import OdeRun
from ..model import OdeModel

SECONDS = SETTINGS.free_experiment.seconds
SINE_RATE = SETTINGS.free_experiment.sine_rate
CHIRP = SETTINGS.free_experiment.chirp
WRITTEN = SETTINGS.experiment.written


def inputs_of(top: float, time: np.ndarray) -> dict[str, np.ndarray]:
    """Inputs (t,) up to the size that the runs have shown."""
    T, (begin, end) = time[-1], CHIRP
    chirp = np.sin(2 * np.pi * (begin * time + (end - begin) * time**2 / (2 * T)))
    slow = np.sin(2 * np.pi * SINE_RATE * time)
    return {
        "a slow sine at full size": top * slow,
        "a slow sine at a fifth of the size": top / 5 * slow,
        f"a sine from {begin:g} to {end:g} Hz at full size": top * chirp,
        "steps up and down at half size": 0.5 * top * np.sign(slow),
    }


@dataclasses.dataclass(frozen=True)
class _Proposed(AbstractProposed):
    """A free run from rest under inputs that were not given yet."""

    model: OdeModel
    run: OdeRun  # whose step, hold and measured output it has
    inputs: Mapping[str, np.ndarray]

    def rows(self, points):
        thetas = np.stack([self.model.numbers.vector(p) for p in points])
        only = self.model.numbers.active(thetas)  # no other law is worth its time
        noise = np.median(self.model.noise)
        return [self._measured(*self.model.numbers.build(x, only)) / noise for x in thetas]

    def _measured(self, machine, placed) -> np.ndarray:
        """The measured output (t,)."""
        run = self.run
        rest = {"position": (float(run.outputs["position"][0]), 0.0)}
        try:
            made = free_run(machine, placed, rest, self.inputs, run.step, run.hold)
        except RunError:  # as one that runs away
            return np.full(len(next(iter(self.inputs.values()))), np.nan)
        return made[run.measured]


def next_run(model: OdeModel, rivals: Sequence[Point]) -> dict | None:
    """The input whose worst pair of `rivals` lies farthest apart.

    An input under which some rival runs away is made smaller; `None` where none is left.
    """
    train = model.measured.of("train")
    run = train[0]
    time = np.arange(0.0, SECONDS, run.step)
    top = max(float(np.max(np.abs(r.inputs["input"]))) for r in train)
    others = {k: np.full(len(time), x[0]) for k, x in run.inputs.items() if k != "input"}
    rows, tried = [], {}
    for words, values in inputs_of(top, time).items():
        for said, share in weaker(words, "smaller"):
            proposed = _Proposed(model, run, {"input": share * values, **others})
            separation = proposed.separation(rivals)
            if separation is not None:
                rows.append({"drive": said, "separation": separation})
                tried[said] = share * values
                break
    if not rows:
        return None
    best = max(rows, key=lambda r: r["separation"])
    values = tried[best["drive"]]
    thin = max(1, round(WRITTEN / run.step))
    shown = {"unit": next(iter(model.machine.inputs.values())), "step": thin * run.step,
             "values": values[::thin, None].tolist()}  # fmt: skip
    return {**best, "unit": APART, "torque": shown, "compared": rows}
