"""What a file on the command line describes."""

from pathlib import Path


def file_kind(path: str | Path) -> str:
    """`machine`, `study` or `rig`, as `kind_of` tells them.

    What is no readable TOML is a rig: it is told of where it is read as one.
    """
    from ..._errors import InputError
    from ..._reading import read_toml
    from ...rig import kind_of

    file = Path(path)
    if file.suffix.lower() != ".toml" or not file.is_file():
        return "rig"
    try:
        return kind_of(read_toml(file))
    except InputError:
        return "rig"
