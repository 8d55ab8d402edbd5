"""Tensions of a rig's contact and mount laws from the signals of its elastic model."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ...dynamics import contact_signals, mount_signals
from ...rig import Rig


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

    @property
    def ports(self) -> tuple[str, ...]:
        """Where these laws pull: contact, mount or both."""
        contact = ("contact",) if self.contact or self.separation else ()
        return (*contact, *(("mount",) if self.mount else ()))

    def tensions(self, signals, memory):
        """Tensions (n a port) that contact, separation and mount laws add, memories' rates.

        `signals` (2 n a port): deflections and their rates, of contacts and then of mounts, of the
        `ports` alone.
        """
        parts = iter(jnp.split(signals, 2 * len(self.ports)))
        k, total, rates = len(self.contact), [], ()
        if "contact" in self.ports:
            signal = contact_signals(self.rig, next(parts), next(parts))
            extra, rates = _total(self.contact, signal, memory[:k])
            linear = signal.stiffness * signal.deflection + signal.damping * signal.rate
            normal = signal.preload - linear - extra
            for law, on in self.separation:
                extra = extra - jnp.where(on, jax.vmap(law)(normal), 0.0)
            total.append(extra)
        if "mount" in self.ports:
            signal = mount_signals(self.rig, next(parts), next(parts))
            pull, more = _total(self.mount, signal, memory[k:])
            total.append(pull)
            rates = (*rates, *more)
        return jnp.concatenate(total), rates


def _total(laws, signals, memory):
    total, rates = jnp.zeros_like(signals.deflection), []
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
