"""Rig files in: what a user means by a path, read before anything slow is imported."""

from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._errors import InputError, did_you_mean
from .._reading import read_toml
from ._batch import check_one_rig

if TYPE_CHECKING:
    from ._machine import Rig


def bundled_rigs() -> dict[str, Path]:
    """Rig files that come with omnijax, by name.

    Raises nothing.
    """
    folder = Path(str(resources.files("omnijax.rig") / "data"))
    return {path.stem: path for path in sorted(folder.glob("*.toml"), key=lambda path: path.stem)}


def rig_path(path: str | Path) -> Path:
    """The rig file that a user means: a file, or the name of a bundled rig."""
    bundled = bundled_rigs()
    file = Path(path)
    if file.exists() or str(path) not in bundled:
        return file
    return bundled[str(path)]


def load_rig(path: str | Path) -> "Rig":
    """The rig of a TOML file, or a bundled one by its name (`"atlas"`).

    Directions near unit length are taken as directions: `rig_notes` says which.  Raises
    `InputError` with every problem of the file at once.
    """
    tables = rig_tables(path)
    from ._load import parse_rig

    return parse_rig(tables, rig_path(path))


def as_rig(rig: "Rig | str | Path") -> "Rig":
    """A rig as it is, or that of a file or of a bundled name, as `load_rig` reads it.

    Raises `InputError` for a batch of rigs, and as `load_rig`.
    """
    from ._machine import Rig

    if not isinstance(rig, Rig):
        return load_rig(rig)
    check_one_rig(rig)
    return rig


def rig_notes(path: str | Path) -> list[str]:
    """What reading a rig file changed: directions that were made exact."""
    tables = rig_tables(path)
    from ._directions import directed

    return directed(tables).notes


def rig_tables(path: str | Path) -> dict[str, Any]:
    """The tables of a rig file as they stand; nothing is checked, and nothing slow imported.

    Raises `InputError` for a file that cannot be read.
    """
    file = rig_path(path)
    try:
        return read_toml(file)
    except OSError as error:
        names = bundled_rigs()
        hint = did_you_mean(str(path), names) or f" Bundled rigs: {', '.join(names)}."
        raise InputError(f"the rig file cannot be read: {error.strerror}.{hint}", path) from None
