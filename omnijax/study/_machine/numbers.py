"""The numbers of a machine file that may be varied."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from ..._errors import InputError, did_you_mean
from ...machine import Axis, MachineFile, axis_unit, field_units, numbers_of


@dataclasses.dataclass(frozen=True)
class VariedNumbers:
    """The numbers of a machine file that may be varied: path -> where it is."""

    file: MachineFile
    where: Mapping[str, tuple[int | None, str]]  # None: of the axis, else of an effect

    @staticmethod
    def of(file: MachineFile) -> "VariedNumbers":
        """`axis.inertia`, `servo.gain`, ..., and `effect.ID.KEY` for every effect of the file.

        Lists, as the orders of a cogging are, are no numbers.
        """
        machine = file.machine
        if not isinstance(machine, Axis):
            raise InputError(f"{file.source}: only an axis has numbers by name.")
        out: dict[str, tuple[int | None, str]] = {}
        out |= {path: (None, key.field) for path, key, _ in numbers_of(machine)}
        for k, one in enumerate(file.placed):
            keys = [key for key, known in one.law.parameters.items() if not known.shape]
            out |= {f"effect.{one.law.id}.{key}": (k, key) for key in keys}
        return VariedNumbers(file, out)

    def checked(self, paths: Sequence[str]) -> tuple[str, ...]:
        """The paths; `InputError` for one that the file does not have."""
        wrong = [p for p in paths if p not in self.where]
        if wrong:
            raise InputError([
                f"`{p}` is no number of {self.file.source}.{did_you_mean(p, self.where)}"
                for p in wrong
            ])  # fmt: skip
        return tuple(paths)

    def unit(self, path: str) -> str:
        """SI unit of a number."""
        k, key = self.where[path]
        if k is None:
            return field_units(self.file.machine)[key]
        return axis_unit(self.file.placed[k].law.parameters[key].unit, self.motion, key)

    @property
    def motion(self) -> str:
        """What the axis does: `rotation` or `translation`."""
        return self.file.machine.motion  # pyright: ignore[reportAttributeAccessIssue], an axis

    def value(self, path: str) -> float:
        """The number as the file states it."""
        k, key = self.where[path]
        return float(getattr(self.file.machine if k is None else self.file.placed[k].law, key))

    def at(self, paths: Sequence[str], values: Any) -> tuple[Any, Any]:
        """(machine, laws) at other values; may be traced."""
        machine, placed = self.file.machine, list(self.file.placed)
        for path, given in zip(paths, values, strict=True):
            k, key = self.where[path]
            value = jnp.asarray(given, float)
            if k is None:
                machine = eqx.tree_at(lambda m, key=key: getattr(m, key), machine, value)
            else:
                placed[k] = eqx.tree_at(lambda p, key=key: getattr(p.law, key), placed[k], value)
        return machine, tuple(placed)
