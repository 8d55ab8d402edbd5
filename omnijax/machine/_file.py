"""machine.toml in and out."""

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import jax.numpy as jnp
from pydantic import ValidationError

from .._errors import InputError, did_you_mean
from .._problems import sentence
from .._reading import read_toml
from .._toml import toml_value
from ..laws import AXIS_EFFECTS, of_library
from ..rig import file_of, law_quantity, rigs_laws
from ._axis import Axis
from ._base import AbstractMachine
from ._ports import PlacedLaw
from ._schema import KEYS, Compare, Key, MachineEffectTable, axis_unit, file_model


@dataclasses.dataclass(frozen=True)
class MachineFile:
    """A machine with what its file says beside its numbers.

    `uncertainty` is the 1-sigma by field, relative or, of a field that is 0, absolute; `names`
    gives the key of the file for each field, `assumed` says what the file leaves to be taken.
    """

    machine: AbstractMachine
    placed: tuple[PlacedLaw, ...] = ()
    uncertainty: Mapping[str, float] = dataclasses.field(default_factory=dict)
    compare: Compare = dataclasses.field(default_factory=Compare)
    names: Mapping[str, str] = dataclasses.field(default_factory=dict)
    source: str = "machine.toml"
    assumed: tuple[str, ...] = ()


def field_names() -> dict[str, str]:
    """Field of `Axis` -> key of the file, `second_inertia` -> `second.inertia`."""
    return {k.field: f"{t}.{name}" for t, keys in KEYS.items() for name, k in keys.items()}


def numbers_of(axis: Axis) -> Iterator[tuple[str, Key, Any]]:
    """(`table.name`, key, value) of every number that an axis uses."""
    unused = {"servo"} if axis.drives != "goal" else set()
    unused |= {"second"} if axis.second_inertia is None else set()
    for table, keys in KEYS.items():
        for name, key in keys.items():
            value = getattr(axis, key.field)
            if table not in unused and value is not None:
                yield f"{table}.{name}", key, value


def load_machine(path: str | Path) -> MachineFile:
    """The machine of a TOML file; `InputError` with every problem at once."""
    path = Path(path)
    try:
        data = read_toml(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}.") from None
    return parse_machine(data, str(path))


def parse_machine(data: Mapping[str, Any], source: str = "machine.toml") -> MachineFile:
    """The machine of a document, in SI.

    Raises `InputError` with every problem at once: unknown keys, wrong types, units or ranges, and
    numbers that its drive needs and the document lacks.
    """
    motion = data.get("motion", "rotation")
    known = motion if motion in ("rotation", "translation") else "rotation"
    try:
        file: Any = file_model(known).model_validate(dict(data))
    except ValidationError as error:
        raise InputError([_sentence(e) for e in error.errors()], source) from None
    drives, values = file.motor.input, {}
    problems = _lacking(file, known)
    for table, keys in KEYS.items():
        part = getattr(file, table)
        for name, key in keys.items():
            value = None if part is None else getattr(part, name)
            if value is not None:
                values[key.field] = value
    names = field_names()
    inverse = {v: k for k, v in names.items()}
    for key in file.uncertainty:
        if key not in inverse:
            problems.append(
                f"`uncertainty.{key}` is no key of a number.{did_you_mean(key, inverse)}"
            )
        elif inverse[key] not in values:
            problems.append(f"`uncertainty.{key}`: the file gives no such number.")
    placed, wrong = _effects(file.effect, known, Path(source).parent)
    if problems or wrong:
        raise InputError(problems + wrong, source)
    machine = Axis(**{k: jnp.asarray(v, float) for k, v in values.items()},
                   drives=drives, motion=known)  # fmt: skip
    uncertain = {inverse[k]: float(v) for k, v in file.uncertainty.items()}
    assumed = ()
    if drives in ("current", "goal", "command") and file.motor.torque_constant is None:
        unit = _constant(known)
        unit = f"{unit.split('/')[0]} a unit of the command" if drives == "command" else unit
        assumed = (f"`motor.torque_constant` is not given and taken for 1 {unit}: "
                   "inertia and torques are in units of it.",)  # fmt: skip
    return MachineFile(machine, placed, uncertain, file.compare, names, source, assumed)


def _constant(motion: str) -> str:
    """Unit of a torque constant."""
    return KEYS["motor"]["torque_constant"].quantity(motion).unit


def _lacking(file, motion: str) -> list[str]:
    """What a document's motor needs and it does not give, and what its motion has no place for."""
    problems, drives = [], file.motor.input
    if drives == "goal" and file.servo is None:
        problems.append("`servo` is missing: a motor with `input = \"goal\"` has a controller of "
                        "its own; give its `gain` and `supply`.")  # fmt: skip
    if drives in ("voltage", "goal") and file.motor.resistance is None:
        problems.append(
            f"`motor.resistance` is missing: a motor with `input = {drives!r}` needs it, in ohm."
        )
    if drives == "voltage" and file.motor.torque_constant is None:
        problems.append("`motor.torque_constant` is missing: a motor with `input = 'voltage'` "
                        f"needs it, in {_constant(motion)}.")  # fmt: skip
    for name in ("gravity", "gravity_angle") if motion == "translation" else ():
        if getattr(file.axis, name):
            problems.append(f"`axis.{name}` is a pendulum's: the weight of what slides is the "
                            "constant force `axis.offset`, in N.")  # fmt: skip
    return problems


