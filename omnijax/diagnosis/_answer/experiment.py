"""The next experiment: the feasible motion of the sphere under which rivals differ most.

Every motion stays below the speed that the runs have shown, and below their torque or that which
reaches this speed in half a second.  All rivals are simulated along it as a diagnosis of that run
would; what counts is the worst pair, after each rival's own sizes were fitted to the other's run.
"""

import dataclasses

import numpy as np

from .._machine import FINE, Machine, RigModel, Run, wheel_tables
from .._search import Point
from .._settings import SETTINGS
from .proposed import APART, AbstractProposed, weaker

SECONDS = SETTINGS.experiment.seconds
SPIN_UP = SETTINGS.experiment.spin_up
TIMES = SETTINGS.experiment.times
LEVELS = SETTINGS.experiment.levels
SLOW_RATES = SETTINGS.experiment.slow_rates
FAST_RATES = SETTINGS.experiment.fast_rates
WRITTEN = SETTINGS.experiment.written


def feasible_motions(top: float, time: np.ndarray) -> dict[str, np.ndarray]:
    """Histories of Omega (t, 3) in rad/s, from rest to rest, up to the speed `top`."""
    inside = np.clip(np.minimum(time, SECONDS - time) / SPIN_UP, 0, 1)
    inside = inside**2 * (3 - 2 * inside)
    level = np.interp(time, TIMES, LEVELS)
    motions = {
        f"turn about {axis} at a quarter, half and, backwards, full speed": top
        * np.outer(inside * level, unit)
        for axis, unit in zip("xyz", np.eye(3), strict=True)
    }
    for words, rates in (("slowly", SLOW_RATES), ("fast", FAST_RATES)):
        waves = np.sin(2 * np.pi * np.outer(time, rates) + [0.0, 1.0, 2.0])
        motions[f"turn about all axes at once, {words} reversed"] = (
            top / np.sqrt(2) * inside[:, None] * waves
        )
    return motions


def next_experiment(model: RigModel, rivals: list[Point]) -> dict | None:
    """The motion whose worst pair of `rivals` lies farthest apart, with its torques.

    `None` where some rival runs away in every motion, however slow.
    """
    rig, step = model.rig_at(rivals[0]), model.machine.runs[0].step
    time = np.arange(round(SECONDS / step) + 1) * step
    planned = [
        run for words, Omega in _allowed(model, rig, time).items()
        if (run := _followed(model, rivals, words, time, Omega)) is not None
    ]  # fmt: skip
    if not planned:
        return None
    rows = [{"drive": run.name, "separation": separation} for run, separation in planned]
    best = int(np.argmax([r["separation"] for r in rows]))
    thin = max(1, round(WRITTEN / step))
    values = planned[best][0].torque[::thin].tolist()
    torque = {"unit": "N m", "step": thin * step, "values": values}
    return {**rows[best], "unit": APART, "torque": torque, "compared": rows}


def _followed(
    model: RigModel, rivals: list[Point], words: str, time, Omega
) -> tuple[Run, float] | None:
    """A motion's run and what tells its closest two rivals apart; slower where one runs away.

    A spring that softens holds the sphere only as far as the runs have shown.
    """
    rig = model.rig_at(rivals[0])
    for said, share in weaker(words, "slower"):
        machine = _planned(model, rig, said, time, share * Omega)
        if machine is None:
            continue
        separation = _Planned(model, machine).separation(rivals)
        if separation is not None:
            return machine.runs[0], separation
    return None


@dataclasses.dataclass(frozen=True)
class _Planned(AbstractProposed):
    """The one run of a planned machine."""

    model: RigModel
    machine: Machine

    def rows(self, points):
        return self.machine.residuals([self.model.rig_at(p) for p in points], [0])

    def aside(self):
        return self.machine.aside()


