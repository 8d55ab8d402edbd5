"""The help of every command, as it stands in tests/data/help.txt.

`python tests/help_texts.py` writes that file anew; its difference is what users will see.
"""

import contextlib
import io
import os
from pathlib import Path

FILE = Path(__file__).parent / "data" / "help.txt"
COLUMNS = "80"


def help_texts() -> str:
    """Every help, one after the other, on a terminal of 80 columns."""
    from omnijax.cli import COMMANDS, run

    names = [name for group in COMMANDS.values() for name in group]
    said = []
    for tokens in ([], *([name] for name in names)):
        with contextlib.redirect_stdout(io.StringIO()) as out:
            assert run([*tokens, "--help"]) == 0
        lines = (line.rstrip() for line in out.getvalue().rstrip().splitlines())
        said.append("\n".join([f"$ omnijax {' '.join([*tokens, '--help'])}", *lines, ""]))
    return "\n".join(said)


if __name__ == "__main__":
    os.environ["COLUMNS"] = COLUMNS
    FILE.write_text(help_texts(), encoding="utf-8")
