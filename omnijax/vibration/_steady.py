"""Vibration metrics of the steady state, under the names that runs have, and the load of contacts.

Leaner than `steady_state`: only what is asked for is computed, which counts where thousands of
designs are compiled into one search.  Every output is linear in z, the elastic state beside the
forcing's terms, so its extremes over all phases are sums of extremes of each signal's own part,
N_i = N0_i + sum_g N_ig(phi_g).
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..rig import Rig
from ..simulate.exact import steady_state
from ..simulate.exact._cycles import forcing
from ..simulate.exact._ladder import second_moments
from ..simulate.exact._passage import passages, periodic_starts
from ..simulate.exact._peaks import Curves, _sphere
from ..simulate.exact._spectrum import _rates, _response, fourier
from ..simulate.exact._steady import _statistics, output_rows
from ..simulate.exact._system import balanced, forced_system
from ._amplitude import root
from ._comfort import weighting
from ._extremes import BITS, Places, places, refined
from ._metrics import known, up

LEVELS = 24  # of the ladder: up to 2^22 time constants a piece
LINES = 64  # harmonics of the weighted acceleration
SHARPNESS = 64.0
DIRECTIONS = 400  # to begin with
ROUNDS = 2  # of direction and places
CANDIDATES = 8  # directions in which a supremum is looked for


class ContactLoad(NamedTuple):
    """Extremes over all phases, one entry a contact, N."""

    least: Float[Array, " n"]  # normal force
    greatest: Float[Array, " n"]
    slip_margin: Float[Array, " n"]  # least mu N - |f|


class LongRun:
    """The periodic solution of every signal of a rig at constant speeds."""

    def __init__(self, rig: Rig, speeds, angles, model: str):
        self.rig, self.speeds, self.angles, self.model = rig, speeds, angles, model
        self.signals = forcing(rig, speeds, angles)
        raw = forced_system(rig, model, speeds, self.signals.wheel)
        self.system, _ = balanced(raw)
        self.cycles = passages(self.system, self.signals, BITS, LEVELS)
        self.states = self.system.A.shape[0]
        self.starts = periodic_starts(self.cycles, self.states)
        self._moments = self._places = self._load = None

    def curves(self, *names: str) -> Curves:
        """Outputs beside each other."""
        rows = [output_rows(self.system, self.signals, self.cycles, n) for n in names]
        return Curves(self.cycles, self.starts, jnp.concatenate(rows, axis=-2))

    def mean_square(self, name: str) -> Float[Array, " o"]:
        """Mean square of each component, over all phases."""
        if self._moments is None:
            self._moments = jax.vmap(jax.vmap(second_moments))(self.cycles.pieces, self.starts)
        width = self.cycles.width
        weight = width / jnp.sum(width, axis=1, keepdims=True)
        return _statistics(self.curves(name), self._moments, weight, self.states)[1]

    def places(self) -> Places:
        """Where extremes are looked for."""
        if self._places is None:
            self._places = places(self.cycles, self.starts)
        return self._places

    def largest(self, curves: Curves, rows: Float[Array, "r o"]) -> Float[Array, " r"]:
        """The largest value of each combination `rows` of the outputs."""
        found = self.places()
        index = jnp.argmax(found.along(found.outputs(curves.rows), rows), axis=1).T

        def one(row, i):
            return jnp.sum(refined(curves, found, i, row) @ row)

        return jax.vmap(one)(rows, index)

    def supremum(self, name: str) -> Float[Array, ""]:
        """Largest length of an output that is a vector: over directions, then places."""
        curves, found = self.curves(name), self.places()
        values = found.outputs(curves.rows)

        def support(d):
            along = found.along(values, d)
            return jnp.argmax(along, axis=1), jnp.sum(jnp.max(along, axis=1), axis=0)

        directions = jnp.asarray(_sphere(DIRECTIONS, values.shape[-1]))
        best = directions[jnp.argsort(-support(directions)[1])[:CANDIDATES]]

        def ascend(best, _):  # the sum found in a direction is the next direction
            index = support(best)[0]
            total = jnp.sum(jax.vmap(lambda v, i: v[i])(values, index), axis=0)
            size = jnp.sqrt(jnp.sum(total**2, axis=1, keepdims=True))
            return jnp.where(size > 0, total / jnp.where(size > 0, size, 1.0), best), None

        best = jax.lax.scan(ascend, best, None, length=6)[0]
        index, height = support(best)
        chosen = jnp.argmax(height)
        index, row = index[:, chosen], best[chosen]
        for _ in range(ROUNDS):  # the sum at the refined places is the next direction
            total = jnp.sum(refined(curves, found, index, row), axis=0)
            size = jax.lax.stop_gradient(root(total @ total))
            row = jax.lax.stop_gradient(total) / jnp.where(size > 0, size, 1.0)
        total = jnp.sum(refined(curves, found, index, row), axis=0)
        return root(total @ total)

    def extremes(self, name: str) -> Float[Array, "2 o"]:
        """Largest value of each component, and of its negative."""
        curves = self.curves(name)
        eye = jnp.eye(curves.rows.shape[-2])
        return self.largest(curves, jnp.concatenate([eye, -eye])).reshape(2, -1)

    def metric(self, name: str) -> Float[Array, ""]:
        """One of `STEADY_METRICS`."""
        return _OF[name](self)

    def load(self) -> ContactLoad:
        """Extremes of the contacts' forces."""
        if self._load is None:
            self._load = self._extreme_load()
        return self._load

    def _extreme_load(self) -> ContactLoad:
        n = self.rig.size
        eye, zero = jnp.eye(n), jnp.zeros((n, n))
        friction, preload = self.rig.wheels.contact.friction, self.rig.wheels.closure.preload
        mu = jnp.diag(friction)
        rows = jnp.block([[eye, zero], [-eye, zero], [-mu, eye], [-mu, -eye]])
        curves = self.curves("normal_force", "drive_force")
        high, low, forth, back = self.largest(curves, rows).reshape(4, n)
        slip = friction * preload - jnp.maximum(forth, back)
        return ContactLoad(preload - low, preload + high, slip)

    def weighted(self) -> Float[Array, ""]:
        """sqrt(sum over signals, harmonics, directions of |a|^2 W^2 / 2), W as in ISO 2631-1."""
        rates, vertical, total = _rates(self.signals, LINES), up(self.rig), jnp.zeros(())
        for g in range(len(self.signals.wheel)):
            pieces = jax.tree.map(lambda x, g=g: x[g], self.signals.cycle.pieces)
            rate = rates[g, 1:]
            lines = jax.vmap(lambda w, g=g: _response(self.system, g, w, "a_sphere"))(rate)
            lines = 2 * fourier(pieces, LINES)[1:, None] * lines
            along = lines @ vertical
            across = lines - along[:, None] * vertical
            hertz = rate / (2 * math.pi)
            total += jnp.sum(_square(along) * weighting(hertz, "vertical") ** 2) / 2
            level = weighting(hertz, "horizontal")[:, None]
            total += jnp.sum(_square(across) * level**2) / 2
        return root(total)

    def smooth_peak(self) -> Float[Array, ""]:
        """The p-norm over the phases, p = 64."""
        state = steady_state(
            self.rig, self.speeds, model=self.model, angles=self.angles, grid_bits=BITS,
            sharpness=SHARPNESS,
        )  # fmt: skip
        return state.peak


