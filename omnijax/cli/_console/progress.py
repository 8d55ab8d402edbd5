"""What commands show while they work."""

import sys
import threading
import time
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


STILL = 4.0  # s without a word after which a stage says that it goes on


@contextmanager
def stages() -> Iterator[Callable[[str], None]]:
    """`tell(text)`: the stage that begins, with the time, as a line on the error stream.

    A stage that takes longer says every `STILL` seconds that it goes on.
    """
    begun, said = time.monotonic(), threading.Condition()
    stage, since, over = "", begun, False

    def line(text: str) -> None:
        print(f"{time.monotonic() - begun:6.1f} s  {text}", file=sys.stderr, flush=True)

    def tell(text: str) -> None:
        nonlocal stage, since
        with said:
            line(text)
            stage, since = text, time.monotonic()
            said.notify()

    def go_on() -> None:
        with said:
            while not over:
                if not said.wait(STILL) and stage:
                    line(f"... {time.monotonic() - since:.0f} s of it: {stage}")

    thread = threading.Thread(target=go_on, daemon=True)
    thread.start()
    try:
        yield tell
    finally:
        with said:
            over = True
            said.notify()
        thread.join()


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
