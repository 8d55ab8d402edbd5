"""The data vector of one run of a machine: weights, free starts, and the encoders' covariance."""

from collections.abc import Callable

import numpy as np

from ....recording import channels
from ....rig import Rig
from ..._orthonormal import orthonormal
from ..._settings import SETTINGS
from .._elastic import late_outputs, linear_states, propagate
from .._laws import on_time, radii, readings
from ..clocks import LoggerClock, offset_of
from ..runs import SHAPE
from .data_vector import DataRows, make_rows
from .encoders import PARTS, response_rows, smoothed_errors, turned_errors, whitener

START_ANGLE = SETTINGS.noise_model.start_angle
STRAIGHT_CHANGE = SETTINGS.noise_model.straight_change


def rows_of(machine, rig: Rig, i: int) -> DataRows:
    """Weights, nuisance directions and the encoders' part of the covariance of one run.

    Omega and s are free at the start of every window (0 s: once).
    """
    run, m = machine.runs[i], machine.motions(rig, [i])[i]
    rows = make_rows(run, machine.noise, machine.length_noise, m.axes, machine.window, rig.size)
    across = response_rows(
        machine.modes(rig), run, machine.tables_of(rig).rho_slope(m.theta_shape[:: SHAPE // PARTS]),
        _angle_errors(machine, rig, i), rows.elastic,
    )  # fmt: skip
    rows.bleach(across)
    if across.any():
        rows.coloured = whitener(across)
    if run.rolling_start(machine.noise):
        _free_elastic_start(machine, rig, i, rows)
    return rows


def _angle_errors(machine, rig: Rig, i: int) -> list[np.ndarray]:
    """By wheel: modes (samples, k) of the error of the angle behind the prediction, rad."""
    run, ratio = machine.runs[i], machine.basis.ratios[i]
    radius = float(rig.sphere.radius) / radii(rig)
    measured = run.outputs.get("theta", np.full((run.samples, rig.size), np.nan))
    out = []
    level = np.broadcast_to(run.level("theta"), rig.size)
    names = channels("theta", rig.size)
    for k in range(rig.size):
        if np.isfinite(measured[:, k]).any():
            error = smoothed_errors(run.samples, ratio, run.spectra.get(names[k]))
            out.append(error * machine.length_noise[k] * level[k] * radius[k])
        else:  # the angle is the integral of Omega, from a start that is fitted
            axis = np.asarray(rig.wheels.spin_axis)[k]
            turned = turned_errors(run, axis, machine.noise.get("Omega", 0.0))
            start = np.full((run.samples, 1), START_ANGLE)
            out.append(np.concatenate([turned * radius[k], start], axis=1))
    return out


def _free_elastic_start(machine, rig: Rig, i: int, rows: DataRows) -> None:
    """A run that begins rolling: its elastic state at the first sample is free."""
    free = _start_columns(machine, rig, i, rows)
    rows.nuisance.append((slice(0, rows.elastic.size), orthonormal(free.T)))


def _start_columns(machine, rig: Rig, i: int, rows: DataRows) -> np.ndarray:
    """What each number of the elastic state at the first sample changes in the elastic rows.

    Read as late as the prediction is: a wheel rings far on its mount in half a millisecond.
    """
    m, run = machine.modes(rig), machine.runs[i]
    zero = np.zeros((run.samples - 1, len(m.rates)), complex)
    rig = machine.at_run(rig, i)
    read = _as_read(machine, rig, i)
    groups = [offset_of(rig, group) for group in ("dR", "a")]
    columns = []
    for k in range(len(m.A)):
        z = propagate(m, run.step, zero, m.inverse @ np.eye(len(m.A))[k])
        late = [late_outputs(m, run, z, {}, s) for s in groups]
        change = np.concatenate([late[0][:, :3], late[1][:, 3:]], axis=1)
        columns.append((read(change) * rows.elastic).ravel())
    free = np.stack(columns)
    rows.whiten(free)
    return free


def _as_read(machine, rig: Rig, i: int) -> Callable[[np.ndarray], np.ndarray]:
    """By how much the readings of dR and a change with a small change (samples, 6) of these.

    A sensor that loses the sign turns its change round, one at its limit shows none.
    """
    elastic = [p.law for p in rig.at("sensor") if p.group in ("dR", "a")]
    if all(type(law) is LoggerClock for law in elastic):
        return lambda change: change
    run = machine.runs[i]
    ((base,),) = machine.elastic([rig], [i])

    def readings_of(values: np.ndarray) -> np.ndarray:
        parts = zip(("dR", "a"), np.split(values, 2, axis=1), strict=True)
        read = [readings(rig, group, run.time, part, on_time(rig, group)) for group, part in parts]
        return np.concatenate(read, axis=1)

    here = readings_of(base)

    def changed(change: np.ndarray) -> np.ndarray:
        small = STRAIGHT_CHANGE / np.max(np.abs(change / np.std(base, axis=0).clip(1e-300)))
        return (readings_of(base + small * change) - here) / small

    return changed


def rolling_state(machine, rig: Rig, i: int) -> np.ndarray:
    """What the data say of the elastic state (m,) at the first sample, beside static rest.

    The free start takes up what it changes linearly; laws at contacts and mounts have to feel it.
    It is one like those that the run passes: some directions the data hardly tell, and along them
    laws would feel deflections that no run has.
    """
    rows, known = machine.rows[i], machine.basis.rolling.get(i)
    left = rows.vector(machine.residual_tables(rig, i)[0], None)[None, : rows.elastic.size]
    rows.whiten(left)
    (left,), columns = left, _start_columns(machine, rig, i, rows)
    q = orthonormal(columns.T)
    beside = left - q @ (q.T @ left)  # of no start: as large as noise, or as what is missing
    spread = max(1.0, float(beside @ beside) / max(1, np.sum(rows.elastic > 0)))
    usual = _usual_states(machine, rig, i)
    columns = usual @ columns
    whole = left if known is None else left + known @ np.linalg.pinv(usual) @ columns
    gram = columns @ columns.T / spread + np.eye(len(columns))
    return usual.T @ np.linalg.solve(gram, columns @ whole / spread)


def _usual_states(machine, rig: Rig, i: int) -> np.ndarray:
    """Directions (k, m) of the elastic states of a run beside static rest, each as long as 1 sigma.

    From those of the linear model that begins at rest.
    """
    m, run = machine.modes(rig), machine.runs[i]
    ports = machine.ports(rig, i, machine.rotated(rig, [i])[i])
    static = ports.at("shape", 1) @ (-m.gains[:, m.inputs["shape"]] / m.rates[:, None]).T
    states = np.real((linear_states(m, run, ports) - static) @ m.shapes.T)
    _, sizes, directions = np.linalg.svd(states / np.sqrt(len(states)), full_matrices=False)
    return sizes[:, None] * directions
