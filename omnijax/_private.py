"""Folders of the user's own: nobody else may write there, or what lies in them is not used."""

import os
import stat
import sys
from pathlib import Path


def config_folder() -> Path:
    """Folder of the user's choices: `$OMNIJAX_CONFIG_DIR`, else the user's configuration."""
    chosen = os.environ.get("OMNIJAX_CONFIG_DIR")
    if chosen:
        return Path(chosen)
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "omnijax"


def open_to_others(path: Path) -> str | None:
    """How others could change what lies at `path`, in words; None where they cannot."""
    if sys.platform == "win32":  # folders of a user are the user's own there
        return None
    here = os.path.realpath(path)
    for place in (here, os.path.dirname(here)):
        status = os.stat(place)
        if status.st_uid not in (os.geteuid(), 0):
            return f"{place} belongs to another user"
        sticky = status.st_mode & stat.S_ISVTX and place != here
        if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH) and not sticky:
            return f"{place} can be written by others"
    return None


def private_folder(path: Path) -> str | None:
    """Make `path` for this user alone; why it is not so where it exists otherwise."""
    try:
        for folder in (*reversed(path.parents), path):  # `parents=True` would make them for others
            if not folder.exists():
                folder.mkdir(mode=0o700, exist_ok=True)
        return open_to_others(path)
    except OSError as error:
        return f"{path}: {error.strerror}"
