"""The bar that commands show while they work."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..._waiting import listeners


@contextmanager
def bar(what: str) -> Iterator[Callable[[int, int], None]]:
    """`report(done, total)` on the error stream with the time left; silent where no one looks."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed}/{task.total}"),
        TimeRemainingColumn(),
    )
    shown = console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=not shown) as progress:
        task = progress.add_task(what, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


SECONDS = {
    "simulate": 9, "sweep": 8, "sensitivity": 13, "design": 15, "pareto": 20, "explore": 15,
    "global-sensitivity": 15, "reproduce": 25,
}  # fmt: skip


@contextmanager
def waiting(command: str) -> Iterator[None]:
    """One line on the error stream where something is compiled for long.

    `SECONDS` are those of three wheels on one core of 3 GHz.
    """

    def tell() -> None:
        about = f"about {SECONDS[command]} s of CPU" if command in SECONDS else "some seconds"
        print(f"compiling, {about}: it is kept, and the next {command} of this kind does not wait "
              "for it", file=sys.stderr, flush=True)  # fmt: skip

    listeners.append(tell)
    try:
        yield
    finally:
        listeners.clear()
