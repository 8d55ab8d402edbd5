"""All numbers of a machine and of the laws that may join it, as one vector: one program for all.

Every law that may be named has a slot, switched off by its gate; adding an effect changes numbers,
not the program, so that many points run side by side and nothing is compiled again.
"""

import dataclasses
import math
from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ....laws import AbstractLaw
from ....machine import AbstractMachine, PlacedLaw
from ..._search import Effect, Point, Prior


@dataclasses.dataclass(frozen=True)
class Slot:
    """Room for one law at one place; its numbers begin at `begin` of the vector, the gate first."""

    law: type[AbstractLaw]
    place: str
    begin: int

    @property
    def keys(self) -> list[str]:
        """The law's parameters in order."""
        return list(self.law.parameters)

    def part(self, key: str) -> slice:
        """Where a parameter stands in the vector."""
        at = self.begin + 1
        for name, p in self.law.parameters.items():
            size = max(1, p.shape)
            if name == key:
                return slice(at, at + size)
            at += size
        raise KeyError(key)

    @property
    def size(self) -> int:
        """Numbers with the gate."""
        return 1 + sum(max(1, p.shape) for p in self.law.parameters.values())


def rest_values(law: type[AbstractLaw]) -> dict[str, np.ndarray]:
    """Numbers of a law that is switched off: no strength, and shapes that divide by nothing."""
    fields, out = law.__dataclass_fields__, {}
    for key, p in law.parameters.items():
        default = fields[key].default
        plain = default is not dataclasses.MISSING and default is not None
        shape = float(default) if plain and not p.shape else 1.0  # pyright: ignore[reportArgumentType]
        out[key] = np.full(max(1, p.shape), 0.0 if p.linear else shape)
    return out


class Numbers:
    """The vector: uncertain fields of the machine, then a slot for every law and place."""

    def __init__(self, machine: AbstractMachine, priors: Sequence[Prior],
                 laws: Sequence[tuple[type[AbstractLaw], str]],
                 stated: tuple[PlacedLaw, ...] = ()):  # fmt: skip
        self.machine, self.priors, self.stated = machine, tuple(priors), stated
        self.slots, at = [], len(self.priors)
        for law, place in laws:
            slot = Slot(law, place, at)
            self.slots.append(slot)
            at += slot.size
        self.size = at
        self.rest = np.zeros(at)
        for slot in self.slots:
            for key, value in rest_values(slot.law).items():
                self.rest[slot.part(key)] = value

    def rest_vector(self) -> np.ndarray:
        """The stated machine without any effect."""
        return self.vector(Point(np.zeros(len(self.priors))))

    def vector(self, point: Point) -> np.ndarray:
        """The numbers of a point."""
        out = self.rest.copy()
        out[: len(self.priors)] = [
            p.at(float(u)) for p, u in zip(self.priors, point.u, strict=True)
        ]
        for effect, slot in zip(point.effects, self.slots_of(point.effects), strict=True):
            out[slot.begin] = 1.0
            for key, value in effect.values.items():
                out[slot.part(key)] = value
        return out

    def slots_of(self, effects: Sequence[Effect]) -> list[Slot]:
        """The slot of every effect; several of one name take their slots in turn."""
        free, out = list(self.slots), []
        for e in effects:
            slot = next((s for s in free if s.law.id == e.id and s.place == e.place), None)
            if slot is None:
                raise ValueError(f"{e.name}: the model has no further room for this law.")
            free.remove(slot)
            out.append(slot)
        return out

    def slot_beside(self, point: Point, id: str, place: str) -> Slot:
        """The slot that a law takes beside the point's effects; where none is left, its first."""
        taken = self.slots_of(point.effects)
        own = [s for s in self.slots if (s.law.id, s.place) == (id, place)]
        if not own:
            raise ValueError(f"{id}@{place}")
        return next((s for s in own if s not in taken), own[0])

    def ways(self, point: Point) -> np.ndarray:
        """d vector / d u (P, numbers)."""
        slopes = np.array([
            p.sigma * (p.value * math.exp(p.sigma * float(u)) if p.relative else 1.0)
            for p, u in zip(self.priors, point.u, strict=True)
        ])  # fmt: skip
        return slopes[:, None] * np.eye(len(slopes), self.size)

    def active(self, thetas: np.ndarray) -> frozenset[int]:
        """Slots that are switched on in any of some vectors (points, numbers)."""
        return frozenset(np.flatnonzero(self.on(thetas)).tolist())

    def on(self, thetas: np.ndarray) -> np.ndarray:
        """Whether each slot (slots,) is switched on in any of some vectors (points, numbers)."""
        gates = thetas[:, [slot.begin for slot in self.slots]]
        return np.any(gates != 0, axis=0)

    def build(self, theta, only=None, on=None) -> tuple[AbstractMachine, tuple[PlacedLaw, ...]]:
        """Machine and laws of a vector, those of the slots `only` if given; may be traced.

        Laws of slots that are not `on` (slots,), if given, are not evaluated.
        """
        machine, theta = self.machine, jnp.asarray(theta)
        for k, prior in enumerate(self.priors):
            machine = eqx.tree_at(
                lambda m, name=prior.name: getattr(m, name), machine, theta[k],
                is_leaf=lambda x: x is None,
            )  # fmt: skip
        placed = []
        for k, slot in enumerate(self.slots):
            if only is not None and k not in only:
                continue
            values = {}
            for key, p in slot.law.parameters.items():
                part = theta[slot.part(key)]
                values[key] = part if p.shape else part[0]
            gate, used = jnp.asarray(theta[slot.begin]), None if on is None else on[k]
            placed.append(PlacedLaw(slot.law(**values), slot.place, gate, used))
        return machine, (*self.stated, *placed)
