"""The error of wrong input: every problem at once, each as one sentence."""

import difflib
import importlib
from collections.abc import Iterable, Sequence
from typing import Any


class InputError(ValueError):
    """What the user gave cannot be used; `problems` holds one sentence each.

    The command line prints the sentences and exits with code 2.
    """

    def __init__(self, problems: str | Sequence[str], source: object = None):
        sentences = (problems,) if isinstance(problems, str) else tuple(problems)
        where = "" if source is None else f"{source}: "
        self.problems = tuple(where + sentence for sentence in sentences)
        super().__init__("\n".join(self.problems))


def did_you_mean(word: str, options: Iterable[str]) -> str:
    """` Did you mean ...?` for the option closest to `word`; empty where none is close."""
    near = {option.lower(): option for option in options}
    close = difflib.get_close_matches(str(word).lower(), list(near), n=1, cutoff=0.6)
    return f" Did you mean `{near[close[0]]}`?" if close else ""


class RunError(RuntimeError):
    """The input was right but the work failed; the command line exits with code 1."""


def require(module: str, extra: str) -> Any:
    """An optional module; where it is absent, an `InputError` with the command that installs it."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module.partition(".")[0]:
            raise
        raise InputError(
            f"this needs `{module}`, which is not installed: pip install 'omnijax[{extra}]'."
        ) from None
