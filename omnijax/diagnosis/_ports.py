"""Tensions of a rig's contact and mount laws from the signals of its elastic model."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..dynamics import contact_signals, mount_signals
from ..rig import Rig


class ElasticLaws(eqx.Module):
    """Laws of contacts, mounts and separation, each with a mask (n,) of the wheels it acts on.

    Masks are numbers: one compiled program serves a law at every place.
    """

    rig: Rig  # without laws and profiles
    contact: tuple[tuple[Any, jax.Array], ...]
    mount: tuple[tuple[Any, jax.Array], ...]
    separation: tuple[tuple[Any, jax.Array], ...]

    @staticmethod
    def of(rig: Rig) -> "ElasticLaws":
        """The laws of a rig."""

        def masked(port: str):
            wheels = np.arange(rig.size)
            return tuple((p.law, jnp.asarray(np.isin(wheels, p.wheels))) for p in rig.at(port))

        return ElasticLaws(bare(rig), masked("contact"), masked("mount"), masked("separation"))

    def initial(self) -> tuple[Any, ...]:
        """Rest states of the laws' memories, (n, ...) each."""
        n = self.rig.size
        return tuple(
            jax.tree.map(lambda z: jnp.broadcast_to(z, (n, *jnp.shape(z))), law.initial())
            for law, _ in (*self.contact, *self.mount)
        )

    def tensions(self, signals, shape_rate, memory):
        """Tensions (2 n) that contact, separation and mount laws add, and their memories' rates.

        `signals` (4 n): deflection, mount deflection, its rate, rate of approach.
        """
        deflection, on_mount, mount_rate, approach_rate = jnp.split(signals, 4)
        contact = contact_signals(self.rig, deflection, approach_rate - mount_rate - shape_rate)
        mount = mount_signals(self.rig, on_mount, mount_rate)
        k = len(self.contact)
        extra, rates = _total(self.contact, contact, memory[:k])
        pull, pull_rates = _total(self.mount, mount, memory[k:])
        linear = contact.stiffness * contact.deflection + contact.damping * contact.rate
        normal = contact.preload - linear - extra
        for law, on in self.separation:
            extra = extra - jnp.where(on, jax.vmap(law)(normal), 0.0)
        total = jnp.concatenate([jnp.zeros(self.rig.size) + extra, jnp.zeros(self.rig.size) + pull])
        return total, (*rates, *pull_rates)


def _total(laws, signals, memory):
    total, rates = 0.0, []
    for (law, on), state in zip(laws, memory, strict=True):
        total = total + jnp.where(on, jax.vmap(law)(signals, state), 0.0)
        rates.append(jax.vmap(law.rate)(signals, state))
    return total, tuple(rates)


def bare(rig: Rig, *ports: str) -> Rig:
    """The rig with the laws of some ports only and no profiles: one structure for many runs."""
    keep = tuple(placed for port in ports for placed in rig.at(port))
    return eqx.tree_at(
        lambda r: (r.effects, r.profiles), rig, (keep, ()),
        is_leaf=lambda x: x is rig.effects or x is rig.profiles,
    )  # fmt: skip
