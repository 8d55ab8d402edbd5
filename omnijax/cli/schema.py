"""`omnijax schema`: the JSON Schema of rig files, of study files and of machine files."""

import json

from ._studies import Switch


def schema(*, study: Switch = False, machine: Switch = False) -> None:
    """Print the JSON Schema of rig files, for editors that complete and check TOML.

    Example: omnijax schema > rig.schema.json

    Example: omnijax schema --study > study.schema.json

    Example: omnijax schema --machine > machine.schema.json

    The files that `omnijax init` and `omnijax case new` write name these schemas in their first
    line, `#:schema ./rig.schema.json`: with them beside, editors with a TOML language server (Even
    Better TOML, taplo) offer keys, units and ranges.

    Parameters
    ----------
    study
        The schema of study files instead.
    machine
        The schema of machine files (machine.toml of an axis) instead.
    """
    from .._errors import InputError
    from ..machine import machine_schema
    from ..rig import json_schema
    from ..study import study_schema

    if study and machine:
        raise InputError("--study and --machine are two schemas: ask for one of them.")
    document = study_schema() if study else machine_schema() if machine else json_schema()
    print(json.dumps(document, indent=1, ensure_ascii=False))
