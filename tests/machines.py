"""Rigs for tests, built from the classes alone; no two numbers of a rig are equal by accident."""

from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from omnijax import laws
from omnijax.rig import Closure, Contact, Mount, Platform, Rig, Sphere, Wheels
from omnijax.simulation import Operating

DATA = Path(__file__).parent / "data"
RECORDINGS = DATA / "recordings"  # of an independent program

# four wheels and more at speeds drawn one by one, which fit no motion of the sphere: any will do
# where two ways to the same figures are held against each other
ANY_SPEEDS = pytest.mark.filterwarnings("ignore:The speeds do not fit each other")

ORTHOGONAL = ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 0, 1], [1, 0, 0], [0, 1, 0]])
_S, _C = np.sin(0.8), np.cos(0.8)
_AROUND = np.deg2rad([0.0, 125.0, 236.0])
SKEW = (
    [[-_S * np.cos(a), -_S * np.sin(a), _C] for a in _AROUND],
    [[-np.sin(a), np.cos(a), 0.0] for a in _AROUND],
)


def machine(layout=SKEW, *, profile=None, scale=1.0, **changes) -> Rig:
    """A rig with unequal wheels on `layout`; `changes`: `contact_damping`, `roundness`, …"""
    normal, drive = (jnp.asarray(x, float) for x in layout)
    n = len(normal)
    spread = 1 + 0.1 * scale * jnp.arange(n)

    def value(name, default):
        return jnp.broadcast_to(jnp.asarray(changes.get(name, default), float), (n,))

    wheels = Wheels(
        normal=normal,
        drive=drive,
        radius=value("radius", 0.0758),
        mass=value("mass", 0.25 * spread),
        inertia=value("inertia", 7.2e-4 / spread),
        rollers=value("rollers", 14),
        roundness=value("roundness", 0.4485 / spread),
        contact=Contact(
            value("contact_stiffness", 188208.0 * spread),
            value("contact_damping", 120.0 / spread),
            value("friction", 0.9),
        ),
        mount=Mount(value("mount_stiffness", 1e6 / spread), value("mount_damping", 60.0 * spread)),
        closure=Closure(value("closure_stiffness", 2e4 * spread), value("preload", 150.0 / spread)),
    )
    sphere = Sphere(
        jnp.asarray(1.22),
        jnp.asarray(changes.get("sphere_mass", 5.0)),
        jnp.asarray(changes.get("sphere_inertia", 4.961)),
        jnp.asarray(changes.get("centre_of_mass", jnp.zeros(3)), float),
    )
    platform = Platform(
        jnp.asarray(changes.get("platform_mass", 6.0)),
        jnp.asarray(changes.get("gravity", [0.0, 0.0, 0.0]), float),
    )
    profiles = (profile or laws.GatedSine(),) * n
    return Rig(sphere, platform, wheels, profiles, (), tuple(f"w{i + 1}" for i in range(n)))


def operating_at(rig: Rig, row) -> Operating:
    """Speeds, a force on the platform and start angles beside each other in a row."""
    n = rig.size
    return Operating(rig, row[:n], row[n : n + 3], row[n + 3 :])


SINES = (laws.HalfSine(), laws.GatedSine(), laws.ContinuousSine(), laws.Rollers())


def drawn_machine(rng, n: int, first=None, **changes) -> Rig:
    """`n` unlike wheels around the sphere in no symmetry, each with a profile of `SINES`.

    `first`: the first wheel's profile, otherwise drawn as well.
    """
    around = 2 * np.pi * np.arange(n) / n + rng.uniform(-0.15, 0.15, n)
    tilt = 0.8 + rng.uniform(-0.15, 0.15, n)
    across = np.sin(tilt)[:, None] * np.stack([np.cos(around), np.sin(around)], axis=1)
    normal = np.column_stack([-across, np.cos(tilt)])
    drive = np.stack([-np.sin(around), np.cos(around), 0 * around], axis=1)
    drawn = {
        "contact_damping": rng.uniform(60, 400, n),
        "contact_stiffness": rng.uniform(1e5, 8e5, n),
        "mount_stiffness": rng.uniform(5e5, 3e6, n),
        "mount_damping": rng.uniform(30, 200, n),
        "roundness": rng.uniform(0.2, 0.6, n),
        "radius": rng.uniform(0.06, 0.09, n),
        "rollers": rng.integers(10, 18, n),
    }
    rig = machine((normal, drive), **(drawn | changes))
    profiles = [SINES[i] for i in rng.integers(len(SINES), size=n)]
    return eqx.tree_at(lambda r: r.profiles, rig, (first or profiles[0], *profiles[1:]))
