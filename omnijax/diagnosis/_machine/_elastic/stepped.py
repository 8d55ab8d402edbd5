"""Laws at contacts and mounts, stepped in time: what they change in a linear elastic run."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from scipy.linalg import expm

from ...._programs import kept
from ....rig import Rig
from ....simulation import side_by_side
from ..._search import STEPPED
from ..._settings import SETTINGS
from ..._threads import each
from .._laws import ElasticLaws
from ..runs import Run, padded
from .elastic import SIGNALS, caused, driven_states, signal_names
from .late import late_outputs
from .modes import OutputModes, direct, forced, observe, propagate

BLOCK = 4096  # steps that one call of the compiled program takes
KEPT_CHANGE = SETTINGS.prediction.kept_change
LANES = 8  # runs stepped side by side at most, on any number of cores: 16 take 5 % less on one


@dataclasses.dataclass(frozen=True)
class Lane:
    """One run of one rig: what its `stepped_ports` feel of the linear run, (t, 2 n a port)."""

    rig: Rig
    modes: OutputModes
    run: Run
    signals: np.ndarray

    @property
    def step(self) -> float:
        """Step in time, s."""
        return self.run.step * (self.run.samples - 1) / (len(self.signals) - 1)


class Change(NamedTuple):
    """What contact and mount laws change in dR and a of a run."""

    now: np.ndarray  # (samples, 6)
    late: Callable[[float], np.ndarray]  # the same so many s late


class Pull(NamedTuple):
    """Tensions of contact and mount laws along a run, and by how much its linear start is off."""

    start: np.ndarray  # modal state (k,)
    tensions: dict[str, np.ndarray]  # by port (steps, n) N


def law_changes(lanes: list[Lane]) -> list[Change]:
    """What contact and mount laws change in every lane."""
    if not lanes:
        return []
    parts = np.array_split(np.arange(len(lanes)), -(-len(lanes) // LANES))
    changes = each(lambda some: _side_by_side([lanes[k] for k in some]), parts)
    return [change for part in changes for change in part]


def _side_by_side(lanes: list[Lane]) -> list[Change]:
    pulls = law_pulls(lanes)
    return [_change(x.modes, x.run, pull) for x, pull in zip(lanes, pulls, strict=True)]


def law_pulls(lanes: list[Lane]) -> list[Pull]:
    """How contact and mount laws pull in each of a few lanes, stepped side by side."""
    laws = [ElasticLaws.of(x.rig) for x in lanes]
    ports = laws[0].ports
    starts = [
        _static_deviation(law, x.modes, x.signals[0]) for law, x in zip(laws, lanes, strict=True)
    ]
    # as many lanes as a power of two: few programs to compile
    full = [*range(len(lanes)), *[0] * (2 ** (len(lanes) - 1).bit_length() - len(lanes))]
    some = [lanes[k] for k in full]
    stacked = _stack([laws[k] for k in full])
    matrices = _stack([step_matrices(x.modes, x.step, ports) for x in some])
    rows = _stack([x.modes.out(signal_names(ports))[0] for x in some])
    tensions = _stepped(some, stacked, matrices, rows, _stack([starts[k] for k in full]))
    out = []
    for k, (lane, (start, _)) in enumerate(zip(lanes, starts, strict=True)):
        force = np.split(tensions[k, : len(lane.signals)], len(ports), axis=1)
        begin = lane.modes.inverse @ np.asarray(start)
        out.append(Pull(begin, dict(zip(ports, force, strict=True))))
    return out


def _change(m: OutputModes, run: Run, pull: Pull) -> Change:
    forces = pull.tensions
    z = driven_states(m, run, pull.start, **forces)
    return Change(caused(m, run, z, **forces), lambda late: late_outputs(m, run, z, forces, late))


def approach_changes(lane: Lane, pull: Pull) -> np.ndarray:
    """What a pull changes in the contacts' deflections and their rates, (steps, 2 n)."""
    m, names = lane.modes, SIGNALS["contact"]
    forcing = forced(m, lane.step, len(lane.signals) - 1, **pull.tensions)
    out = observe(m, propagate(m, lane.step, forcing, pull.start), names)
    for port, tension in pull.tensions.items():
        out += direct(m, names, port, lambda tension=tension: tension)
    return out


