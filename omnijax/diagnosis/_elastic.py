"""The elastic run under known wheel angles: exact where linear, stepped where laws are not."""

import dataclasses

import equinox as eqx
import numpy as np

from ..dynamics import Coupled, linear_system
from ..rig import Rig
from ._modes import Modes, hold_weights, modes, moments, observe, propagate, static_state
from ._runs import FINE, SHAPE, Run

OUTPUTS = ("displacement", "acceleration")
SIGNALS = ("deflection", "mount", "mount_rate", "approach_rate")


@eqx.filter_jit
def _system(rig: Rig):
    system = linear_system(Coupled(rig))
    return system.A, system.B, system.C, system.D


def rig_modes(rig: Rig) -> Modes:
    """Modes of a rig's linear part; its laws do not enter."""
    bare = eqx.tree_at(lambda r: r.effects, rig, (), is_leaf=lambda x: x is rig.effects)
    bare = eqx.tree_at(lambda r: r.profiles, bare, (), is_leaf=lambda x: x is bare.profiles)
    return modes(*_system(bare), size=rig.size)


@dataclasses.dataclass(frozen=True)
class Ports:
    """What goes into the elastic model of one run, besides what contacts and mounts add."""

    shape: np.ndarray  # (SHAPE points, n) m, rho and the sphere's surface
    drive: np.ndarray  # (FINE points, n) N
    force: np.ndarray  # (samples, 3) N
    floor: np.ndarray  # (FINE points, 3) m/s^2

    def at(self, part: str, parts: int) -> np.ndarray:
        """One input at `parts` points a sample; taking every k-th point or linear between."""
        values = getattr(self, part)
        own = {"shape": SHAPE, "drive": FINE, "force": 1, "floor": FINE}[part]
        if own >= parts:
            return values[:: own // parts]
        return refine(values, parts // own)


def refine(values: np.ndarray, parts: int) -> np.ndarray:
    """`values` (t, c) with linear points in between."""
    at = np.arange((len(values) - 1) * parts + 1) / parts
    known = np.arange(len(values))
    return np.stack([np.interp(at, known, values[:, c]) for c in range(values.shape[1])], axis=1)


def forcing(m: Modes, step: float, ports: Ports, per_sample: int) -> np.ndarray:
    """Per-interval modal forcing with `per_sample` intervals a sample."""
    total = np.zeros(((len(ports.force) - 1) * per_sample, len(m.rates)), complex)
    h = step / per_sample
    for part in ("shape", "drive", "force", "floor"):
        finest = {"shape": SHAPE, "force": per_sample}.get(part, max(FINE, per_sample))
        values = ports.at(part, finest)
        weights = hold_weights(m.rates, h, finest // per_sample)
        columns = m.gains[:, m.inputs[part]]
        for c in range(values.shape[1]):
            if values[:, c].any():
                total += moments(values[:, c], weights) * columns[:, c]
    return total


def start_inputs(m: Modes, ports: Ports) -> np.ndarray:
    """Inputs (u,) of the static start: the shapes under the sphere, nothing else."""
    u = np.zeros(m.B.shape[1])
    u[m.inputs["shape"]] = ports.shape[0]
    return u


def direct(m: Modes, ports: Ports, parts: int) -> np.ndarray:
    """All inputs (t, u) at `parts` points a sample, for the outputs' direct part."""
    n = ports.shape.shape[1]
    zero = np.zeros(((len(ports.force) - 1) * parts + 1, n))
    known = [ports.at(p, parts) for p in ("shape", "drive", "force", "floor")]
    return np.concatenate([known[0], zero, zero, *known[1:]], axis=1)


def linear_outputs(
    m: Modes, run: Run, ports: Ports, names, parts: int = 1, rolling: np.ndarray | None = None
) -> np.ndarray:
    """Outputs (t, o) of the linear elastic model at `parts` points a sample.

    From static rest, and from the state `rolling` (m,) beside it where that is known.
    """
    start = static_state(m, start_inputs(m, ports))
    start = start if rolling is None else start + m.inverse @ rolling
    z = propagate(m, run.step / parts, forcing(m, run.step, ports, parts), start)
    return observe(m, z, names, direct(m, ports, parts))


def law_outputs(m: Modes, run: Run, contact, mount, start) -> np.ndarray:
    """dR and a (samples, 6) caused by tensions (points, n) and the state `start` (m,)."""
    fine = (len(contact) - 1) // (run.samples - 1)
    weights = hold_weights(m.rates, run.step, fine)
    total = np.zeros((run.samples - 1, len(m.rates)), complex)
    for part, values in (("contact", contact), ("mount", mount)):
        columns = m.gains[:, m.inputs[part]]
        for c in np.flatnonzero(values.any(axis=0)):
            total += moments(values[:, c], weights) * columns[:, c]
    z = propagate(m, run.step, total, m.inverse @ start)
    u = np.zeros((len(z), m.B.shape[1]))
    u[:, m.inputs["contact"]], u[:, m.inputs["mount"]] = contact[::fine], mount[::fine]
    return observe(m, z, OUTPUTS, u)
