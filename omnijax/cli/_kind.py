"""What a file on the command line describes."""

from pathlib import Path


def file_kind(path: str | Path) -> str:
    """`machine` (a TOML file with a `kind`), `study` (of a rig, drives or variables), or `rig`.

    What is no readable TOML is a rig: it is told of where it is read as one.
    """
    from .._errors import InputError
    from .._reading import read_toml

    file = Path(path)
    if file.suffix != ".toml" or not file.is_file():
        return "rig"
    try:
        keys = set(read_toml(file))
    except InputError:
        return "rig"
    if "kind" in keys:
        return "machine"
    return (
        "study" if keys & {"rig", "drive", "variable"} and not keys & {"sphere", "wheel"} else "rig"
    )
