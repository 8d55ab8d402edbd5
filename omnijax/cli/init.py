"""`omnijax init`: a commented rig file to start from."""

from importlib import resources
from pathlib import Path

from .._files import claim, write_bytes
from ._options import Force


def init(
    file: Path = Path("rig.toml"),
    /,
    *,
    force: Force = False,
) -> None:
    """Write a commented rig file with every key, to be filled in.

    Example: omnijax init my-rig.toml

    Parameters
    ----------
    file
        The file to write.
    """
    claim([file], force=force)
    template = resources.files("omnijax") / "rig" / "data" / "template" / "rig.toml"
    write_bytes(file, template.read_bytes())
    print(f"Wrote {file}. Fill in your numbers, then: omnijax check {file}")
