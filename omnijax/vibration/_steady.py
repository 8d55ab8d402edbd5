"""Vibration metrics of the steady state, under the names that runs have, and the load of contacts.

Normal and drive forces are linear in the elastic state, so their extremes over all phases of the
wheels are sums of the extremes of each signal's own part: N_i = N0_i + sum_g N_ig(phi_g).
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..rig import Rig
from ..simulate.exact import SteadyState, steady_state
from ..simulate.exact._cycles import forcing
from ..simulate.exact._ladder import LEVELS
from ..simulate.exact._passage import passages, periodic_starts
from ..simulate.exact._peaks import (
    Curves,
    component_places,
    grid,
    present,
    supremum_places,
    values_at,
)
from ..simulate.exact._spectrum import _rates, _response, fourier
from ..simulate.exact._steady import output_rows
from ..simulate.exact._system import balanced, forced_system
from ._amplitude import root
from ._comfort import weighting
from ._metrics import known, up

BITS = 6  # 2^BITS search points a piece before Newton's method
LINES = 64  # harmonics of the weighted acceleration
SHARPNESS = 64.0

_FROM_STATE: dict[str, Callable[[SteadyState], Array]] = {
    "peak": lambda s: s.peak,
    "rms": lambda s: s.rms,
    "elastic_peak": lambda s: s.peak_elastic,
    "elastic_rms": lambda s: s.rms_elastic,
    "acceleration_rms": lambda s: s.rms_acceleration,
    **{f"peak_{a}": lambda s, i=i: s.peak_component[i] for i, a in enumerate("xyz")},
    **{f"rms_{a}": lambda s, i=i: s.rms_component[i] for i, a in enumerate("xyz")},
    **{f"peak_to_peak_{a}": lambda s, i=i: s.peak_to_peak[i] for i, a in enumerate("xyz")},
}


class ContactLoad(NamedTuple):
    """Extremes over all phases, one entry a contact, N."""

    least: Float[Array, " n"]  # normal force
    greatest: Float[Array, " n"]
    slip_margin: Float[Array, " n"]  # least mu N - |f|


class _Long(NamedTuple):
    """The periodic solution of every signal, and what reads outputs off it."""

    system: object
    signals: object
    cycles: object
    starts: Array

    def curves(self, *names: str) -> Curves:
        rows = [output_rows(self.system, self.signals, self.cycles, n) for n in names]  # pyright: ignore
        return Curves(self.cycles, self.starts, jnp.concatenate(rows, axis=-2))  # pyright: ignore


def _long_run(rig: Rig, speeds, angles, model: str) -> _Long:
    signals = forcing(rig, speeds, angles)
    system, _ = balanced(forced_system(rig, model, speeds, signals.wheel))
    cycles = passages(system, signals, BITS, LEVELS)
    return _Long(system, signals, cycles, periodic_starts(cycles, system.A.shape[0]))


@eqx.filter_jit
def contact_load(
    rig: Rig,
    speeds: Float[Array, " n"],
    model: str = "coupled",
    angles=None,
    refined: bool = True,
) -> ContactLoad:
    """Extremes of the contacts' normal forces and slip margins at constant `speeds` (rad/s).

    Without `refined` those on the 2^BITS search points of each piece, at a tenth of the cost.
    """
    n = rig.size
    angles = jnp.zeros(n) if angles is None else angles
    curves = _long_run(rig, speeds, angles, model).curves("normal_force", "drive_force")
    eye, zero = jnp.eye(n), jnp.zeros((n, n))
    mu = jnp.diag(rig.wheels.contact.friction)
    rows = [[eye, zero], [-eye, zero], [-mu, eye], [-mu, -eye]]

    def largest(row):
        if not refined:
            along = jnp.where(present(curves, BITS), grid(curves, BITS) @ row, -jnp.inf)
            return jnp.sum(jnp.max(along, axis=1))
        return jnp.sum(values_at(curves, component_places(curves, row, BITS)) @ row)

    high, low, forth, back = jax.vmap(largest)(jnp.block(rows)).reshape(4, n)
    preload = rig.wheels.closure.preload
    slip = rig.wheels.contact.friction * preload - jnp.maximum(forth, back)
    return ContactLoad(preload - low, preload + high, slip)


def _acceleration_peak(rig: Rig, speeds, angles, model: str):
    curves = _long_run(rig, speeds, angles, model).curves("a_sphere")
    total = jnp.sum(values_at(curves, supremum_places(curves, BITS)), axis=0)
    return root(jnp.sum(total**2))


def _weighted(rig: Rig, speeds, angles, model: str):
    """sqrt(sum over signals, harmonics, directions of |a|^2 W^2 / 2), W as in ISO 2631-1."""
    signals = forcing(rig, speeds, angles)
    system, _ = balanced(forced_system(rig, model, speeds, signals.wheel))
    rates, vertical, total = _rates(signals, LINES), up(rig), 0.0
    for g in range(len(signals.wheel)):
        shape = fourier(jax.tree.map(lambda x, g=g: x[g], signals.cycle.pieces), LINES)[1:]
        rate = rates[g, 1:]
        lines = jax.vmap(lambda w, g=g: _response(system, g, w, "a_sphere"))(rate)
        lines = 2 * shape[:, None] * lines
        along = lines @ vertical
        across = lines - along[:, None] * vertical
        hertz = rate / (2 * math.pi)
        total += jnp.sum(_square(along) * weighting(hertz, "vertical") ** 2) / 2
        level = weighting(hertz, "horizontal")[:, None]
        total += jnp.sum(_square(across) * level**2) / 2
    return root(total)


def _square(x):
    return jnp.real(x) ** 2 + jnp.imag(x) ** 2


_OTHERS = {
    "acceleration_peak": _acceleration_peak,
    "weighted_acceleration": _weighted,
    "slip_margin": lambda r, w, a, m: jnp.min(contact_load(r, w, m, a).slip_margin),
    "lift_off_margin": lambda r, w, a, m: jnp.min(contact_load(r, w, m, a).least),
    "smooth_peak": lambda r, w, a, m: (
        steady_state(r, w, model=m, angles=a, grid_bits=BITS, sharpness=SHARPNESS).peak
    ),
}

STEADY_METRICS = (*_FROM_STATE, *_OTHERS)


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
        if known(name) not in STEADY_METRICS:
            raise ValueError(f"`{name}` has no steady-state form; give a `duration`.")
    angles = jnp.zeros(rig.size) if angles is None else angles
    speeds = jnp.asarray(speeds, float)
    found = {}
    if any(name in _FROM_STATE for name in names):
        state = steady_state(rig, speeds, model=model, angles=angles, grid_bits=BITS)
        found = {name: of(state) for name, of in _FROM_STATE.items() if name in names}
    found |= {n: _OTHERS[n](rig, speeds, angles, model) for n in names if n in _OTHERS}
    return {name: found[name] for name in names}
