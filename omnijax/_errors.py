"""The error of wrong input: every problem at once, each as one sentence."""

import difflib
import importlib
import traceback
import warnings
from collections.abc import Iterable, Sequence
from typing import Any

USERS_MODULE = "omnijax_user_"  # begins the names of modules made of users' programs
LONG = 700  # characters; the longest line that is said
MOST = 100  # lines, and problems
WORD = 200  # characters that two words are compared by


class InputError(ValueError):
    """What the user gave cannot be used; `problems` holds one sentence each.

    The command line prints the sentences and exits with code 2.
    """

    def __init__(self, problems: str | Sequence[str], source: object = None):
        sentences = (problems,) if isinstance(problems, str) else tuple(problems)
        where = "" if source is None else f"{source}: "
        self.problems = tuple(where + brief(sentence) for sentence in sentences[:MOST])
        if len(sentences) > MOST:
            self.problems += (f"{where}and {len(sentences) - MOST} more.",)
        super().__init__("\n".join(self.problems))


def in_users_program(error: BaseException) -> str | None:
    """What went wrong in which line of a user's program (a law file, a machine); None elsewhere."""
    places = [
        f"{frame.f_code.co_filename}, line {line}"
        for frame, line in traceback.walk_tb(error.__traceback__)
        if str(frame.f_globals.get("__name__", "")).startswith(USERS_MODULE)
    ]
    return f"{places[-1]}: {type(error).__name__}: {error}" if places else None


def reason_of(error: BaseException) -> str:
    """The message of a library's error without a full stop; the error's name if it has none."""
    return str(error).strip().rstrip(".") or type(error).__name__


class DataWarning(UserWarning):
    """Something of the user's is damaged or unusual, and the work goes on without it."""


def tell(sentences: Iterable[str]) -> None:
    """Warn of `sentences`; the command line prints each on the error stream."""
    for sentence in sentences:
        warnings.warn(brief(sentence), DataWarning, stacklevel=3)


def brief(text: str) -> str:
    """`text` with its long lines cut in the middle: a value of megabytes is not echoed whole."""
    lines = text.split("\n")
    cut = [
        x if len(x) <= LONG else f"{x[: LONG - 200]} [… {len(x) - LONG} characters …] {x[-200:]}"
        for x in lines[:MOST]
    ]
    return "\n".join([*cut, f"and {len(lines) - MOST} more."] if len(lines) > MOST else cut)


def nearest(word: str, options: Iterable[str]) -> str | None:
    """The option closest to `word`; None where none is close."""
    near = {option.lower()[:WORD]: option for option in options}
    close = difflib.get_close_matches(str(word).lower()[:WORD], list(near), n=1, cutoff=0.6)
    return near[close[0]] if close else None


def did_you_mean(word: str, options: Iterable[str]) -> str:
    """` Did you mean ...?` for the option closest to `word`; empty where none is close."""
    close = nearest(word, options)
    return f" Did you mean `{close}`?" if close else ""


def not_above_zero(unit: str = "", /, **numbers: float | None) -> list[str]:
    """A sentence for each number that is not finite and above 0; None is no number."""
    return [
        f"`{name}` must lie in (0, inf){unit and f' {unit}'}, but is {value:g}."
        for name, value in numbers.items()
        if value is not None and not 0 < value < float("inf")
    ]


def refuse_batch(shape: Sequence[int], what: str) -> None:
    """`InputError` for the shape of a batch, as `jax.vmap` makes it; `what` follows its size."""
    if shape:
        raise InputError(
            f"this is a batch of {size_words(shape)}{what} where one is needed: ask inside "
            "`jax.vmap`, or take one by `jax.tree.map(lambda x: x[0], batch)`."
        )


def size_words(shape: Sequence[int]) -> str:
    """A shape as people write it: 2x3."""
    return "x".join(map(str, shape))


class RunError(RuntimeError):
    """The input was right but the work failed; the command line exits with code 1."""


def require(module: str, extra: str, what: str = "this", package: str | None = None) -> Any:
    """An optional module; where it is absent, an `InputError` with the command that installs it.

    `what` needs it, in words; `package` is its name to the installer where that is another one.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{module}.".startswith(f"{error.name}."):
            raise
        package = package or module.partition(".")[0]
        raise InputError(
            f"{what} needs `{package}`, which is not installed: pip install 'omnijax[{extra}]'."
        ) from None