def _shown(model: RigModel, rig) -> tuple[float, np.ndarray]:
    """Greatest |Omega| of the runs, and torques (n,) that are allowed."""
    motions = model.machine.motions(rig)
    top = max(float(np.linalg.norm(m.turning, axis=1).max()) for m in motions.values())
    shown = np.max([np.abs(r.torque).max(axis=0) for r in model.machine.runs], axis=0)
    w, R = rig.wheels, float(rig.sphere.radius)
    inertia = np.linalg.eigvalsh(np.asarray(rig.sphere.inertia_matrix)).max()
    radius = np.asarray(rig.wheel_radius)
    reach = radius * inertia / R + np.asarray(w.inertia) * R / radius
    return top, np.maximum(shown, reach * top / SPIN_UP)


def _levels(model: RigModel, group: str) -> np.ndarray:
    """1-sigma (channels,) over the group's, RMS over the runs; NaN of what none measured."""
    own = [
        np.where(np.isfinite(run.outputs[group]).any(axis=0), run.level(group), 0.0)
        for run in model.machine.runs if group in run.outputs
    ]  # fmt: skip
    measured = np.sum(np.square(own) > 0, axis=0)
    squares = np.sum(np.square(own), axis=0)
    return np.sqrt(np.where(measured > 0, squares / np.maximum(measured, 1), np.nan))


def _run(model: RigModel, rig, words: str, time, Omega) -> Run:
    """The motion as the runs would measure it, without torque: angles, Omega and noise alone."""
    rng, step = np.random.default_rng(0), time[1] - time[0]
    rate = Omega @ np.asarray(rig.wheels.spin_axis).T
    length = np.cumsum(np.concatenate([rate[:1], (rate[1:] + rate[:-1]) / 2]), axis=0) * step
    least = np.min(np.asarray(rig.wheel_radius)) / float(rig.sphere.radius)
    reach = float(np.abs(length).max()) / least + 1.0
    theta = wheel_tables(rig, -reach, reach).unrolled(length)
    clean = {"theta": theta, "Omega": Omega, "dR": np.zeros_like(Omega), "a": np.zeros_like(Omega)}
    levels = {g: _levels(model, g) for g in model.groups}
    outputs = {
        g: clean[g] + model.noise[g] * own * rng.normal(size=clean[g].shape)
        for g, own in levels.items()
    }
    zero, n = np.zeros((len(time), 3)), len(time)
    return Run(words, "held-out", time, np.zeros((n, rig.size)), zero, outputs, np.ones(n, bool),
               levels={g: np.nan_to_num(own, nan=1.0) for g, own in levels.items()})  # fmt: skip


def _torques(machine: Machine, rig, Omega: np.ndarray) -> np.ndarray:
    """Torques (t, n) under which `rig` makes the motion of its one run, which has none yet."""
    run, rotated = machine.runs[0], machine.rotated(rig)[0]
    r = rotated.turning.thin(FINE)
    change = np.gradient(Omega, run.step, axis=0)
    turned = np.moveaxis(r.rates[:, : rig.size], 1, 2)  # dOmega/dt of unit torques
    missing = change - rotated.acceleration[::FINE]
    return np.einsum("tij,tj->ti", np.linalg.pinv(turned), missing)


def _allowed(model: RigModel, rig, time) -> dict[str, np.ndarray]:
    """The feasible motions; what needs too much torque is made slower."""
    top, most = _shown(model, rig)
    motions = feasible_motions(top, time)
    for words, Omega in motions.items():
        force = np.gradient(Omega, time, axis=0) @ np.asarray(rig.sphere.inertia_matrix)
        axes = float(rig.sphere.radius) * np.asarray(rig.wheels.spin_axis).T
        needed = np.abs(force @ np.linalg.pinv(axes).T * np.asarray(rig.wheel_radius))
        share = np.min(most / np.maximum(needed.max(axis=0), 1e-300))
        motions[words] = min(1.0, float(share)) * Omega
    return motions


def _planned(model: RigModel, rig, words: str, time, Omega) -> Machine | None:
    """A motion as a run with the torques that make it; `None` where `rig` runs away under them."""
    try:
        run = _run(model, rig, words, time, Omega)
        machine = Machine(rig, [run], model.noise, model.machine.window)
        torque = _torques(machine, rig, Omega)
        machine.runs = [dataclasses.replace(run, torque=torque)]
        machine.rebase(rig)
    except FloatingPointError:
        return None
    return machine
