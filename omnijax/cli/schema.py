"""`omnijax schema`: the rig file's JSON Schema."""

import json


def schema() -> None:
    """Print the JSON Schema of rig files, for editors that complete and check TOML.

    Example: omnijax schema > rig.schema.json

    With `#:schema ./rig.schema.json` as a rig file's first line, editors with a TOML language
    server (Even Better TOML, taplo) offer keys, units and ranges.
    """
    from ..rig import json_schema

    print(json.dumps(json_schema(), indent=1, ensure_ascii=False))
