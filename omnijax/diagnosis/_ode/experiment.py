"""The next run of a machine: the input among a few under which rivals differ most."""

import itertools

import numpy as np

from ...machine import free_run
from .._answer import weaker
from .._settings import SETTINGS
from .model import OdeModel

SECONDS = SETTINGS.free_experiment.seconds
SLOW = SETTINGS.free_experiment.slow
CHIRP = SETTINGS.free_experiment.chirp
WRITTEN = SETTINGS.free_experiment.written


def inputs_of(top: float, time: np.ndarray) -> dict[str, np.ndarray]:
    """Inputs (t,) up to the size that the runs have shown."""
    T, (begin, end) = time[-1], CHIRP
    chirp = np.sin(2 * np.pi * (begin * time + (end - begin) * time**2 / (2 * T)))
    slow = np.sin(2 * np.pi * SLOW * time)
    return {
        "a slow sine at full size": top * slow,
        "a slow sine at a fifth of the size": top / 5 * slow,
        f"a sine from {begin:g} to {end:g} Hz at full size": top * chirp,
        "steps up and down at half size": 0.5 * top * np.sign(slow),
    }


def next_run(model: OdeModel, rivals) -> dict | None:
    """The input whose worst pair of rivals lies farthest apart, in sigma of what is measured.

    An input under which some rival runs away is made smaller; `None` where none is left.
    """
    train = model.measured.of("train")
    run = train[0]
    time = np.arange(0.0, SECONDS, run.step)
    top = max(float(np.max(np.abs(r.inputs["input"]))) for r in train)
    built = [model.numbers.build(model.numbers.vector(p)) for p in rivals]
    rest = {"position": (float(run.outputs["position"][0]), 0.0)}
    others = {k: np.full(len(time), x[0]) for k, x in run.inputs.items() if k != "input"}

    def apart(values: np.ndarray) -> float:
        """The separation of the closest two under an input; not finite where one runs away."""
        seen = [
            free_run(m, placed, rest, {"input": values, **others}, run.step, run.hold)[run.measured]
            for m, placed in built
        ]
        if not all(np.isfinite(x).all() for x in seen):
            return np.inf
        pairs = itertools.combinations(seen, 2)
        return min(float(np.sum(((a - b) / model.noise) ** 2)) for a, b in pairs)

    rows, tried = [], {}
    for words, values in inputs_of(top, time).items():
        for said, share in weaker(words, "smaller"):
            separation = apart(share * values)
            if np.isfinite(separation):
                rows.append({"drive": said, "separation": separation})
                tried[said] = share * values
                break
    if not rows:
        return None
    best = max(rows, key=lambda r: r["separation"])
    values = tried[best["drive"]]
    thin = max(1, round(WRITTEN / run.step))
    unit = "chi-square between the closest two rivals"
    shown = {"unit": next(iter(model.machine.inputs.values())), "step": thin * run.step,
             "values": values[::thin, None].tolist()}  # fmt: skip
    return {**best, "unit": unit, "torque": shown, "compared": rows}
