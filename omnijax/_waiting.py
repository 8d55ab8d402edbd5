"""Who wants to hear of long compilations; nothing here needs jax."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

PATIENCE = 2.0  # s before a compilation is told
listeners: list[Callable[[], None]] = []  # called at the first long compilation, and never again


class Patience(threading.local):
    """Calls `listeners` where `stop` does not follow `start` in the same thread in `PATIENCE`."""

    def __init__(self) -> None:
        self._timer: threading.Timer | None = None

    def start(self) -> None:
        """Something that may take long begins."""
        self.stop()
        if listeners:
            self._timer = threading.Timer(PATIENCE, _tell)
            self._timer.daemon = True
            self._timer.start()

    def stop(self) -> None:
        """It has ended."""
        if self._timer is not None:
            self._timer.cancel()


def _tell() -> None:
    while listeners:
        listeners.pop()()


@contextmanager
def told() -> Iterator[None]:
    """Tell `listeners` where the compilation inside takes long."""
    patience = Patience()
    patience.start()
    try:
        yield
    finally:
        patience.stop()
