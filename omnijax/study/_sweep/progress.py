"""How far a sweep is: a bar while it runs, and the same figures read from its store."""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..._status import FAILED, Status
from .store import Store, chunk_files, is_running

RECENT = 20  # chunks that the rate is taken from
LINE_EVERY = 10.0  # s between lines where there is no terminal


class Progress(NamedTuple):
    """State of a stored sweep."""

    designs: int
    done: int
    chunks: int
    chunks_done: int
    running: bool
    rate: float | None  # designs/s, of the latest chunks
    time_left: float | None  # s
    last_chunk: float | None  # s since the latest one was finished


def progress(store: Store) -> Progress:
    """Progress of a store on disk, from the chunks' files alone."""
    assert store.folder is not None
    return progress_of(store.folder, store)


def progress_of(folder: Path, store: Store) -> Progress:
    """Progress of `store`, which lies in `folder`."""
    files = {i: at for i, at in chunk_files(folder).items() if i not in store.damaged}
    done = store.count(files)
    times = sorted(files.values())
    recent = times[-RECENT:]
    span = recent[-1] - recent[0] if len(recent) > 1 else 0.0
    rate = (len(recent) - 1) * store.spec.chunk / span if span > 0 else None
    left = (store.size - done) / rate if rate and done < store.size else None
    last = time.time() - times[-1] if times else None
    return Progress(
        store.size, done, store.chunks, len(files), is_running(folder), rate, left, last
    )


class Bar:
    """A bar with rate and time left on a terminal, a line every ten seconds elsewhere."""

    def __init__(self, console: Any = None):
        from rich.console import Console

        self._console = console or Console(stderr=True)
        self._bar: Any = None
        self._task: Any = None
        self._failed = 0
        self._done = 0
        self._new = 0
        self._began = self._said = time.monotonic()

    def __enter__(self) -> Callable[[Store, int, np.ndarray], None]:
        return self._advance

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def _advance(self, store: Store, chunk: int, status: np.ndarray) -> None:
        self._failed += int(np.isin(status, FAILED).sum())
        self._new += len(status)
        if self._done == 0:
            self._done = store.count(np.flatnonzero(store.done()).tolist())
        else:
            self._done += len(status)
        if self._console.is_terminal:
            self._draw(store.size)
        elif time.monotonic() - self._said > LINE_EVERY:
            self._said = time.monotonic()
            print(self._text(store.size), file=sys.stderr)

    def _rate(self) -> float:
        return self._new / max(time.monotonic() - self._began, 1e-9)

    def _text(self, size: int) -> str:
        left = (size - self._done) / self._rate()
        failed = f", {self._failed} without figures" if self._failed else ""
        return f"{self._done}/{size} designs, {self._rate():.4g}/s, {clock(left)} left{failed}"

    def _draw(self, size: int) -> None:
        if self._bar is None:
            from rich import progress as rich

            columns = (rich.BarColumn(), rich.TextColumn("{task.description}"))
            self._bar = rich.Progress(*columns, console=self._console, transient=True)
            self._task = self._bar.add_task("", total=size)
            self._bar.start()
        self._bar.update(self._task, completed=self._done, description=self._text(size))


def clock(seconds: float) -> str:
    """`1:02:03`, `2:03` or `12 s`."""
    seconds = round(seconds)
    if seconds < 60:
        return f"{seconds} s"
    minutes, hours = seconds // 60 % 60, seconds // 3600
    return f"{hours}:{minutes:02}:{seconds % 60:02}" if hours else f"{minutes}:{seconds % 60:02}"


def status_text(counts: dict[str, int]) -> str:
    """`950 ok, 50 slip`."""
    order = [member.text for member in Status if member.text in counts]
    return ", ".join(f"{counts[name]} {name}" for name in order) or "nothing yet"
