"""A rig in the long run at constant speeds, as the table of metrics reads it; contacts' load.

The contacts' forces too are linear in the elastic state and the forcing's terms, so their extremes
over all phases are sums, N_i = N0_i + sum_g N_ig(phi_g).
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._root import root
from .._status import Status
from ..rig import Rig, upright
from ..simulation import LongRun
from ._comfort import UPRIGHT_WEIGHTINGS, weighting_filter

SHARPNESS = 64.0


class ContactLoad(NamedTuple):
    """Extremes over all phases, one entry a contact, N."""

    least: Float[Array, " n"]  # normal force
    greatest: Float[Array, " n"]
    slip_margin: Float[Array, " n"]  # least mu N - |f|


class SteadyRun(LongRun):
    """A rig at constant speeds in the long run; `steady_metric` reads its metrics."""

    _load: ContactLoad | None = None

    def load(self) -> ContactLoad:
        """Extremes of the contacts' forces."""
        if self._load is None:
            self._load = ContactLoad(*self._extremes(*ContactLoad._fields))
        return self._load

    def least_normal_force(self) -> Float[Array, " n"]:
        """Least normal force of each contact, N: a part of `load` that costs a quarter of it."""
        return self._extreme("least")

    def greatest_normal_force(self) -> Float[Array, " n"]:
        """Greatest normal force of each contact, N: another quarter."""
        return self._extreme("greatest")

    def slip_margin(self) -> Float[Array, " n"]:
        """Least mu N - |f| of each contact, N: the other half.

        As the lesser of two linear figures, mu N - f and mu N + f, which one search finds.
        """
        return self._extreme("slip_margin")

    def _extreme(self, name: str) -> Float[Array, " n"]:
        return self._extremes(name)[0] if self._load is None else getattr(self._load, name)

    def _extremes(self, *names: str) -> list[Float[Array, " n"]]:
        """Figures of `ContactLoad`, all by one search over rows of (N, f)."""
        n, wheels = self.rig.size, self.rig.wheels
        eye, zero, preload = jnp.eye(n), jnp.zeros((n, n)), wheels.closure.preload
        friction = wheels.contact.friction
        mu = jnp.diag(friction)
        known = {
            "least": (jnp.hstack([-eye, zero]), lambda x: preload - x),
            "greatest": (jnp.hstack([eye, zero]), lambda x: preload + x),
            "slip_margin": (
                jnp.block([[-mu, eye], [-mu, -eye]]),
                lambda x: friction * preload - jnp.maximum(x[:n], x[n:]),
            ),
        }
        rows = [known[name][0] for name in names]
        curves = self.curves("normal_force", "drive_force")
        reached = self.largest(curves, jnp.concatenate(rows))
        each = jnp.split(reached, np.cumsum([len(x) for x in rows])[:-1])
        return [self.if_settled(known[name][1](x)) for name, x in zip(names, each, strict=True)]

    def if_settled(self, figure: Array) -> Array:
        """`figure`, or NaN where there is no steady state."""
        return jnp.where(self.status == Status.OK, figure, jnp.nan)

    def weighted(self) -> Float[Array, ""]:
        """RMS of the sphere's acceleration behind the filters of ISO 2631-1, m/s^2."""
        filters = [weighting_filter(way) for way in UPRIGHT_WEIGHTINGS]
        return root(jnp.sum(self.filtered("a_sphere", upright(self.rig), filters)))


@eqx.filter_jit
def contact_load(
    rig: Rig, speeds: Float[Array, " n"], model: str = "coupled", angles=None, force=None
) -> ContactLoad:
    """Extremes of the contacts' normal forces and slip margins at constant `speeds` (rad/s)."""
    angles = jnp.zeros(rig.size) if angles is None else angles
    return SteadyRun(rig, speeds, angles, model, force=force).load()
