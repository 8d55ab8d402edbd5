"""Vibration metrics of the steady state, under the names that runs have, and the load of contacts.

The contacts' forces too are linear in the elastic state and the forcing's terms, so their extremes
over all phases are sums, N_i = N0_i + sum_g N_ig(phi_g).
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._root import root
from ..rig import Rig
from ..simulation import LongRun, fourier, line_rates, line_response
from ._comfort import weighting
from ._metrics import known, up

LINES = 64  # harmonics of the weighted acceleration
SHARPNESS = 64.0


class ContactLoad(NamedTuple):
    """Extremes over all phases, one entry a contact, N."""

    least: Float[Array, " n"]  # normal force
    greatest: Float[Array, " n"]
    slip_margin: Float[Array, " n"]  # least mu N - |f|


class SteadyRun(LongRun):
    """A rig at constant speeds in the long run, with the metrics that runs have."""

    _load: ContactLoad | None = None

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
        rates, vertical, total = line_rates(self.signals, LINES), up(self.rig), jnp.zeros(())
        for g in range(len(self.signals.wheel)):
            pieces = jax.tree.map(lambda x, g=g: x[g], self.signals.cycle.pieces)
            rate = rates[g, 1:]
            lines = jax.vmap(lambda w, g=g: line_response(self.system, g, w, "a_sphere"))(rate)
            lines = 2 * fourier(pieces, LINES)[1:, None] * lines
            along = lines @ vertical
            across = lines - along[:, None] * vertical
            hertz = rate / (2 * math.pi)
            total += jnp.sum(_square(along) * weighting(hertz, "vertical") ** 2) / 2
            level = weighting(hertz, "horizontal")[:, None]
            total += jnp.sum(_square(across) * level**2) / 2
        return root(total)


def _square(x):
    return jnp.real(x) ** 2 + jnp.imag(x) ** 2


def _component(i: int, axis: str) -> dict[str, Callable[[SteadyRun], Array]]:
    return {
        f"peak_{axis}": lambda run: jnp.max(run.extremes("dR"), axis=0)[i],
        f"rms_{axis}": lambda run: root(run.mean_square("dR")[i]),
        f"peak_to_peak_{axis}": lambda run: jnp.sum(run.extremes("dR"), axis=0)[i],
        f"elastic_rms_{axis}": lambda run: root(run.mean_square("dR_elastic")[i]),
    }


_OF: dict[str, Callable[[SteadyRun], Array]] = {
    "peak": lambda run: run.suprema("dR")[0],
    "rms": lambda run: root(jnp.sum(run.mean_square("dR"))),
    "smooth_peak": lambda run: run.smooth_peak("dR", SHARPNESS),
    "elastic_peak": lambda run: run.suprema("dR_elastic")[0],
    "elastic_rms": lambda run: root(jnp.sum(run.mean_square("dR_elastic"))),
    **_component(0, "x"),
    **_component(1, "y"),
    **_component(2, "z"),
    "acceleration_rms": lambda run: root(jnp.sum(run.mean_square("a_sphere"))),
    "acceleration_peak": lambda run: run.suprema("a_sphere")[0],
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
    return SteadyRun(rig, speeds, jnp.zeros(rig.size) if angles is None else angles, model).load()


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
    run = SteadyRun(rig, jnp.asarray(speeds, float), angles, model)
    return {name: run.metric(name) for name in names}
