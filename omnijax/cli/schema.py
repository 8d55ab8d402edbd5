"""`omnijax schema`: the JSON Schema of rig files, and of study files."""

import json

from ._study_page import Switch


def schema(*, study: Switch = False) -> None:
    """Print the JSON Schema of rig files, for editors that complete and check TOML.

    Example: omnijax schema > rig.schema.json

    Example: omnijax schema --study > study.schema.json

    The files that `omnijax init` writes name these schemas in their first line, `#:schema
    ./rig.schema.json`: with them beside, editors with a TOML language server (Even Better TOML,
    taplo) offer keys, units and ranges.

    Parameters
    ----------
    study
        The schema of study files instead.
    """
    from ..rig import json_schema
    from ..study import study_schema

    found = study_schema() if study else json_schema()
    print(json.dumps(found, indent=1, ensure_ascii=False))
