"""The frame of the command line: commands, exit codes, and what an error looks like.

A command is a file of this folder with one function of the same name, registered in `COMMANDS`.
Its module imports nothing heavy: the work is imported inside the function, so that `--help` answers
at once.  Its docstring holds an example.  It returns an exit code or nothing.
"""

import errno
import importlib
import os
import sys
import warnings
from collections.abc import Callable

from cyclopts import App, CycloptsError, Group
from cyclopts.exceptions import UnknownOptionError, UnusedCliTokensError

from .. import __version__
from .._consent import law_files
from .._errors import DataWarning, InputError, RunError, brief, in_users_program, nearest
from .._files import command
from .._interrupts import NOTHING, answer, exit_code, interrupted
from ._console import PLAIN, flowing, understood, waiting
from ._inputs import read_force

OK, FAILED, BAD_INPUT = 0, 1, 2

_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO, errno.EFBIG)

COMMANDS: dict[str, tuple[str, ...]] = {  # section of the help -> its commands, in order
    "The paper": ("reproduce",),
    "Rig files": ("init", "check", "effects", "schema"),
    "Runs": ("simulate",),
    "Studies": (
        "sweep",
        "sweep-status",
        "export",
        "sensitivity",
        "global-sensitivity",
        "design",
        "pareto",
        "tolerances",
    ),
    "Diagnosis": ("case", "diagnose"),
    "Look": ("replay", "explore", "orders"),
}

_EPILOGUE = (
    "Exit codes: 0 done, 1 a run failed, 2 wrong input, 130 interrupted, 143 by SIGTERM. "
    "Law files that a rig names are programs: each runs only once you have allowed its content, in "
    "answer to a question or by --trust-laws with any command. "
    "Every command explains itself: omnijax COMMAND --help, or omnijax help COMMAND. "
    "Completion of commands and options in your shell: omnijax --install-completion"
)


def build_app() -> App:
    """The application with every command of `COMMANDS`."""
    app = App(
        name="omnijax",
        help="Simulate, design and diagnose a sphere on omnidirectional wheels.\n\n"
        "Example: omnijax check atlas",
        version=f"omnijax {__version__}",
        help_epilogue=_EPILOGUE,
        help_format="plaintext",
        result_action="return_value",
        exit_on_error=False,
        print_error=False,
        suppress_keyboard_interrupt=False,
    )
    app.register_install_completion_command(help="Install completion for bash, zsh or fish.")
    for order, (section, names) in enumerate(COMMANDS.items()):
        group = Group(section, sort_key=order)
        for name in names:
            module = importlib.import_module(f".{name.replace('-', '_')}", __package__)
            function = getattr(module, name.replace("-", "_"))
            function.__doc__ = flowing(function)
            app.command(function, name=name, group=group, help_epilogue="")
    app["--help"].group = app["--version"].group = Group("Options", sort_key=9)
    app["--install-completion"].group = app["--help"].group
    return app


def run(tokens: list[str] | None = None) -> int:
    """Run the command line; the exit code."""
    _plain_streams()
    try:
        with command(), warnings.catch_warnings():
            warnings.simplefilter("always", DataWarning)
            warnings.showwarning = _show_once()
            words = understood(sys.argv[1:] if tokens is None else tokens)
            trusted = "--trust-laws" in words
            words = [word for word in words if word != "--trust-laws"]
            with law_files("trust" if trusted else "ask"), waiting(words[0] if words else ""):
                code = build_app()(read_force(words))
        sys.stdout.flush()
        return code if isinstance(code, int) else OK
    except KeyboardInterrupt as interrupt:
        answer()
        return _say(str(interrupt) or NOTHING, exit_code())
    except BrokenPipeError:  # the reader, `head` say, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except Exception as error:
        if interrupted():  # a library made another error of it
            answer()
            return _say(NOTHING, exit_code())
        said = _told(error)
        if said is None:  # a fault of ours is not hidden
            raise
        return _say(*said)


def _show_once() -> Callable[..., None]:
    """A warning as one line, without the place in the source; of one command each line once."""
    shown: set[str] = set()

    def show(message: Warning | str, category: type[Warning], *_: object) -> None:
        if str(message) not in shown:
            print(f"warning: {message}", file=sys.stderr)
        shown.add(str(message))

    return show


def _told(error: Exception) -> tuple[str, int] | None:
    """What to tell the user, and the exit code; None for a fault of the program."""
    if isinstance(error, CycloptsError):
        command = " ".join(["omnijax", *(error.command_chain or ())])
        return f"{brief(_misread(error))}\nSee: {command} --help", BAD_INPUT
    if isinstance(error, RunError):
        return str(error), FAILED
    text = None
    if isinstance(error, InputError):
        text = str(error)
    elif isinstance(error, OSError) and error.filename is not None:  # a file of the user's
        text = f"{error.filename}: cannot be read or written: {error.strerror}."
    elif isinstance(error, OSError) and error.errno in _DISK:
        text = f"a result cannot be written: {error.strerror}."
    elif isinstance(error, MemoryError):
        text = "this needs more memory than there is: ask for less at a time."
    else:
        text = in_users_program(error)
    return None if text is None else (brief(text), BAD_INPUT)


def _misread(error: CycloptsError) -> str:
    """The parser's sentence; what it takes for the nearest option only where it is near."""
    text = str(error).strip()
    if isinstance(error, UnusedCliTokensError):
        return f"not expected here: {', '.join(error.unused_tokens or ())}."
    if not isinstance(error, UnknownOptionError) or error.token is None:
        return text
    options = {
        name.removeprefix("--"): name
        for argument in error.argument_collection or ()
        for name in argument.names
    }
    typed = (error.token.keyword or error.token.value).partition("=")[0].removeprefix("--")
    near = nearest(typed, options)
    return text.partition(" Did you mean")[0] + (
        f" Did you mean `{options[near]}`?" if near else ""
    )


def _plain_streams() -> None:
    """A terminal or file without our signs gets others in their place, and no error."""
    for stream in (sys.stdout, sys.stderr):
        if "utf" not in (getattr(stream, "encoding", None) or "utf").lower():
            stream.reconfigure(errors=PLAIN)  # pyright: ignore


def _say(text: str, code: int) -> int:
    print(text, file=sys.stderr)
    return code
