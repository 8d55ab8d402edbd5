"""The rig file's JSON Schema, for editors that complete and check TOML."""

from typing import Any

from ..laws import EFFECTS, AbstractLaw
from ._directions import ANGLES
from ._parameters import law_quantity
from ._schema import RigTable


def json_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a rig file, effects and their parameters included."""
    schema = RigTable.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "omnijax rig file"
    wheel = schema["$defs"]["WheelTable"]
    wheel["properties"] |= {
        name: quantity.json_schema() | {"description": "unit rad (45 deg), instead of the vectors"}
        for name, quantity in ANGLES.items()
    }
    wheel["required"] = [key for key in wheel["required"] if key not in {"normal", "drive"}]
    wheel["oneOf"] = [{"required": ["normal", "drive"]}, {"required": ["zenith", "azimuth"]}]
    effect = schema["$defs"]["EffectTable"]
    effect["if"] = {"not": {"required": ["law"]}}
    effect["then"] = {"properties": {"id": {"enum": list(EFFECTS)}}}
    effect["allOf"] = [effect_schema(law) for law in EFFECTS.values()]
    return schema


def effect_schema(law: type[AbstractLaw]) -> dict[str, Any]:
    """What a block of an effect with this law's id may hold, in rig and machine files."""
    keys = {name: law_quantity(p).json_schema() for name, p in law.parameters.items()}
    needed = [name for name, p in law.parameters.items() if not p.optional]
    parameters = {"properties": keys, "required": needed, "additionalProperties": False}
    body: dict[str, Any] = {"properties": {"parameters": parameters}}
    if needed:
        body["required"] = ["parameters"]
    return {
        "if": {"properties": {"id": {"const": law.id}}, "not": {"required": ["law"]}},
        "then": {**body, "description": law.formula},
    }
