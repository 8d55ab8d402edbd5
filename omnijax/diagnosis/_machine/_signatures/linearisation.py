"""A base run with what its ports hand out, and the linear transfer of what goes in there."""

import dataclasses
import functools

import jax
import numpy as np

from ....dynamics import RotationMoment, contact_signals, mount_signals
from ....laws import ContactSignal, MountSignal
from ....rig import Rig
from ..._settings import SETTINGS
from .._elastic import OutputModes, driven, rest_state
from .._laws import bare, moving_readings, readings
from .._motion import RunMotion, WheelPlaces, WheelTables, integrate, rolling_radius
from .._rotation import MeasuredTurning, commanded, rotation_moments, run_torques
from ..machine import Machine, Rotated
from ..runs import ELASTIC, FINE, Run

THIN = SETTINGS.prediction.thin


@dataclasses.dataclass(frozen=True)
class Linearisation:
    """One run of the base rig with the signals that its ports hand out."""

    rig: Rig
    run: Run
    index: int
    modes: OutputModes
    motion: RunMotion
    slow: RunMotion  # at thinned points
    rotated: Rotated
    response: MeasuredTurning  # at thinned points
    torque: np.ndarray  # (FINE points, n) N m, commanded, and now to act
    felt: RotationMoment  # (thinned points, ...) with the delivered torques
    drive: np.ndarray  # (thinned points, n) N
    shaft: jax.Array  # (thinned points, n) N m, the motors' and all laws'
    contact: ContactSignal  # (FINE points, n) each
    mount: MountSignal
    normal: np.ndarray  # (FINE points, n) N
    predicted: np.ndarray  # (samples, 6) dR, a before the sensors
    tables: WheelTables

    @functools.cached_property
    def fine(self) -> "Linearisation":
        """The same with torques at all fine points, in place of the thinned ones."""
        moments = rotation_moments(self.rig, self.motion, self.torque, self.normal)
        moments, caused = run_torques(self.rig, self.run, moments)
        return dataclasses.replace(
            self, slow=self.motion, response=self.rotated.turning, felt=moments,
            drive=self.rotated.drive, shaft=caused.shaft,
        )  # fmt: skip

    @functools.cached_property
    def bare(self) -> Rig:
        """The rig without laws."""
        return bare(self.rig)

    @functools.cached_property
    def true(self) -> dict[str, np.ndarray]:
        """By output group the values (samples, c) before the sensors."""
        turning, theta = self.motion.turning[::FINE], self.motion.theta[::FINE]
        elastic = self.predicted
        return {"dR": elastic[:, :3], "a": elastic[:, 3:], "Omega": turning, "theta": theta}

    @functools.cached_property
    def shown(self) -> dict[str, np.ndarray]:
        """By output group what the rig's sensors show of it (samples, 3)."""
        return {g: self.read(self.rig, g, self.true[g]) for g in ("dR", "a", "Omega")}

    def read(self, rig: Rig, group: str, values: np.ndarray) -> np.ndarray:
        """What the sensors of a rig show of the `values` (samples, c) of an output group."""
        if group in ELASTIC:
            return readings(rig, group, self.run.time, values)
        return moving_readings(rig, group, self.run.time, values, self.motion.rolls)

    @functools.cached_property
    def rho_slope(self) -> np.ndarray:
        """d rho/d theta (SHAPE points, n) of the wheels' shapes."""
        return self.tables.rho_slope(self.motion.theta_shape)

    @functools.cached_property
    def lever(self) -> np.ndarray:
        """Rolling radii (FINE points, n), m."""
        return rolling_radius(self.rig, self.motion)

    @functools.cached_property
    def places(self) -> list[WheelPlaces]:
        """By wheel: where its angles at SHAPE points lie in the tables."""
        return [self.tables.places(angle, i) for i, angle in enumerate(self.motion.theta_shape.T)]

    @functools.cached_property
    def one_turn(self) -> "Linearisation":
        """The same with tables of one turn, for what is the same in each."""
        return dataclasses.replace(self, tables=self.tables.first_turn())


def base_of(machine: Machine, rig: Rig, i: int, predicted: np.ndarray) -> Linearisation:
    """Base run `i` of `rig`; its own contact and mount laws enter the signals only linearly."""
    run, rotated = machine.runs[i], machine.rotated(rig, [i])[i]
    m = rotated.motion
    deflection, rate, mount, mount_rate = np.split(machine.signals(rig, i), 4, axis=1)

    def wide(x):
        return np.broadcast_to(np.asarray(x), m.theta.shape)

    contact = jax.tree.map(wide, contact_signals(rig, deflection, rate))
    # `dynamics.contact_forces` without laws: NumPy's arrays of all fine points at once
    normal = contact.preload - contact.stiffness * deflection - contact.damping * rate
    slow, torque = thin(m), commanded(rig, run)
    moments = rotation_moments(rig, slow, torque[::THIN], normal[::THIN])
    moments, caused = run_torques(rig, run, moments)
    return Linearisation(
        rig=machine.at_run(rig, i),
        run=run,
        index=i,
        modes=machine.modes(rig),
        motion=m,
        slow=slow,
        rotated=rotated,
        response=rotated.turning.thin(THIN),
        torque=torque,
        felt=moments,
        drive=rotated.drive[::THIN],
        shaft=caused.shaft,
        contact=contact,
        mount=jax.tree.map(wide, mount_signals(rig, mount, mount_rate)),
        normal=normal,
        predicted=predicted,
        tables=machine.tables_of(rig),
    )


def transfer(base: Linearisation, **inputs: np.ndarray) -> np.ndarray:
    """dR and a (samples, 6) from inputs (points, c) of the elastic model, from static rest."""
    return driven(base.modes, base.run, rest_state(base.modes, **inputs), **inputs)


def thin(m: RunMotion) -> RunMotion:
    """The motion at every `THIN`-th fine point."""
    short = {k: getattr(m, k)[::THIN] for k in ("theta", "speed", "turning")}
    axes = m.axes if len(m.axes) == 1 else m.axes[::THIN]
    return dataclasses.replace(m, axes=axes, step=m.step * THIN, **short)


def turned_by(base: Linearisation, shaft=None, opposing=None, **inputs: np.ndarray):
    """Both tables of a torque on the shafts and one that opposes the sphere, at the slow points.

    With what other `inputs` of the elastic model cause.
    """
    response = base.response
    drive, rate = response.respond(shaft, opposing)
    parts = (len(rate) - 1) // (base.run.samples - 1)
    h = base.run.step / parts
    turned = integrate(rate, h)
    length = integrate(np.einsum("tij,tj->ti", response.axes, turned), h)
    elastic = transfer(base, drive=drive, **inputs)
    return elastic, np.concatenate([turned[::parts], length[::parts]], axis=1)
