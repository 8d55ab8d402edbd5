"""Rigs for tests, built from the classes alone; no two numbers of a rig are equal by accident."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from omnijax import laws
from omnijax.rig import Closure, Contact, Mount, Platform, Rig, Sphere, Wheels

SHARED = Path(__file__).parents[2] / "shared"

ORTHOGONAL = ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 0, 1], [1, 0, 0], [0, 1, 0]])
_S, _C = np.sin(0.8), np.cos(0.8)
_AROUND = np.deg2rad([0.0, 125.0, 236.0])
SKEW = (
    [[-_S * np.cos(a), -_S * np.sin(a), _C] for a in _AROUND],
    [[-np.sin(a), np.cos(a), 0.0] for a in _AROUND],
)


def shared(*parts: str) -> Path:
    """A path in the shared reference data, or a skipped test that says what is missing."""
    path = SHARED.joinpath(*parts)
    if not path.exists():
        pytest.skip(f"shared data {'/'.join(parts)} is not beside the project")
    return path


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