def _effects(blocks, motion: str, folder: Path) -> tuple[tuple[PlacedLaw, ...], list[str]]:
    placed, problems = [], []
    for block in blocks:
        try:
            known = AXIS_EFFECTS if block.law is None else rigs_laws(folder / block.law)
        except InputError as error:
            problems += [f"`effect.{block.id}.law`: {told}" for told in error.problems]
            continue
        law = known.get(block.id)
        if law is None:
            problems.append(f"`effect.id` must be one of the effects, but is {block.id!r}."
                            f"{did_you_mean(block.id, known)}")  # fmt: skip
            continue
        if law.port not in (*Axis.places, "sensor"):
            problems.append(f"`effect.{block.id}` acts at the port `{law.port}`, but an axis has "
                            f"{', '.join(Axis.places)} and sensor.")  # fmt: skip
            continue
        if law.port != "sensor" and block.place != "axis":
            problems.append(f"`effect.{block.id}.place` must be axis, but is {block.place!r}.")
            continue
        needed = {k for k, p in law.parameters.items() if not p.optional}
        wrong = sorted(set(block.parameters) - set(law.parameters))
        lacks = sorted(needed - set(block.parameters))
        if wrong or lacks:
            parts = {"unknown": wrong, "missing": lacks}
            said = "; ".join(f"{k}: {', '.join(v)}" for k, v in parts.items() if v)
            problems.append(f"`effect.{block.id}.parameters` must be {', '.join(law.parameters)}, "
                            f"but {said}.")  # fmt: skip
            continue
        values = {}
        for name, given in block.parameters.items():
            try:
                parameter = law.parameters[name]
                unit = axis_unit(parameter.unit, motion, name)
                quantity = law_quantity(parameter._replace(unit=unit), block.place, 1)
                values[name] = jnp.asarray(quantity.read(given), float)
            except ValueError as error:
                problems.append(f"`effect.{block.id}.{name}` {error}")
        if len(values) == len(block.parameters):
            placed.append(PlacedLaw(law(**values), block.place))
    return tuple(placed), problems


def _sentence(entry: Any) -> str:
    """One pydantic error as a sentence that begins with the key's path."""
    table = str(entry["loc"][0])
    keys = [*KEYS, "kind", "motion", "compare", "effect", "uncertainty"]
    if len(entry["loc"]) > 1:
        keys = [*KEYS.get(table, {}), *(["input"] if table == "motor" else [])]
    if table == "effect":
        keys = list(MachineEffectTable.model_fields)
    path = ".".join(str(part + 1) if isinstance(part, int) else part for part in entry["loc"])
    return sentence(entry, path, "a machine file", keys)


def with_numbers(file: MachineFile, machine: AbstractMachine) -> MachineFile:
    """The file with the numbers of another machine, and an uncertainty that means the same.

    A 1-sigma of a field that was 0 is absolute, and becomes a share of what the field is now.
    """
    spread = dict(file.uncertainty)
    for name, sigma in spread.items():
        now = float(getattr(machine, name))
        if float(getattr(file.machine, name)) == 0 and now != 0:
            spread[name] = sigma / abs(now)
    return dataclasses.replace(file, machine=machine, uncertainty=spread)


def machine_text(file: MachineFile) -> str:
    """machine.toml of a machine with its numbers and effects.

    Of one of the user's, which no file is read for, `[numbers]` are what its class begins with.
    Laws of a user's file are named by it (`save_laws`); raises `InputError` for those of none.
    """
    axis = file.machine
    lines = _axis_lines(axis) if isinstance(axis, Axis) else _model_lines(file)
    for one in file.placed:
        law = one.law
        numbers = ", ".join(f"{k} = {toml_value(getattr(law, k))}" for k in law.parameters)
        id, place = toml_value(law.id), toml_value(one.place)
        lines += ["", "[[effect]]", f"id = {id}", f"place = {place}"]
        if not of_library(law):
            lines.append(f"law = {toml_value(file_of(type(law))[0])}")
        lines.append(f"parameters = {{ {numbers} }}")
    said = {k: v for k, v in vars(file.compare).items() if v is not None}
    lines += ["", "[compare]", *(f"{k} = {toml_value(v)}" for k, v in said.items())]
    if file.uncertainty:
        lines += ["", "[uncertainty]"]
        spread = {file.names.get(k, k): float(v) for k, v in file.uncertainty.items()}
        lines += [f"{toml_value(k)} = {v!r}" for k, v in spread.items()]
    return "\n".join(lines) + "\n"


def _axis_lines(axis: Axis) -> list[str]:
    """The tables of an axis' own numbers."""
    lines = ['kind = "axis"', f'motion = "{axis.motion}"']
    for table, keys in KEYS.items():
        own = []
        for name, key in keys.items():
            value = getattr(axis, key.field)
            if value is None:
                continue
            stated = key.default is ... or key.default is None or float(value) != key.default
            used = table != "servo" or axis.drives == "goal"
            used = used and (table != "second" or axis.second_inertia is not None)
            used = used and not (name == "resistance" and axis.drives not in ("voltage", "goal"))
            used = used and not (name == "torque_constant" and axis.drives == "torque")
            if stated and used:
                own.append(f"{name} = {float(value)!r}")
        if table == "motor":
            own.insert(0, f'input = "{axis.drives}"')
        if own:
            lines += ["", f"[{table}]", *own]
    return lines


def _model_lines(file: MachineFile) -> list[str]:
    """The fields of a machine of the user's: numbers, lists and text, anything else as text."""
    fields = dataclasses.fields(file.machine)
    return [
        f"# A record: the numbers of a machine of your own are read from {Path(file.source).name},",
        "# so put them there; its effects go into its rate.",
        'kind = "model"', f"model = {toml_value(Path(file.source).name)}", "", "[numbers]",
        *(f"{f.name} = {toml_value(getattr(file.machine, f.name))}" for f in fields),
    ]  # fmt: skip
