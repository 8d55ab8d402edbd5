"""The machine file's JSON Schema, for editors that complete and check TOML."""

from typing import Any

from ..laws import AXIS_EFFECTS
from ..rig import effect_schema
from ._schema import KEYS, MachineEffectTable, file_model


def machine_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a machine.toml, of both motions: their ranges are the same."""
    schema = file_model("rotation").model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "omnijax machine file"
    for table, keys in KEYS.items():
        shown = schema["$defs"][f"{table.title()}Table"]["properties"]
        for name, key in keys.items():
            turn, slide = key.quantity("rotation"), key.quantity("translation")
            also = "" if turn.unit == slide.unit else f" (translation: {slide.unit})"
            shown[name]["description"] = f"unit {turn.unit}{also}, range {turn.range}"
    paths = [f"{table}.{name}" for table, keys in KEYS.items() for name in keys]
    schema["properties"]["uncertainty"]["propertyNames"] = {"enum": paths}
    effect = schema["$defs"][MachineEffectTable.__name__]
    effect["if"] = {"not": {"required": ["law"]}}
    effect["then"] = {"properties": {"id": {"enum": list(AXIS_EFFECTS)}}}
    effect["allOf"] = [effect_schema(law) for law in AXIS_EFFECTS.values()]
    wired = {"properties": {"motor": {"required": ["resistance"]}}}
    known = {"properties": {"motor": {"required": ["resistance", "torque_constant"]}}}
    schema["allOf"] = [
        {"if": _driven_by("voltage"), "then": known},
        {"if": _driven_by("goal"), "then": wired | {"required": ["servo"]}},
    ]
    return schema


def _driven_by(drive: str) -> dict[str, Any]:
    """Files whose motor has this input."""
    said = {"properties": {"input": {"const": drive}}, "required": ["input"]}
    return {"properties": {"motor": said}, "required": ["motor"]}
