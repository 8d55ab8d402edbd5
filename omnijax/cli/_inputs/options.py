"""Options and output that commands share."""

import json
import re
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter, Token

from ..._json import plain

Json = Annotated[bool, Parameter(name="--json", negative="", help="Print JSON for machines.")]
_FORCE = "Write over files that exist; without it nothing is, and an input never."
Force = Annotated[bool, Parameter(name=["--force", "--overwrite"], negative="", help=_FORCE)]
Overwrite = Annotated[  # of commands whose --force x,y,z is the force on the platform
    bool, Parameter(name="--overwrite", negative="", help=f"{_FORCE} Or --force without a value.")
]


def read_force(tokens: list[str]) -> list[str]:
    """The words of a command with `--force` as `--overwrite` where no numbers follow it."""
    following = [*tokens[1:], ""][: len(tokens)]
    return [
        "--overwrite" if word == "--force" and not _NUMBERS.match(after) else word
        for word, after in zip(tokens, following, strict=True)
    ]


def _whole(_: type, tokens: Sequence[Token]) -> int:
    """A whole number as it is typed; `1.5` is none."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f"{tokens[0].value!r} is no whole number") from None


Whole = Annotated[int, Parameter(converter=_whole)]
MaybeWhole = Annotated[int | None, Parameter(converter=_whole)]

_NUMBERS = re.compile(r"\s*[+-]?\.?\d|.*,")


PICTURES = (".png", ".svg", ".pdf")


def check_ending(path: Path | None, *endings: str) -> None:
    """`InputError` for a file whose kind, told by its ending in any letters, is another one."""
    from ..._errors import InputError

    if path is not None and path.suffix.lower() not in endings:
        choice = f"{'one of ' * (len(endings) > 1)}{', '.join(endings)}"
        raise InputError(f"`{path.name}` must end in {choice}.")


def command_line(without: tuple[str, ...] = (), valued: tuple[str, ...] = ()) -> str:
    """This command as it can be typed again, less some of its words and options with a value."""
    typed, words = ["omnijax"], iter(sys.argv[1:])
    for word in words:
        if word in valued:
            next(words, None)
        elif word not in without and word.partition("=")[0] not in valued:
            typed.append(word)
    return shlex.join(typed)


def emit(as_json: bool, data: Any, text: Callable[[], None]) -> None:
    """Print `data` as JSON, null for what is not finite, or the text for people."""
    if as_json:
        narrow = "utf" not in (getattr(sys.stdout, "encoding", None) or "utf").lower()
        print(json.dumps(plain(data), indent=1, ensure_ascii=narrow, allow_nan=False))
    else:
        text()


def numbers(
    name: str, text: str, unit: str, count: int | None = None, what: str = "wheels"
) -> list[float]:
    """Numbers with commas between, in SI, `count` of them if given; each may have its unit.

    `InputError` names every one that is none.
    """
    from ..._errors import InputError
    from ...rig import typed_numbers

    values = typed_numbers(name, text, unit)
    if count is not None and len(values) != count:
        kind = "the rig has" if what == "wheels" else "it needs"
        have = f"{len(values)} value{'s' * (len(values) > 1)}"
        raise InputError(f"`{name}` has {have}, but {kind} {count} {what}.")
    return values


def number(name: str, text: str, unit: str) -> float:
    """A number in SI from text with or without a unit; `InputError` names the option."""
    from ...rig import typed_number

    return typed_number(name, text, unit)


def above_zero(name: str, text: str | None, unit: str) -> float | None:
    """The same of a number that must be above 0; None where nothing was typed."""
    from ...rig import typed_above_zero

    return None if text is None else typed_above_zero(name, text, unit)
