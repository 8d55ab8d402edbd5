"""The elastic run under known wheel angles: exact where linear, stepped where laws are not."""

import dataclasses
from collections.abc import Collection

import equinox as eqx
import numpy as np

from ...._programs import kept
from ....dynamics import Coupled, linear_system
from ....rig import Rig
from .._laws import along
from .._motion import RunMotion, contact_directions
from ..runs import FINE, SHAPE, Run
from .modes import OutputModes, direct, forced, modes, observe, propagate, static_state

OUTPUTS = ("displacement", "acceleration")
INPUTS = ("shape", "drive", "force", "floor", "jumps")  # inputs beside tensions
AT_REST = ("shape", "contact", "mount")  # inputs that are there before a run begins
SIGNALS = {"contact": ("deflection", "contact_rate"), "mount": ("mount", "mount_rate")}


@kept
def _system(rig: Rig):
    system = linear_system(Coupled(rig))
    return system.A, system.B, system.C, system.D


def rig_modes(rig: Rig) -> OutputModes:
    """Modes of a rig's linear part; its laws do not enter."""
    bare = rig.with_effects(())
    bare = eqx.tree_at(lambda r: r.profiles, bare, (), is_leaf=lambda x: x is bare.profiles)
    return modes(*_system(bare), size=rig.size)


@dataclasses.dataclass(frozen=True)
class ElasticPorts:
    """What goes into the elastic model of one run, besides what contacts and mounts add."""

    shape: np.ndarray  # (SHAPE points, n) m, rho and the sphere's surface
    drive: np.ndarray  # (FINE points, n) N
    force: np.ndarray  # (samples, 3) N
    floor: np.ndarray  # (FINE points, 3) m/s^2
    jumps: np.ndarray  # (FINE points, n) N, what the integral of the drive forces' points lacks

    def by_name(self) -> dict[str, np.ndarray]:
        """The inputs by their names."""
        return {name: getattr(self, name) for name in INPUTS}

    def at(self, part: str, parts: int) -> np.ndarray:
        """One input at `parts` points a sample; taking every k-th point or linear between."""
        values = getattr(self, part)
        own = {"shape": SHAPE, "force": 1}.get(part, FINE)
        if own >= parts:
            return values[:: own // parts]
        return refine(values, parts // own)


def refine(values: np.ndarray, parts: int) -> np.ndarray:
    """`values` (t, c) with linear points in between."""
    at = np.arange((len(values) - 1) * parts + 1) / parts
    known = np.arange(len(values))
    return np.stack([np.interp(at, known, values[:, c]) for c in range(values.shape[1])], axis=1)


def elastic_ports(
    rig: Rig, run: Run, m: RunMotion, drive: np.ndarray, jumps: np.ndarray
) -> ElasticPorts:
    """The inputs along a motion; `drive` and `jumps` (FINE points, n) as in `ElasticPorts`."""
    shape = m.rho
    if rig.at("surface"):
        shape = shape + refine(_surface(rig, run, m), SHAPE // FINE)
    return ElasticPorts(shape, drive, run.force, _floor(rig, run), jumps)


def _surface(rig: Rig, run: Run, m: RunMotion) -> np.ndarray:
    """What the laws at the sphere's surface add to rho, (FINE points, n) m."""
    directions = contact_directions(rig, m)
    total = np.zeros(m.theta.shape)
    for placed in rig.at("surface"):
        for i in range(rig.size):
            total[:, i] += along(placed.law, np.ascontiguousarray(directions[:, i]), run)
    return total


def _floor(rig: Rig, run: Run) -> np.ndarray:
    """Acceleration of the platform by its laws, (FINE points, 3) m/s^2."""
    time = run.fine(FINE)
    floor = np.zeros((len(time), 3))
    for placed in rig.at("platform"):
        floor += along(placed.law, time, run)
    return floor


def rest_state(m: OutputModes, **inputs: np.ndarray) -> np.ndarray:
    """Modal state (k,) at rest under the first of inputs by name (points, c): `AT_REST` only."""
    u = np.zeros(m.B.shape[1])
    for part in AT_REST:
        if part in inputs:
            u[m.inputs[part]] = inputs[part][0]
    return static_state(m, u)


def linear_states(
    m: OutputModes, run: Run, ports: ElasticPorts, parts: int = 1, rolling: np.ndarray | None = None
) -> np.ndarray:
    """Modal states (t, k) of the linear elastic model at `parts` points a sample.

    From static rest, and from the state `rolling` (m,) beside it where that is known.
    """
    start = rest_state(m, shape=ports.shape)
    start = start if rolling is None else start + m.inverse @ rolling
    step = run.step / parts
    total = forced(m, step, (run.samples - 1) * parts, **ports.by_name())
    return propagate(m, step, total, start)


def outputs_of(
    m: OutputModes, z: np.ndarray, ports: ElasticPorts, names, parts: int = 1
) -> np.ndarray:
    """Outputs (t, o) of the modal states `z` at `parts` points a sample."""
    out = observe(m, z, names)
    for part in INPUTS:
        out += direct(m, names, part, lambda part=part: ports.at(part, parts))
    return out


def felt(
    m: OutputModes, z: np.ndarray, ports: ElasticPorts, rate, where: Collection[str], parts: int
):
    """Deflections and rates (t, 2 n a port) of modal states `z` at the ports `where`.

    In the order of `SIGNALS`; `rate` (t, n) is d rho/dt of the wheels' shapes, which contacts feel.
    """
    signals = outputs_of(m, z, ports, signal_names(where), parts)
    if "contact" in where:
        n = rate.shape[1]
        signals[:, n : 2 * n] -= rate
    return signals


def signal_names(where: Collection[str]) -> tuple[str, ...]:
    """The outputs that are felt at the ports `where`, in the order of `SIGNALS`."""
    return tuple(s for port, signals in SIGNALS.items() if port in where for s in signals)


def driven(m: OutputModes, run: Run, start: np.ndarray, **inputs: np.ndarray) -> np.ndarray:
    """dR and a (samples, 6) that inputs by name (points, c) cause, from the modal state `start`.

    Every input is linear between its points, a whole number of them a sample.
    """
    return caused(m, run, driven_states(m, run, start, **inputs), **inputs)


def driven_states(m: OutputModes, run: Run, start: np.ndarray, **inputs: np.ndarray) -> np.ndarray:
    """The modal states (samples, k) of the run that inputs drive from the state `start`."""
    return propagate(m, run.step, forced(m, run.step, run.samples - 1, **inputs), start)


def caused(m: OutputModes, run: Run, z: np.ndarray, **inputs: np.ndarray) -> np.ndarray:
    """dR and a (samples, 6) of the modal states `z` at the samples, under those inputs."""
    out = observe(m, z, OUTPUTS)
    for part, values in inputs.items():
        parts = (len(values) - 1) // (run.samples - 1)
        out += direct(m, OUTPUTS, part, lambda values=values, parts=parts: values[::parts])
    return out
