"""Laws at contacts and mounts, stepped in time: what they change in a linear elastic run."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from scipy.linalg import expm

from ..dynamics import initial_memory
from ..rig import Rig
from ._elastic import SIGNALS, law_outputs
from ._modes import Modes
from ._ports import bare, law_tensions
from ._runs import STEPS, Run

STEPPED = ("contact", "mount", "separation")  # ports whose laws are stepped
LANES = 16  # runs stepped side by side: bounds the memory


@dataclasses.dataclass(frozen=True)
class Lane:
    """One run of one rig: the linear port signals (STEPS points, 4 n) and d rho/dt (.., n)."""

    rig: Rig
    modes: Modes
    run: Run
    signals: np.ndarray
    shape_rate: np.ndarray


def law_changes(lanes: list[Lane]) -> list[np.ndarray]:
    """What contact and mount laws change in dR and a (samples, 6) of every lane."""
    if not lanes:
        return []
    parts = np.array_split(np.arange(len(lanes)), -(-len(lanes) // LANES))
    return [change for some in parts for change in _side_by_side([lanes[k] for k in some])]


def _side_by_side(lanes: list[Lane]) -> list[np.ndarray]:
    longest = max(x.run.samples for x in lanes) * STEPS
    starts = [_static_deviation(x.rig, x.modes, x.signals[0]) for x in lanes]
    matrices = [step_matrices(x.modes, x.run.step / STEPS) for x in lanes]
    step = jnp.asarray([x.run.step / STEPS for x in lanes])
    tensions = np.asarray(
        step_laws(
            _stack([bare(x.rig, *STEPPED) for x in lanes]),
            _stack(matrices),
            _stack([x.modes.out(SIGNALS)[0] for x in lanes]),
            (_stack([d for d, _ in starts]), _stack([memory for _, memory in starts]), step),
            jnp.asarray(np.stack([_padded(x.signals, longest) for x in lanes], 1)),
            jnp.asarray(np.stack([_padded(x.shape_rate, longest) for x in lanes], 1)),
        )
    )
    out = []
    for k, (lane, (start, _)) in enumerate(zip(lanes, starts, strict=True)):
        force = tensions[: (lane.run.samples - 1) * STEPS + 1, k]
        contact, mount = np.split(force, 2, axis=1)
        out.append(law_outputs(lane.modes, lane.run, contact, mount, np.asarray(start)))
    return out


def _stack(items):
    return jax.tree.map(lambda *x: jnp.stack([jnp.asarray(v) for v in x]), *items)


def nonlinear(rig: Rig) -> bool:
    """Whether laws at contacts or mounts need stepping in time."""
    return any(rig.at(port) for port in STEPPED)


@jax.jit
def _static(rig: Rig, compliance, rows, signal):
    """Deviation d = compliance F(signal + rows d) at rest, with the laws' memories at rest."""
    memory = initial_memory(rig)
    flat, unravel = ravel_pytree((jnp.zeros(compliance.shape[0]), memory))

    def gap(x):
        d, z = unravel(x)
        force, change = law_tensions(rig, signal + rows @ d, jnp.zeros(rig.size), z)
        return ravel_pytree((d - compliance @ force, change))[0]

    def newton(x, _):
        step = jnp.linalg.solve(jax.jacfwd(gap)(x), gap(x))
        return x - step, None

    x, _ = jax.lax.scan(newton, flat, None, length=12)
    return unravel(x)


def _static_deviation(rig: Rig, m: Modes, signal):
    """(d, memory) of the static start with the rig's contact and mount laws."""
    columns = np.concatenate([m.B[:, m.inputs["contact"]], m.B[:, m.inputs["mount"]]], axis=1)
    compliance = -np.linalg.solve(m.A, columns)
    return _static(
        bare(rig, *STEPPED),
        jnp.asarray(compliance),
        jnp.asarray(m.out(SIGNALS)[0]),
        jnp.asarray(signal),
    )


def _padded(values, length):
    return np.concatenate([values, np.repeat(values[-1:], length - len(values), axis=0)])


def step_matrices(m: Modes, h: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(E, P, Q): d_next = E d + P F + Q F_next for tensions F linear over a step `h`."""
    columns = np.r_[
        np.arange(m.B.shape[1])[m.inputs["contact"]], np.arange(m.B.shape[1])[m.inputs["mount"]]
    ]
    k, f = len(m.A), len(columns)
    big = np.zeros((k + 2 * f, k + 2 * f))
    big[:k, :k], big[:k, k : k + f] = m.A * h, m.B[:, columns] * h
    big[k : k + f, k + f :] = np.eye(f)
    e = expm(big)
    first, second = e[:k, k : k + f], e[:k, k + f :]
    return e[:k, :k], first - second, second


@jax.jit
def step_laws(rigs: Rig, matrices, rows, start, signals, rates):
    """Tensions (t, lanes, 2 n) of contact and mount laws, stepped with the deviation they cause.

    d = state less the linear run's; the laws feel the linear `signals` (t, lanes, 4 n) plus
    `rows` d.  Heun's predictor and corrector around the exact linear step.
    """
    E, P, Q = matrices

    def force(rig, rows, d, memory, signal, rate):
        return law_tensions(rig, signal + rows @ d, rate, memory)

    def one(rig, E, P, Q, rows, carry, here):
        d, memory, F, change, h = carry
        signal, rate = here
        ahead = E @ d + (P + Q) @ F
        guess = jax.tree.map(lambda z, c: z + h * c, memory, change)
        F1, change1 = force(rig, rows, ahead, guess, signal, rate)
        d = E @ d + P @ F + Q @ F1
        memory = jax.tree.map(lambda z, c, c1: z + h / 2 * (c + c1), memory, change, change1)
        F1, change1 = force(rig, rows, d, memory, signal, rate)
        return (d, memory, F1, change1, h), F1

    def body(carry, here):
        return jax.vmap(one)(rigs, E, P, Q, rows, carry, here)

    d, memory, h = start
    F, change = jax.vmap(force)(rigs, rows, d, memory, signals[0], rates[0])
    _, out = jax.lax.scan(body, (d, memory, F, change, h), (signals[1:], rates[1:]))
    return jnp.concatenate([F[None], out])