def _square(x):
    return jnp.real(x) ** 2 + jnp.imag(x) ** 2


def _component(i: int, axis: str) -> dict[str, Callable[[LongRun], Array]]:
    return {
        f"peak_{axis}": lambda run: jnp.max(run.extremes("dR"), axis=0)[i],
        f"rms_{axis}": lambda run: root(run.mean_square("dR")[i]),
        f"peak_to_peak_{axis}": lambda run: jnp.sum(run.extremes("dR"), axis=0)[i],
        f"elastic_rms_{axis}": lambda run: root(run.mean_square("dR_elastic")[i]),
    }


_OF: dict[str, Callable[[LongRun], Array]] = {
    "peak": lambda run: run.supremum("dR"),
    "rms": lambda run: root(jnp.sum(run.mean_square("dR"))),
    "smooth_peak": lambda run: run.smooth_peak(),
    "elastic_peak": lambda run: run.supremum("dR_elastic"),
    "elastic_rms": lambda run: root(jnp.sum(run.mean_square("dR_elastic"))),
    **_component(0, "x"),
    **_component(1, "y"),
    **_component(2, "z"),
    "acceleration_rms": lambda run: root(jnp.sum(run.mean_square("a_sphere"))),
    "acceleration_peak": lambda run: run.supremum("a_sphere"),
    "weighted_acceleration": lambda run: run.weighted(),
    "slip_margin": lambda run: jnp.min(run.load().slip_margin),
    "lift_off_margin": lambda run: jnp.min(run.load().least),
}

STEADY_METRICS = tuple(_OF)


@eqx.filter_jit
def contact_load(
    rig: Rig, speeds: Float[Array, " n"], model: str = "coupled", angles=None
) -> ContactLoad:
    """Extremes of the contacts' normal forces and slip margins at constant `speeds` (rad/s)."""
    return LongRun(rig, speeds, jnp.zeros(rig.size) if angles is None else angles, model).load()


def steady_metrics(
    rig: Rig,
    speeds: Float[Array, " n"],
    names: tuple[str, ...],
    *,
    model: str = "coupled",
    angles: Float[Array, " n"] | None = None,
) -> dict[str, Float[Array, ""]]:
    """The named metrics of the steady state at constant `speeds` (rad/s); differentiable.

    Every metric of runs but `peak_to_peak` of |dR| (its least value over independent phases has no
    closed form).  `smooth_peak` is a p-norm over the phases with p = 64.
    """
    for name in names:
        if known(name) not in _OF:
            raise ValueError(f"`{name}` has no steady-state form; give a `duration`.")
    angles = jnp.zeros(rig.size) if angles is None else angles
    run = LongRun(rig, jnp.asarray(speeds, float), angles, model)
    return {name: run.metric(name) for name in names}
