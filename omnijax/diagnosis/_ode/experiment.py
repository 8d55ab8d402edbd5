"""The next run of a machine: the input among a few under which rivals differ most."""

import itertools

import numpy as np

from ...machine import free_run
from .._settings import SETTINGS
from .model import OdeModel

SECONDS = SETTINGS.free_experiment.seconds


def inputs_of(top: float, time: np.ndarray) -> dict[str, np.ndarray]:
    """Inputs (t,) up to the size that the runs have shown."""
    T = time[-1]
    chirp = np.sin(2 * np.pi * (0.1 * time + (2.0 - 0.1) * time**2 / (2 * T)))
    slow = np.sin(2 * np.pi * 0.2 * time)
    return {
        "a slow sine at full size": top * slow,
        "a slow sine at a fifth of the size": 0.2 * top * slow,
        "a sine from 0.1 to 2 Hz at full size": top * chirp,
        "steps up and down at half size": 0.5 * top * np.sign(slow),
    }


def next_run(model: OdeModel, rivals) -> dict:
    """The input whose worst pair of rivals lies farthest apart, in sigma of what is measured."""
    train = model.measured.of("train")
    run = train[0]
    time = np.arange(0.0, SECONDS, run.step)
    top = max(float(np.max(np.abs(r.inputs["input"]))) for r in train)
    built = [model.numbers.build(model.numbers.vector(p)) for p in rivals]
    rest = {"position": (float(run.outputs["position"][0]), 0.0)}
    others = {k: np.full(len(time), x[0]) for k, x in run.inputs.items() if k != "input"}
    rows, tried = [], inputs_of(top, time)
    for words, values in tried.items():
        seen = [
            free_run(m, placed, rest, {"input": values, **others}, run.step, run.hold)[run.measured]
            for m, placed in built
        ]
        apart = [
            float(np.sum(((a - b) / model.noise) ** 2)) for a, b in itertools.combinations(seen, 2)
        ]
        finite = [x for x in apart if np.isfinite(x)]
        rows.append({"drive": words, "separation": min(finite, default=0.0)})
    best = max(rows, key=lambda r: r["separation"])
    values = tried[best["drive"]]
    thin = max(1, round(0.02 / run.step))
    unit = "chi-square between the closest two rivals"
    shown = {"unit": next(iter(model.machine.inputs.values())), "step": thin * run.step,
             "values": values[::thin, None].tolist()}  # fmt: skip
    return {**best, "unit": unit, "torque": shown, "compared": rows}
