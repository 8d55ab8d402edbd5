"""A base run with what its ports hand out, and the linear transfer of what goes in there."""

import dataclasses

import jax
import numpy as np

from ..dynamics import contact_signals, mount_signals
from ..laws import ContactSignal, MountSignal
from ..rig import Rig
from ._elastic import OUTPUTS, SIGNALS, Ports, law_outputs, linear_states, outputs_of, refine
from ._machine import Machine
from ._modes import Modes, direct, forced, observe, propagate
from ._motion import Motion, integrate
from ._rotation import Turning, base_torques
from ._runs import FINE, SHAPE, Run
from ._wheels import WheelTables

THIN = 4  # torques are smooth: signatures need two points a sample


@dataclasses.dataclass(frozen=True)
class Base:
    """One run of the base rig with the signals that its ports hand out."""

    rig: Rig
    run: Run
    index: int
    modes: Modes
    motion: Motion
    slow: Motion  # at thinned points
    response: Turning  # at thinned points
    torque: np.ndarray
    drive: np.ndarray  # (thinned points, n) N
    shaft: np.ndarray  # (thinned points, n) N m, the motors' and all laws'
    contact: ContactSignal  # (FINE points, n) each
    mount: MountSignal
    normal: np.ndarray  # (FINE points, n) N
    predicted: np.ndarray  # (samples, 6) dR, a before the sensors
    tables: WheelTables


def base_of(machine: Machine, rig: Rig, i: int, predicted: np.ndarray) -> Base:
    """Base run `i` of `rig`; its own contact and mount laws enter the signals only linearly."""
    run, rotated = machine.runs[i], machine.rotated(rig, [i])[i]
    m = rotated.motion
    felt = machine.signals(rig, i, machine.ports(rig, run, m, rotated.drive))
    deflection, rate, mount, mount_rate = np.split(felt, 4, axis=1)

    def wide(x):
        return np.broadcast_to(np.asarray(x), m.theta.shape)

    contact = jax.tree.map(wide, contact_signals(rig, deflection, rate))
    normal = contact.preload - contact.stiffness * deflection - contact.damping * rate
    slow, torque = thin(m), refine(run.torque, FINE)
    return Base(
        rig=rig,
        run=run,
        index=i,
        modes=machine.modes(rig),
        motion=m,
        slow=slow,
        response=rotated.turning.thin(THIN),
        torque=torque,
        drive=rotated.drive[::THIN],
        shaft=base_torques(rig, slow, torque[::THIN], normal[::THIN])[0],
        contact=contact,
        mount=jax.tree.map(wide, mount_signals(rig, mount, mount_rate)),
        normal=normal,
        predicted=predicted,
        tables=machine.tables_of(rig),
    )


def transfer(base: Base, floor=None, **inputs) -> np.ndarray:
    """dR and a from port inputs at FINE points (`shape` at SHAPE points), from static rest."""
    n, m, run = base.rig.size, base.modes, base.run
    points = base.motion.theta.shape
    fine = np.zeros(points)
    tensions = {port: inputs[port] for port in SIGNALS if port in inputs}
    if tensions:
        return _tension(base, tensions)
    shape = inputs.get("shape", np.zeros(((run.samples - 1) * SHAPE + 1, n)))
    floor = np.zeros((points[0], 3)) if floor is None else floor
    ports = Ports(shape, inputs.get("drive", fine), np.zeros((run.samples, 3)), floor)
    return outputs_of(m, linear_states(m, run, ports), ports, OUTPUTS)


def _tension(base: Base, tensions: dict[str, np.ndarray]) -> np.ndarray:
    m = base.modes
    u = np.zeros(m.B.shape[1])
    for port, values in tensions.items():
        u[m.inputs[port]] = values[0]
    start = -np.linalg.solve(m.A, m.B @ u)
    return law_outputs(m, base.run, tensions, start)


def thin(m: Motion) -> Motion:
    """The motion at every `THIN`-th fine point."""
    short = {k: getattr(m, k)[::THIN] for k in ("theta", "speed", "turning")}
    axes = m.axes if len(m.axes) == 1 else m.axes[::THIN]
    return dataclasses.replace(m, axes=axes, step=m.step * THIN, **short)


def turned_by(base: Base, shaft=None, opposing=None):
    """Both tables of a torque on the shafts and one that opposes the sphere, at thinned points."""
    response, m, run = base.response, base.modes, base.run
    drive, rate = response.respond(shaft, opposing)
    parts = FINE // THIN
    h = run.step / parts
    turned = integrate(rate, h)
    length = integrate(np.einsum("tij,tj->ti", response.axes, turned), h)
    total = forced(m, run.step, run.samples - 1, drive=drive)
    elastic = observe(m, propagate(m, run.step, total, np.zeros(len(m.rates))), OUTPUTS)
    elastic += direct(m, OUTPUTS, "drive", lambda: drive[::parts])
    return elastic, np.concatenate([turned[::parts], length[::parts]], axis=1)
