"""The schema of machine.toml: every key with its units for a rotation and a translation."""

import functools
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, create_model

from ..rig import Quantity


class Key(NamedTuple):
    """One number: its field of `Axis`, units for a rotation and a translation, range, default."""

    field: str
    rotation: str
    translation: str
    low: float | None = None  # included
    above: float | None = None  # excluded
    default: Any = 0.0

    def quantity(self, motion: str) -> Quantity:
        """Unit and range."""
        unit = self.translation if motion == "translation" else self.rotation
        low = -float("inf") if self.low is None else self.low
        return Quantity(unit, low=low, above=self.above)


NEEDED = ...
KEYS: dict[str, dict[str, Key]] = {
    "axis": {
        "inertia": Key("inertia", "kg m^2", "kg", above=0, default=NEEDED),
        "damping": Key("damping", "N m s/rad", "N s/m", low=0),
        "stiffness": Key("stiffness", "N m/rad", "N/m", low=0),
        "offset": Key("offset", "N m", "N"),
        "gravity": Key("gravity", "N m", "N"),
        "gravity_angle": Key("gravity_angle", "rad", "m"),
        "dry_friction": Key("coulomb", "N m", "N", low=0),
        "friction_width": Key("coulomb_width", "rad/s", "m/s", above=0, default=0.05),
    },
    "motor": {
        "torque_constant": Key("torque_constant", "N m/A", "N/A", default=None),
        "gear": Key("gear", "1", "rad/m", default=1.0),
        "resistance": Key("resistance", "ohm", "ohm", above=0, default=None),
        "back_emf": Key("back_emf", "V s/rad", "V s/m", default=None),
        "inertia": Key("motor_inertia", "kg m^2", "kg", low=0),
    },
    "servo": {
        "gain": Key("gain", "1/rad", "1/m", default=NEEDED),
        "rate_gain": Key("rate_gain", "s/rad", "s/m"),
        "supply": Key("supply", "V", "V", above=0, default=NEEDED),
        "limit": Key("limit", "1", "1", above=0, default=1.0),
    },
    "second": {
        "inertia": Key("second_inertia", "kg m^2", "kg", above=0, default=NEEDED),
        "stiffness": Key("second_stiffness", "N m/rad", "N/m", above=0, default=NEEDED),
        "damping": Key("second_damping", "N m s/rad", "N s/m", low=0),
        "play": Key("second_play", "rad", "m", low=0),
    },
}


def field_units(machine: Any) -> dict[str, str]:
    """SI units of an axis' numbers by field; none of a machine of the user's."""
    motion = getattr(machine, "motion", None)
    if motion not in ("rotation", "translation"):
        return {}
    return {k.field: k.quantity(motion).unit for keys in KEYS.values() for k in keys.values()}


def least_of(field: str) -> float:
    """The least that a field of an axis may be, in SI; minus infinity where it has no least."""
    key = next(k for x in KEYS.values() for k in x.values() if k.field == field)
    return max((x for x in (key.low, key.above) if x is not None), default=-float("inf"))


def may_be_absent(field: str) -> bool:
    """Whether a field of an axis is 0 where a file does not give it."""
    return any(k.field == field and k.default == 0.0 for x in KEYS.values() for k in x.values())


TURNED = {  # unit of a law of mounts -> of one that turns
    "m": "rad", "m/s": "rad/s", "N": "N m", "N/m^2": "N m/rad^2", "N/m^3": "N m/rad^3",
}  # fmt: skip
SLID = {  # unit of a law of shafts -> of one that slides
    "N m": "N", "N m s/rad": "N s/m", "N m/rad": "N/m", "rad/s": "m/s",
    "N m s^2/rad^2": "N s^2/m^2",
}  # fmt: skip


def axis_unit(unit: str, motion: str, key: str = "") -> str:
    """Unit of a law's number on an axis; `key` names the number.

    A law states units for wheels (which turn) and mounts (which slide); an axis may do either.
    Phases are always in rad, so the orders of a sliding axis are in rad/m.
    """
    if key in ("order", "orders"):
        return "rad/m" if motion == "translation" else unit
    position = "m" if motion == "translation" else "rad"
    unit = unit.replace("unit of the channel", position)
    return (SLID if motion == "translation" else TURNED).get(unit, unit)


Drive = Literal["torque", "current", "voltage", "command", "goal"]


class MachineTable(BaseModel):
    """A table of the file; a key that is no field is refused."""

    model_config = ConfigDict(extra="forbid")


class Compare(MachineTable):
    """How a run is compared: `balance` of accelerations, or a `free-run` simulation.

    `hold` is the input's course between its samples.  With `auto` a diagnosis tells it from the
    data, and a simulation takes it as linear.
    """

    criterion: Literal["auto", "balance", "free-run"] = "auto"
    cutoff: Annotated[float | None, Quantity("Hz", above=0)] = None
    hold: Literal["auto", "linear", "held", "band-limited"] = "auto"


class MachineEffectTable(MachineTable):
    """An effect that the model has already; `law` is the Python file of a law of one's own.

    Laws of sensors stand at what they read, or at `axis`: at both.
    """

    id: str
    law: str | None = None
    place: Literal["axis", "position", "velocity"] = "axis"
    parameters: dict[str, Any] = {}


@functools.cache
def file_model(motion: str) -> type[MachineTable]:
    """The model of a whole file for a kind of motion."""
    fields: dict[str, Any] = {}
    for table, keys in KEYS.items():
        own: dict[str, Any] = {
            name: (
                Annotated[float if key.default is not None else float | None, key.quantity(motion)],
                key.default,
            )
            for name, key in keys.items()
        }
        if table == "motor":
            own["input"] = (Drive, "torque")
        made = create_model(f"{table.title()}Table", __base__=MachineTable, **own)
        needed = table in ("axis", "motor")
        fields[table] = (made if needed else made | None, ... if needed else None)
    return create_model(
        "MachineFile", __base__=MachineTable, kind=(Literal["axis"], ...),
        motion=(Literal["rotation", "translation"], "rotation"), compare=(Compare, Compare()),
        effect=(list[MachineEffectTable], []),
        uncertainty=(dict[str, Annotated[float, Quantity("1", above=0)]], {}), **fields,
    )  # fmt: skip
