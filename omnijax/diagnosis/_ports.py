"""Contact and mount laws of a rig from the signals that its wheels feel."""

import jax
import jax.numpy as jnp

from ..laws import ContactSignal, MountSignal
from ..rig import Rig, over_wheels


def wheel_signals(rig: Rig, signals, shape_rate) -> tuple[ContactSignal, MountSignal]:
    """Signals of contacts and mounts from (4 n): deflection, mount, mount rate, approach rate."""
    deflection, mount, mount_rate, approach_rate = jnp.split(signals, 4)
    wheels = rig.wheels
    contact = wheels.contact
    n = rig.size
    reduced = rig.sphere.radius * wheels.radius / (rig.sphere.radius + wheels.radius)
    rate = approach_rate - mount_rate - shape_rate
    return (
        ContactSignal(
            deflection,
            rate,
            contact.stiffness,
            contact.damping,
            wheels.closure.preload,
            jnp.broadcast_to(reduced, (n,)),
        ),
        MountSignal(mount, mount_rate, wheels.mount.stiffness, wheels.mount.damping),
    )


def law_tensions(rig: Rig, signals, shape_rate, memory):
    """Tensions (2 n) that contact, separation and mount laws add, and their memories' rates."""
    contact, mount = wheel_signals(rig, signals, shape_rate)
    n, k = rig.size, len(rig.at("contact"))
    extra, rates = _total(rig.at("contact"), contact, memory[:k], n)
    on_mount, mount_rates = _total(rig.at("mount"), mount, memory[k:], n)
    if rig.at("separation"):
        linear = contact.stiffness * contact.deflection + contact.damping * contact.rate
        normal = contact.preload - linear - extra
        extra = extra - over_wheels(rig.at("separation"), normal, n)
    return jnp.concatenate([extra, on_mount]), (*rates, *mount_rates)


def _total(placed, signals, memory, size):
    total, rates = jnp.zeros(size), []
    for term, state in zip(placed, memory, strict=True):
        index = jnp.asarray(term.wheels)
        here = jax.tree.map(lambda x, i=index: x[i], signals)
        total = total.at[index].add(jax.vmap(term.law)(here, state))
        rates.append(jax.vmap(term.law.rate)(here, state))
    return total, tuple(rates)
