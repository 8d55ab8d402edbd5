"""Tables of a rig file -> `Rig`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .._arrays import on_device
from .._consent import are_read_only
from .._errors import InputError
from ..laws import PROFILES, AbstractLaw, AbstractShape, DualRow
from ._check import problems
from ._check_effects import law_class
from ._directions import directed
from ._machine import Closure, Contact, Mount, Placed, Platform, Rig, Sphere, Wheels, place_law
from ._parameters import law_quantity
from ._schema import EffectTable, RigTable, WheelTable, quantities
from ._table_profile import shape_of


def parse_rig(data: Mapping[str, Any], path: str | Path | None = None) -> Rig:
    """The rig of tables as `tomllib` gives them; files are relative to the folder of `path`.

    Numbers are SI where no unit stands.  Raises `InputError` with every problem at once.
    """
    folder = Path(".") if path is None else Path(path).parent
    sentences = problems(data, folder)
    if sentences:
        raise InputError(sentences, path)
    return _build(RigTable.model_validate(directed(data).data), folder)


def _build(table: RigTable, folder: Path) -> Rig:
    names = tuple(wheel.name for wheel in table.wheel)
    profiles = tuple(_profile(wheel, folder) for wheel in table.wheel)
    return Rig(
        sphere=Sphere(**_arrays(table.sphere)),
        platform=Platform(**_arrays(table.platform)),
        wheels=_wheels(table.wheel),
        profiles=profiles,
        effects=tuple(
            _placed(block, names, profiles, folder)
            for block in table.effect
            if block.law is None or not are_read_only()
        ),
        names=names,
        uncertainty=tuple(table.uncertainty.items()),
    )


def _arrays(table: Any) -> dict[str, Any]:
    return {key: on_device(getattr(table, key)) for key in quantities(type(table))}


def _wheels(wheels: list[WheelTable]) -> Wheels:
    def stacked(tables: list[Any]) -> dict[str, Any]:
        keys = [key for key in quantities(type(tables[0])) if key != "row_spacing"]
        return {key: on_device([getattr(t, key) for t in tables]) for key in keys}

    return Wheels(
        **stacked(wheels),
        contact=Contact(**stacked([wheel.contact for wheel in wheels])),
        mount=Mount(**stacked([wheel.mount for wheel in wheels])),
        closure=Closure(**stacked([wheel.closure for wheel in wheels])),
    )


def _profile(wheel: WheelTable, folder: Path) -> AbstractShape:
    if wheel.profile == "dual-row":
        return DualRow(on_device(wheel.row_spacing))
    if wheel.table is not None:
        return shape_of(wheel.table, wheel.rollers, folder)
    return PROFILES[wheel.profile]()


def _placed(block: EffectTable, names, profiles, folder: Path) -> Placed:
    tables = block.model_dump(exclude_none=True)
    law = law_class(tables, folder)
    assert law is not None  # `problems` has refused unknown ids
    values = {
        key: law_quantity(law.parameters[key], block.place, len(names)).read(value)
        for key, value in block.parameters.items()
    }
    return place_law(with_arrays(law, values), block.place, names, profiles)


def with_arrays(law: type[AbstractLaw], values: Mapping[str, Any]) -> AbstractLaw:
    """A law with its parameters as arrays, its defaults too where none is given."""
    filled = {**{k: getattr(law, k, None) for k in law.parameters}, **values}
    return law(**{k: on_device(v) for k, v in filled.items() if v is not None})
