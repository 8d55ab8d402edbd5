"""A machine of a few states as evidence: groups, places, free runs, the learned term."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...._errors import RunError
from ....laws import one_a_place
from ....machine import (
    Axis,
    MachineFile,
    PlacedLaw,
    axis_unit,
    free_run,
    machine_text,
    with_numbers,
)
from ..._answer import AbstractEvidence
from ..._noise import Assumed
from ..._search import Point, discovered, number
from ..._settings import SETTINGS
from .._rows import Balance, OdeRun, Rows, smoothed
from ..model import OdeModel
from .learned import learn_shaft

REST_RATIO = SETTINGS.free_evidence.rest_ratio


class OdeEvidence(AbstractEvidence):
    """An `OdeModel` with its held-out runs."""

    model: OdeModel
    closing = SETTINGS.free_evidence.closing
    alike = SETTINGS.free_evidence.size_tolerance

    def __init__(self, model: OdeModel, file: MachineFile, noise: Sequence[Assumed],
                 remarks: list[str], faults: list[str], blocks: bool):  # fmt: skip
        self.model, self.file, self.faults = model, file, faults
        self.noise = {self.group: noise_of_rows(model, noise)}
        self.said, self.confirmed_on = remarks, "blocks" if blocks else "held-out"

    @property
    def group(self) -> str:
        """The output group that is compared."""
        return self.model.measured.rows[0].group

    @property
    def measured(self) -> str:
        """The output that was measured: position or velocity."""
        return self.model.measured.runs[0].measured

    def unit_of(self, group):
        unit, rated = self.file.machine.outputs[self.measured], self.group == "acceleration"
        if self.measured == "velocity":
            return unit + ("^2" if rated else "")
        return unit + ("/s^2" if rated else "")

    def columns(self, residual, split):
        repeated = self.model.row_noise.inflation
        return [{self.group: x * np.sqrt(repeated)} for x in self.model.by_run(residual, split)]

    def sigma(self, channel, split, run):
        return float(self.model.row_noise.sigma[self.model.measured.splits[split][run]])

    def steps(self, split):
        data = self.model.measured
        return [float(np.mean(np.diff(data.rows[i].time))) for i in data.splits[split]]

    def series(self, residual):
        run, rows = self._first_held_out()
        return run.name, rows.time, self.columns(residual, "held-out")[0]

    def _first_held_out(self) -> tuple[OdeRun, Rows]:
        data = self.model.measured
        i = data.splits["held-out"][0]
        return data.runs[i], data.rows[i]

    def locate(self, point, split="held-out", run=0):
        (residual,) = self.model.residuals([point], split)
        columns, i = self.columns(residual, split)[run], self.model.measured.splits[split][run]
        measured, rows = self.model.measured.runs[i], self.model.measured.rows[i]
        time = rows.time
        q, v, _ = smoothed(measured.outputs["position"], measured.step, measured.cutoff)

        def here(x):
            return np.interp(time, measured.time, x)

        if isinstance(rows, Balance) is False and len(np.unique(np.diff(time).round(9))) > 1:
            grid = np.linspace(time[0], time[-1], len(time))
            columns, time = {k: np.interp(grid, time, x) for k, x in columns.items()}, grid
        states = {
            "time s": time, "speed axis": np.abs(here(v)), "direction axis": np.sign(here(v)),
            "position axis": here(q), "load axis": here(measured.inputs["input"]),
        }  # fmt: skip
        travel = float(np.ptp(q)) or 1.0
        return discovered(time, columns, {"travel": 2 * np.pi * here(q) / travel}, states)

    def learn(self, fit, scores, tell):
        return learn_shaft(self.model, fit, scores, tell)

    def experiment(self, rivals):
        from .experiment import next_run

        return next_run(self.model, rivals)

    def described(self, point):
        """The machine's file with calibrated numbers and the effects of a point."""
        theta = self.model.numbers.vector(point)
        machine, _ = self.model.numbers.build(theta)
        placed = [
            PlacedLaw(self.model.laws[e.id](**{k: number(v) for k, v in e.values.items()}), e.place)
            for e in point.effects
        ]
        file = with_numbers(self.file, machine)
        return dataclasses.replace(file, placed=one_a_place((*self.file.placed, *placed)))

    def text(self, described):
        return machine_text(described)

    def remarks(self):
        return list(self.said)

    def unit(self, unit, place, key=""):
        slides = self.file.machine.outputs[self.measured] in ("m", "m/s")
        return axis_unit(unit, "translation" if slides else "rotation", key)

    def free_runs(self, points: dict[str, Point]) -> list[dict[str, Any]]:
        """Simulation from the first sample of every run: RMS, MAE and share, by point."""
        out = []
        for run, noise in zip(self.model.measured.runs, self.model.noise, strict=True):
            unit = self.file.machine.outputs[run.measured]
            entry: dict[str, Any] = {"run": run.name, "role": run.role, "unit": unit}
            moved = float(np.std(run.shown))
            for word, point in points.items():
                error = missed_output(self.model, point, run)
                finite = bool(np.all(np.isfinite(error)))
                entry[word] = {
                    "rms": float(np.sqrt(np.mean(error**2))) if finite else None,
                    "mae": float(np.mean(np.abs(error))) if finite else None,
                    "percent": 100 * float(np.std(error)) / moved
                    if finite and moved > REST_RATIO * noise
                    else None,
                }
            out.append(entry)
        return out

    def one_step(self, point: Point) -> float | None:
        """Per cent of the input that the balance misses on held-out runs; None without one."""
        if self.model.steps_in_time:
            return None
        return balance_error(self.model, point, "held-out")


