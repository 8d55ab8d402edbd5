"""Tensions of a rig's contact and mount laws from the signals of its elastic model."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ....dynamics import contact_forces, contact_signals, mount_signals, mount_tensions
from ....rig import Acting, Rig, acting


class ElasticLaws(eqx.Module):
    """Laws of contacts, mounts and separation with masks: one program serves a law anywhere."""

    rig: Rig  # without laws and profiles
    contact: tuple[Acting, ...]
    mount: tuple[Acting, ...]
    separation: tuple[Acting, ...]

    @staticmethod
    def of(rig: Rig) -> "ElasticLaws":
        """The laws of a rig."""
        ports = ("contact", "mount", "separation")
        return ElasticLaws(bare(rig), *(acting(rig.at(p), rig.size, masked=True) for p in ports))

    def initial(self) -> tuple[Any, ...]:
        """Rest states of the laws' memories, (n, ...) each."""
        return tuple(law.rest(self.rig.size) for law in (*self.contact, *self.mount))

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
            forces = contact_forces(self.contact, self.separation, signal, memory[:k])
            total.append(forces.tension)
            rates = forces.memory_rates
        if "mount" in self.ports:
            signal = mount_signals(self.rig, next(parts), next(parts))
            pull, more = mount_tensions(self.mount, signal, memory[k:])
            total.append(pull)
            rates = (*rates, *more)
        return jnp.concatenate(total), rates


def radii(rig: Rig) -> np.ndarray:
    """`Rig.wheel_radius` (n,) in m, without a way through jax where no law changes it."""
    return np.asarray(rig.wheel_radius if rig.at("radius") else rig.wheels.radius)


def bare(rig: Rig) -> Rig:
    """The rig without laws and profiles, at the wheels' radius with laws: one structure for all."""
    return eqx.tree_at(
        lambda r: (r.effects, r.profiles, r.wheels.radius), rig, ((), (), radii(rig)),
        is_leaf=lambda x: x is rig.effects or x is rig.profiles,
    )  # fmt: skip
