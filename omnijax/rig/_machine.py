"""What the machine is: sphere, platform, wheels, and the laws placed on them."""

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._errors import InputError, did_you_mean
from ..laws import AbstractLaw, AbstractShape, DamagedRoller, Gap
from ._placed import Placed, over_wheels
from ._places import places_of, port_places


class Sphere(eqx.Module):
    """The driven sphere."""

    radius: Float[Array, ""]  # m, R
    mass: Float[Array, ""]  # kg, M_s
    inertia: Float[Array, ""] | Float[Array, "3 3"]  # kg m^2, about the centre, body frame
    centre_of_mass: Float[Array, "3"]  # m, from the geometric centre, body frame

    @property
    def inertia_matrix(self) -> Float[Array, "3 3"]:
        """Inertia as a matrix, kg m^2, body frame."""
        inertia = jnp.asarray(self.inertia)
        return inertia if inertia.ndim == 2 else inertia * jnp.eye(3)


class Platform(eqx.Module):
    """The translating platform without its wheels."""

    mass: Float[Array, ""]  # kg, M_l
    gravity: Float[Array, "3"]  # m/s^2


class Contact(eqx.Module):
    """Sphere-wheel contacts, one entry a wheel."""

    stiffness: Float[Array, " n"]  # N/m, K
    damping: Float[Array, " n"]  # N s/m, C
    friction: Float[Array, " n"]  # mu


class Mount(eqx.Module):
    """Wheel-platform mounts, one entry a wheel."""

    stiffness: Float[Array, " n"]  # N/m, k
    damping: Float[Array, " n"]  # N s/m, c


class Closure(eqx.Module):
    """Springs that hold the sphere on the wheels, one entry a wheel."""

    stiffness: Float[Array, " n"]  # N/m, K'
    preload: Float[Array, " n"]  # N, N0


class Wheels(eqx.Module):
    """All wheels, one entry a wheel on the leading axis."""

    normal: Float[Array, "n 3"]  # unit vectors wheel centre -> sphere centre
    drive: Float[Array, "n 3"]  # unit vectors of rim velocity at the contact, speed > 0
    radius: Float[Array, " n"]  # m, r_b
    mass: Float[Array, " n"]  # kg
    inertia: Float[Array, " n"]  # kg m^2
    rollers: Float[Array, " n"]  # rollers per row, a whole number
    roundness: Float[Array, " n"]  # eta
    contact: Contact
    mount: Mount
    closure: Closure

    @property
    def spin_axis(self) -> Float[Array, "n 3"]:
        """Sphere axes that the wheels drive, drive x normal = -normal x drive."""
        return jnp.cross(self.drive, self.normal)


class Rig(eqx.Module):
    """A whole machine of n wheels in SI: a sum of laws at ports.

    `sphere` has scalars in m, kg and kg m^2, `platform` its mass in kg and gravity (3,) in m/s^2,
    `wheels` one entry a wheel: (n,), vectors (n, 3).  `profiles` (n) holds one wheel shape a wheel,
    `effects` the laws added to the paper's model, `names` (n) the wheels' names and `uncertainty`
    pairs of (parameter path, 1-sigma: a share, or in rad, s, m).
    """

    sphere: Sphere
    platform: Platform
    wheels: Wheels
    profiles: tuple[AbstractShape, ...]
    effects: tuple[Placed, ...] = ()
    names: tuple[str, ...] = eqx.field(static=True, default=())
    uncertainty: tuple[tuple[str, float], ...] = eqx.field(static=True, default=())

    def _repr_html_(self) -> str:
        from ._facts import rig_html

        return rig_html(self)

    @property
    def size(self) -> int:
        """Number of wheels."""
        return len(self.names)

    @property
    def gaps(self) -> Gap:
        """Gap geometry with one entry a wheel."""
        n = self.size
        return Gap(
            jnp.broadcast_to(self.sphere.radius, (n,)),
            self.wheel_radius,
            jnp.asarray(self.wheels.rollers),
            jnp.asarray(self.wheels.roundness),
        )

    @property
    def wheel_radius(self) -> Float[Array, " n"]:
        """r_b with the laws at the port `radius`, m: the radius to calculate with."""
        radius = jnp.asarray(self.wheels.radius)
        placed = self.at("radius")
        return radius + over_wheels(placed, radius, self.size) if placed else radius

    @property
    def total_mass(self) -> Float[Array, ""]:
        """M_T = M_s + M_l + sum of m_i, kg."""
        return self.sphere.mass + self.platform.mass + jnp.sum(self.wheels.mass)

    @property
    def at(self) -> Callable[[str], tuple[Placed, ...]]:
        """`rig.at(port)`: the laws placed at that port.

        No method: equinox makes a module of each method that is looked up, and this is asked often.
        """
        return partial(_at, self.effects)

    def add(self, law: AbstractLaw, place: str) -> "Rig":
        """This rig with one more law: a wheel's name, `all`, `sphere`, `platform`, or a channel."""
        return self.with_effects((*self.effects, place_law(law, place, self.names, self.profiles)))

    def with_effects(self, effects: Sequence[Placed]) -> "Rig":
        """This rig with these laws, each where it acts, in place of its own."""
        return dataclasses.replace(self, effects=tuple(effects))

    def term(self, drive: Any, *, start: float = 0.0, model: str = "coupled") -> Any:
        """The vector field under a drive as a `diffrax.ODETerm`: see `omnijax.simulation.term`."""
        import omnijax  # drives stand above this package: on use only

        return omnijax.simulation.term(self, drive, start=start, model=model)


def _at(effects: Sequence[Placed], port: str) -> tuple[Placed, ...]:
    return tuple(placed for placed in effects if placed.law.port == port)


def place_law(
    law: AbstractLaw, place: str, names: tuple[str, ...], profiles: tuple[AbstractShape, ...]
) -> Placed:
    """`law` at `place` of a rig with wheels `names`; a damaged roller takes its wheel's profile.

    Raises `InputError` for a place that is none of the law's own, or of its port where it names
    none.
    """
    places = places_of(law.places, names) if law.places else port_places(law.port, names)
    if place not in places:
        hint = did_you_mean(place, places)
        which = "it" if law.places else f"a law of the port `{law.port}`"
        raise InputError(
            f"`{law.id}` cannot be placed at {place!r}: {which} stands at "
            f"{', '.join(places)}.{hint}"
        )
    everywhere = place == "all" or (place == "sphere" and law.port == "rolling")
    wheels = tuple(i for i, name in enumerate(names) if everywhere or name == place)
    if isinstance(law, DamagedRoller) and law.profile is None:
        law = dataclasses.replace(law, profile=profiles[wheels[0]])
    return Placed(law, place, wheels)


def grouped_profiles(rig: Rig) -> list[tuple[Callable, tuple[int, ...]]]:
    """Profiles of equal structure, stacked: (vmapped shape of (angles, gaps), wheel indices)."""
    groups: dict[Any, list[int]] = {}
    for i, profile in enumerate(rig.profiles):
        shapes = tuple(jnp.shape(x) for x in jax.tree.leaves(profile))
        groups.setdefault((jax.tree.structure(profile), shapes), []).append(i)
    result = []
    for index in groups.values():
        stacked = jax.tree.map(lambda *xs: jnp.stack(xs), *(rig.profiles[i] for i in index))
        shape = jax.vmap(lambda law, angle, gap: law(angle, gap))
        result.append((lambda a, g, s=stacked, f=shape: f(s, a, g), tuple(index)))
    return result
