"""Ctrl-C: heard at once, answered by the work, and obeyed whatever the work is doing.

SIGTERM, by which a system or a scheduler asks a process to end, is the same with a code of its own.

Python raises `KeyboardInterrupt` between two of its own steps.  While XLA compiles there is none,
inside a callback of C++ the exception is dropped, and a library may break that is half loaded.  So
a thread hears the signal as well: it asks again where the exception was held back or dropped, work
that does not answer within `PATIENCE` is ended where it stands, and so is everything at a second
Ctrl-C.  Nothing that is finished is lost by that: it is on the disk already.

What this imports is loaded before Ctrl-C can be heard: it is little.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from _thread import interrupt_main
from contextlib import contextmanager, suppress

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType
    from typing import Any, NoReturn

PATIENCE = 1.5  # s
AGAIN = 0.05  # s between two tries to raise what was lost
SIGNALS = (signal.SIGINT, signal.SIGTERM)
NOTHING = "Interrupted. Nothing more was written."


class _Heard:
    def __init__(self) -> None:
        self.count = 0
        self.own = 0  # of the signals in the pipe, those of `_insist`
        self.lost = False  # the exception was held back, or dropped
        self.answered = threading.Event()
        self.asking = threading.Lock()  # no `_insist` while the command ends
        self.said: Callable[[], str] = lambda: NOTHING

    def hear(self, number: int, presses: int = 1) -> None:
        """Note a signal, the first one by its number."""
        _first.append(number)
        self.count = max(self.count, presses)


_now: list[_Heard] = []  # of the running command, if any
_first: list[int] = []  # the signals that came while the latest command ran
_last: list[Callable[[], None]] = []  # what has to be done before the process ends


def at_end(clean: Callable[[], None]) -> Callable[[], None]:
    """Call `clean` where Ctrl-C ends the process, from whatever thread; a decorator."""
    _last.append(clean)
    return clean


@contextmanager
def listening() -> Iterator[None]:
    """Hear Ctrl-C inside this block; in a thread or without Unix signals, leave it to Python.

    In the background of a shell Ctrl-C is ignored, and SIGTERM is heard alone.
    """
    main = threading.current_thread() is threading.main_thread()
    before = {number: signal.getsignal(number) for number in SIGNALS}
    heard_ones = [n for n, now in before.items() if now not in (signal.SIG_IGN, None)]
    if not main or sys.platform == "win32" or not heard_ones or _now:
        yield
        return
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    heard = _Heard()
    _now.append(heard)
    _first.clear()
    for number in heard_ones:
        signal.signal(number, _raise)
    wakeup = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    hook, sys.unraisablehook = sys.unraisablehook, _dropped
    threading.Thread(target=_watch, args=(reading, heard), daemon=True).start()
    try:
        yield
    finally:
        with heard.asking:
            heard.answered.set()
        sys.unraisablehook = hook
        signal.set_wakeup_fd(wakeup)
        for number in heard_ones:
            signal.signal(number, before[number])
        os.close(writing)  # the thread reads the end, and ends
        _now.clear()


def interrupted() -> bool:
    """Whether Ctrl-C was pressed while this command ran."""
    return any(heard.count for heard in _now)


def exit_code() -> int:
    """What an interrupted command ends with, as shells count: 130 of Ctrl-C, 143 of SIGTERM."""
    return 128 + (_first[0] if _first else signal.SIGINT)


def answer() -> None:
    """Called by the work when it has begun to end because of the interruption."""
    for heard in _now:
        heard.answered.set()


def raise_lost() -> None:
    """Raise `KeyboardInterrupt` where one was pressed and has been lost on its way."""
    if any(heard.count and not heard.answered.is_set() for heard in _now):
        raise KeyboardInterrupt


@contextmanager
def saying(text: Callable[[], str]) -> Iterator[None]:
    """Text for the user if the work inside has to be ended: what is kept, and how to go on."""
    before = [heard.said for heard in _now]
    for heard in _now:
        heard.said = text
    try:
        yield
    finally:
        for heard, said in zip(_now, before, strict=False):
            heard.said = said


@contextmanager
def resumable(text: Callable[[], str]) -> Iterator[None]:
    """An interruption of the work inside ends it with `text`: what is kept, and how to go on."""
    try:
        with saying(text):
            yield
    except KeyboardInterrupt:
        answer()
        raise KeyboardInterrupt(text()) from None


def _raise(number: int, frame: FrameType | None) -> None:
    loading = _loading(frame)  # a library that is half loaded may crash
    for heard in _now:
        heard.hear(number)
        heard.lost = loading
    if not loading and not any(heard.answered.is_set() for heard in _now):
        raise KeyboardInterrupt


def _loading(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _dropped(unraisable: Any) -> None:
    """An exception that a callback could not pass on; of a Ctrl-C the thread takes care."""
    if not issubclass(unraisable.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(unraisable)
        return
    for heard in _now:
        heard.lost = True


def _watch(reading: int, heard: _Heard) -> None:
    """Hear the signals that the system writes into the pipe."""
    signals, insisting = 0, False
    while content := os.read(reading, 64):
        ours = [number for number in content if number in SIGNALS]
        signals += len(ours)
        presses = signals - heard.own
        if ours:
            heard.hear(ours[0], presses)
        if presses > 1:
            _end("Interrupted again: ended at once.")
        if presses and not insisting:
            insisting = True
            threading.Thread(target=_insist, args=(heard,), daemon=True).start()
    os.close(reading)


def _insist(heard: _Heard) -> None:
    """Raise again what was lost, until the work answers; end it where it does not."""
    latest = time.monotonic() + PATIENCE
    while not heard.answered.wait(AGAIN):
        if time.monotonic() > latest:
            text = NOTHING
            with suppress(Exception):
                text = heard.said()
            _end(text)
        with heard.asking:
            if heard.lost and not heard.answered.is_set():
                heard.lost = False
                heard.own += 1
                # `_raise` runs in the main thread, and looks where that is now
                interrupt_main(signal.Signals(_first[0]))


_hard: list[bool] = []


def end_hard() -> None:
    """Mark the process to end without destructors, as an interrupted library may be broken."""
    _hard.append(True)


def ends_hard() -> bool:
    """Whether Ctrl-C was pressed, or a library is broken."""
    return bool(_hard) or interrupted()


def leave(code: int) -> NoReturn:
    """End the process with what was said, and without the libraries' own ends."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):
            stream.flush()
    end_children()
    os._exit(code)


def _end(text: str) -> None:
    """End the process now: no destructor of a library runs into a dying interpreter."""
    for clean in _last:
        with suppress(Exception):
            clean()
    with suppress(Exception):
        os.write(2, f"{text}\n".encode())
    end_children()
    os._exit(exit_code())


def end_children() -> None:
    """End the worker processes that this one has started."""
    import multiprocessing

    for child in multiprocessing.active_children():
        with suppress(Exception):
            child.kill()
