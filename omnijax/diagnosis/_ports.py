"""Tensions of a rig's contact and mount laws from the signals of its elastic model."""

import equinox as eqx
import jax
import jax.numpy as jnp

from ..dynamics import contact_signals, mount_signals
from ..rig import Rig, over_wheels


def law_tensions(rig: Rig, signals, shape_rate, memory):
    """Tensions (2 n) that contact, separation and mount laws add, and their memories' rates.

    `signals` (4 n): deflection, mount deflection, its rate, rate of approach.
    """
    deflection, on_mount, mount_rate, approach_rate = jnp.split(signals, 4)
    contact = contact_signals(rig, deflection, approach_rate - mount_rate - shape_rate)
    mount = mount_signals(rig, on_mount, mount_rate)
    n, k = rig.size, len(rig.at("contact"))
    extra, rates = _total(rig.at("contact"), contact, memory[:k], n)
    pull, pull_rates = _total(rig.at("mount"), mount, memory[k:], n)
    if rig.at("separation"):
        linear = contact.stiffness * contact.deflection + contact.damping * contact.rate
        normal = contact.preload - linear - extra
        extra = extra - over_wheels(rig.at("separation"), normal, n)
    return jnp.concatenate([extra, pull]), (*rates, *pull_rates)


def _total(placed, signals, memory, size):
    total, rates = jnp.zeros(size), []
    for term, state in zip(placed, memory, strict=True):
        index = jnp.asarray(term.wheels)
        here = jax.tree.map(lambda x, i=index: x[i], signals)
        total = total.at[index].add(jax.vmap(term.law)(here, state))
        rates.append(jax.vmap(term.law.rate)(here, state))
    return total, tuple(rates)


def bare(rig: Rig, *ports: str) -> Rig:
    """The rig with the laws of some ports only and no profiles: one structure for many runs."""
    keep = tuple(placed for port in ports for placed in rig.at(port))
    return eqx.tree_at(
        lambda r: (r.effects, r.profiles), rig, (keep, ()),
        is_leaf=lambda x: x is rig.effects or x is rig.profiles,
    )  # fmt: skip