def noise_of_rows(model: OdeModel, noise: Sequence[Assumed]) -> dict[str, Any]:
    """{sigma, error, source, declared} of the rows of held-out runs, RMS over these runs.

    `noise` is that of what was measured, by run; a sigma that what no law explains has raised is
    still no declared one.
    """
    rows, held = model.measured.rows, model.measured.splits["held-out"]
    told = [x * rows[i].gain() for i in held if (x := noise[i].declared) is not None]
    return {
        "sigma": float(np.sqrt(np.mean(model.row_noise.sigma[held] ** 2))),
        "error": max(noise[i].error for i in held),
        "source": ", ".join(dict.fromkeys(noise[i].source for i in held)),
        "declared": float(np.sqrt(np.mean(np.square(told)))) if told else None,
    }


def missed_output(model: OdeModel, point: Point, run: OdeRun) -> np.ndarray:
    """Measured less simulated output (t,) of a run, from its first sample and inputs alone.

    Not finite where the machine runs away, or cannot be followed.
    """
    q, theta = run.outputs["position"], model.numbers.vector(point)
    _, v, _ = smoothed(q, run.step, run.cutoff)
    only = model.numbers.active(theta[None])  # no other law is worth its time
    machine, placed = model.numbers.build(theta, only)
    start = {"position": (q[0], v[0])}
    try:
        made = free_run(machine, placed, start, run.inputs, run.step, run.hold)
    except RunError:
        return np.full(len(run.shown), np.nan)
    return run.shown - made[run.measured]


def balance_error(model: OdeModel, point: Point, split: str) -> float:
    """RMS of inertia times the missed acceleration, in per cent of the motor's torque."""
    theta = model.numbers.vector(point)
    machine, _ = model.numbers.build(theta)
    assert isinstance(machine, Axis)
    rest = model.raw([point], split)[0]
    torque = []
    for i in model.measured.splits[split]:
        rows = model.measured.rows[i]
        assert isinstance(rows, Balance)  # asked for by those alone
        q, v = rows.filtered["position"], rows.filtered["velocity"]
        torque.append(rows.thinned(np.asarray(machine.motor(q, v, rows.run.inputs))))
    whole = np.concatenate(torque)
    inertia = float(np.asarray(machine.inertia))
    return 100 * inertia * float(np.sqrt(np.mean(rest**2) / np.mean(whole**2)))
