"""Where a wheel without encoder stood at the first sample, from dR and a.

Its angle is the integral of Omega from an unknown start phi.  With known angles dR and a are linear
in the wheels' shapes, so every phase of every wheel is pushed through the elastic model once, the
best combination of phases is that of the least squares, and Gauss-Newton steps refine it.  Turns
by whole gaps leave dR and a as they are: phi lies within the first pitch.
"""

import dataclasses
import itertools

import numpy as np

from ....rig import Rig
from ..._settings import SETTINGS
from .._elastic import driven, rest_state
from .._noise import PARTS, response_rows
from ..machine import Machine
from ..runs import ELASTIC, SHAPE, Run

PHASES = SETTINGS.start_angles.phases
STEPS = SETTINGS.start_angles.steps
ENDED_FALL = SETTINGS.gauss_newton.ended_fall
ROUNDS = SETTINGS.start_angles.rounds
COARSE = SETTINGS.start_angles.coarse


def without_encoder(run: Run, wheels: int) -> np.ndarray:
    """Indices of the wheels whose angle was not measured."""
    angle = run.outputs.get("theta", np.full((1, wheels), np.nan))
    return np.flatnonzero(np.isnan(angle).all(axis=0))


def with_start_angles(machine: Machine, rig: Rig) -> list[Run]:
    """The runs with the start angles of wheels without encoder; refined where they have some."""
    for i, run in enumerate(machine.runs):
        missing = without_encoder(run, rig.size)
        if len(missing) and any(g in run.outputs for g in ELASTIC):
            if run.start is None:
                _move(machine, i, missing, _phases(machine, rig, i, missing))
            _refine(machine, rig, i, missing)
    return machine.runs


def _refine(machine: Machine, rig: Rig, i: int, missing) -> None:
    """Gauss-Newton steps of the start angles of a run's `missing` wheels, while they leave less."""
    left = _left(machine, rig, i)
    for _ in range(STEPS):
        change = _step(machine, rig, i, missing, left)
        _move(machine, i, missing, change)
        after = _left(machine, rig, i)
        fall = left @ left - after @ after
        if not fall > 0:
            _move(machine, i, missing, -change)
        if not fall > ENDED_FALL:
            return
        left = after


def _move(machine: Machine, i: int, missing, change) -> None:
    """Give run `i` of the machine other start angles."""
    run = machine.runs[i]
    start = np.zeros(machine.rig.size) if run.start is None else run.start.copy()
    start[missing] += change
    machine.replace(i, dataclasses.replace(run, start=start))


def _weights(machine: Machine, i: int) -> np.ndarray:
    """1/sigma (samples, 6) of dR and a, 0 where nothing was measured."""
    run = machine.runs[i]
    empty = np.full((run.samples, 3), np.nan)
    return np.concatenate(
        [np.isfinite(run.outputs.get(g, empty)) / machine.noise.get(g, 1.0) for g in ELASTIC],
        axis=1,
    )


def _left(machine: Machine, rig: Rig, i: int) -> np.ndarray:
    """Measured less predicted dR and a (rows,), weighed."""
    elastic, _ = machine.residual_tables(rig, i)
    return (np.nan_to_num(elastic) * _weights(machine, i)).ravel()


def _phases(machine: Machine, rig: Rig, i: int, missing) -> np.ndarray:
    """The best phases (wheels without encoder,) among `PHASES` a pitch."""
    run, m, w = machine.runs[i], machine.motions(rig, [i])[i], _weights(machine, i)
    tables, modes = machine.tables_of(rig), machine.modes(rig)
    pitch = 2 * np.pi / np.asarray(rig.wheels.rollers)[missing]
    signals = []
    for k, wide in zip(missing, pitch, strict=True):
        for phase in np.arange(PHASES) * wide / PHASES:
            shape = np.zeros_like(m.theta_shape)
            shape[:, k] = tables.places(m.theta_shape[:, k] + phase, k).of(tables.shape[:, k])
            response = driven(modes, run, rest_state(modes, shape=shape), shape=shape)
            signals.append((response * w).ravel())
    table = np.stack(signals)
    left = _left(machine, rig, i) + table[::PHASES].sum(axis=0)
    chosen = _least_squares(table @ table.T, table @ left, len(missing))
    return chosen * pitch / PHASES


def _least_squares(gram: np.ndarray, right: np.ndarray, wheels: int) -> np.ndarray:
    """One phase a wheel with the least |left - sum of signals|^2: coarse grid, then descent."""
    offset = PHASES * np.arange(wheels)

    def cost(phases) -> float:
        at = offset + np.asarray(phases) % PHASES
        return float(gram[np.ix_(at, at)].sum() - 2 * right[at].sum())

    coarse = range(0, PHASES, COARSE)
    best = np.array(min(itertools.product(coarse, repeat=wheels), key=cost))
    for _ in range(ROUNDS):
        for k in range(wheels):
            unit = np.eye(wheels, dtype=int)[k]
            best = min((best + (n - best[k]) * unit for n in range(PHASES)), key=cost)
    return best


def _step(machine: Machine, rig: Rig, i: int, missing, left: np.ndarray) -> np.ndarray:
    """Gauss-Newton step of the start angles (wheels without encoder,) for what is `left`.

    As the machine without its laws answers; with them it takes a few steps more.
    """
    run, m = machine.runs[i], machine.motions(rig, [i])[i]
    slopes = machine.tables_of(rig).rho_slope(m.theta_shape[:: SHAPE // PARTS])
    one = [np.full((run.samples, int(k in missing)), 1.0) for k in range(rig.size)]
    across = response_rows(machine.modes(rig), run, slopes, one, _weights(machine, i))
    return np.linalg.lstsq(across.T, left, rcond=1e-10)[0]
