"""`omnijax init`: a commented rig file to start from."""

from importlib import resources
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from .._errors import InputError


def init(
    file: Path = Path("rig.toml"),
    /,
    *,
    force: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Write a commented rig file with every key, to be filled in.

    Example: omnijax init my-rig.toml

    Parameters
    ----------
    file
        The file to write.
    force
        Overwrite the file where it exists.
    """
    if file.exists() and not force:
        raise InputError(f"{file} exists already: choose another name, or --force to overwrite it.")
    template = resources.files("omnijax") / "rig" / "data" / "template" / "rig.toml"
    try:
        file.write_bytes(template.read_bytes())
    except OSError as error:
        raise InputError(f"{file} cannot be written: {error.strerror}.") from None
    print(f"Wrote {file}. Fill in your numbers, then: omnijax check {file}")
