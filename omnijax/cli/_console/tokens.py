"""What is typed, before it is parsed; and help texts that break at words."""

import inspect
import re
from collections.abc import Callable, Sequence

_NEGATIVE = re.compile(r"-(\d|\.\d)")
_SECTION = re.compile(r"\nParameters\n-+\n")


def understood(tokens: Sequence[str]) -> list[str]:
    """The tokens with negative values tied to their option, and `help` for `--help`.

    `--speed -1,2,3` reads `--speed=-1,2,3`: no option of ours begins with a digit.
    """
    words: list[str] = []
    for token in tokens:
        last = words[-1] if words else ""
        if _NEGATIVE.match(token) and last.startswith("--") and "=" not in last:
            words[-1] = f"{last}={token}"
        else:
            words.append(token)
    return [*words[1:], "--help"] if words[:1] == ["help"] else words


def flowing(function: Callable) -> str:
    """A command's docstring with one line a paragraph and one a parameter's description.

    The help then breaks where the terminal ends, and not where the source did.
    """
    head, *rest = _SECTION.split(inspect.getdoc(function) or "", maxsplit=1)
    text = "\n\n".join(" ".join(part.split()) for part in re.split(r"\n\s*\n", head))
    if not rest:
        return text
    described: list[str] = []
    for line in rest[0].splitlines():
        deeper = line.startswith("    ") and described and described[-1].startswith("    ")
        if deeper:
            described[-1] += f" {line.strip()}"
        else:
            described.append(line)
    return "\n".join([text, "", "Parameters", "----------", *described])