def _stepped(lanes: list[Lane], laws, matrices, rows, start) -> np.ndarray:
    """Tensions (lanes, t, n a port), stepped block by block: one program for all lengths."""
    shared = all(x.signals is lanes[0].signals for x in lanes)

    def inputs(first: int, last: int):
        some = lanes[:1] if shared else lanes
        return np.stack([padded(x.signals[first:last], last - first) for x in some], axis=1)

    blocks = -(-max(len(x.signals) for x in lanes) // BLOCK)
    step = np.array([x.step for x in lanes])
    state = (*start, *forces(laws, rows, *start, inputs(0, 1)[0]), step)
    out = np.empty((len(lanes), 1 + blocks * BLOCK, state[2].shape[1]))
    out[:, 0] = state[2]
    for k in range(blocks):
        here = 1 + k * BLOCK, 1 + (k + 1) * BLOCK
        state, tensions = step_laws(laws, matrices, rows, state, inputs(*here))
        out[:, slice(*here)] = np.swapaxes(tensions, 0, 1)
    return out


def _stack(items):
    return jax.tree.map(lambda *x: np.stack(x), *items)


def stepped_ports(rig: Rig) -> tuple[str, ...]:
    """Where laws that need stepping in time pull: contact (also for separation), mount or both."""
    used = {"contact" if port == "separation" else port for port in STEPPED if rig.at(port)}
    return tuple(port for port in SIGNALS if port in used)


@kept
def _static(laws: ElasticLaws, compliance, rows, signal):
    """Deviation d = compliance F(signal + rows d) at rest, with the laws' memories at rest.

    `simulate` finds the same rest of the whole state (`static_start`); here the linear run's is
    known, and lanes differ in numbers alone.
    """
    flat, unravel = ravel_pytree((jnp.zeros(compliance.shape[0]), laws.initial()))

    def gap(x):
        d, z = unravel(x)
        force, change = laws.tensions(signal + rows @ d, z)
        return ravel_pytree((d - compliance @ force, change))[0]

    def newton(x, _):
        step = jnp.linalg.solve(jax.jacfwd(gap)(x), gap(x))
        return x - step, None

    x, _ = jax.lax.scan(newton, flat, None, length=SETTINGS.prediction.rest_steps)
    return unravel(x)


def _static_deviation(laws: ElasticLaws, m: OutputModes, signal):
    """(d, memory) of the static start with the rig's contact and mount laws."""
    ports = laws.ports
    still = signal.reshape(len(ports), 2, -1) * np.array([1.0, 0.0])[:, None]
    compliance = -np.linalg.solve(m.A, _columns(m, ports))
    return _static(laws, compliance, m.out(signal_names(ports))[0], still.ravel())


def _columns(m: OutputModes, ports: tuple[str, ...]) -> np.ndarray:
    """What tensions (n a port) do to the state's rate."""
    return np.concatenate([m.B[:, m.inputs[port]] for port in ports], axis=1)


def step_matrices(m: OutputModes, h: float, ports) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(E, P, Q): d_next = E d + F P + F_next Q for tensions F linear over a step `h`.

    Full matrices, where `modes.hold_weights` has them by eigenvalue; a test holds the two and the
    solvers' phi functions together.
    """
    columns = _columns(m, ports)
    k, f = columns.shape
    big = np.zeros((k + 2 * f, k + 2 * f))
    big[:k, :k], big[:k, k : k + f] = m.A * h, columns * h
    big[k : k + f, k + f :] = np.eye(f)
    e = expm(big)
    first, second = e[:k, k : k + f], e[:k, k + f :]
    return e[:k, :k], (first - second).T, second.T


def _times(matrix, state):
    """matrix @ state, compiled into the step itself: a library call costs more than it does."""
    return jnp.sum(matrix * state, axis=-1)


def _pulled(force, matrix):
    """force @ matrix, number by number: so few are faster as one sum than in a loop."""
    return sum(f * row for f, row in zip(force, matrix, strict=True))


def _force(laws: ElasticLaws, rows, d, memory, signal):
    return laws.tensions(signal + _times(rows, d), memory)


@kept
def forces(laws: ElasticLaws, rows, d, memory, signal):
    """Tensions (lanes, n a port) at one moment, and the rates of the laws' memories."""
    return jax.vmap(_force)(laws, rows, d, memory, _for_all(signal, len(d)))


def _for_all(signal, lanes: int):
    """Signals of one moment (lanes or 1, ...) for every lane."""
    return jnp.broadcast_to(signal, (lanes, *signal.shape[1:]))


def _led_to(before, predicted, corrected):
    """Where tensions end that are asked for again and again at what the last ones cause.

    By Aitken's rule for each: a dry friction about rest, or whatever else damps strongly, falls
    short of the corrector about as often as it passes it, and its steps would have to be shorter.
    """
    change, last = corrected - predicted, predicted - before
    rate = change / jnp.where(last == 0, 1.0, last)
    return predicted + change / (1 - jnp.minimum(jnp.where(last == 0, 0.0, rate), KEPT_CHANGE))


@kept
def step_laws(laws: ElasticLaws, matrices, rows, start, signals):
    """(state, tensions (t, lanes, n a port)) of the laws, with the deviation they cause.

    d = state less the linear run's; the laws feel the linear `signals` (t, lanes, 2 n a port), or
    (t, 1, ..) for all lanes, plus `rows` d.  Heun's predictor and corrector around the exact linear
    step, and where these two lead.
    """

    def of_lane(laws, matrices, rows, start, own):
        E, P, Q = matrices

        def step(carry, here):
            d, memory, F, change, h = carry
            free = _times(E, d) + _pulled(F, P)
            guess = jax.tree.map(lambda z, c: z + h * c, memory, change)
            F1, change1 = _force(laws, rows, free + _pulled(F, Q), guess, here)
            memory = jax.tree.map(lambda z, c, c1: z + h / 2 * (c + c1), memory, change, change1)
            F2, change2 = _force(laws, rows, free + _pulled(F1, Q), memory, here)
            F = _led_to(F, F1, F2)
            return (free + _pulled(F, Q), memory, F, change2, h), F

        return jax.lax.scan(step, start, signals[:, 0] if own is None else own)

    own = None if signals.shape[1] == 1 else jnp.swapaxes(signals, 0, 1)
    state, tensions = side_by_side(of_lane)(laws, matrices, rows, start, own)
    return state, jnp.swapaxes(tensions, 0, 1)
