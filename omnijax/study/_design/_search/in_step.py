"""Searches in step: what all of them ask for at one time is evaluated together.

SciPy's methods call their objective and wait.  Here each search waits in a thread of its own until
every other one has asked too, or has ended; so what is evaluated together does not depend on which
thread is the faster one, and only the caller's thread evaluates.
"""

import threading
from collections.abc import Callable, Sequence
from queue import SimpleQueue
from typing import Any

import numpy as np

Ask = Callable[[np.ndarray], Any]  # a design (d,) to its figures


class _StoppedError(BaseException):
    """The figures that a search waits for will not come."""


def in_step(
    searches: Sequence[Callable[[Ask], Any]],
    figures: Callable[[np.ndarray], Sequence[Any]],
    ended: Callable[[int, Any], None] = lambda i, end: None,
) -> list[Any]:
    """What each search returns; `figures(points)` of all that is asked at one time, (n, d).

    `ended(i, end)` is called as search `i` ends.  What is raised in a search, by `figures` or by
    `ended`, or an interrupt, stops them all.
    """
    said: SimpleQueue = SimpleQueue()
    answers = [SimpleQueue() for _ in searches]

    def follow(i: int) -> None:
        def ask(point: np.ndarray) -> Any:
            said.put((i, "asks", point))
            answer = answers[i].get()
            if answer is None:
                raise _StoppedError
            return answer

        try:
            said.put((i, "ends", searches[i](ask)))
        except _StoppedError:
            pass
        except BaseException as error:
            said.put((i, "fails", error))

    threads = [threading.Thread(target=follow, args=(i,), daemon=True) for i in range(len(answers))]
    ends: list[Any] = [None] * len(threads)
    going = set(range(len(threads)))
    try:
        for thread in threads:
            thread.start()
        while going:
            asked: dict[int, np.ndarray] = {}
            while len(asked) < len(going):
                i, what, value = said.get()
                if what == "asks":
                    asked[i] = value
                    continue
                going.remove(i)
                if what == "fails":
                    raise value
                ends[i] = value
                ended(i, value)
            order = sorted(asked)
            if order:
                together = figures(np.array([asked[i] for i in order]))
                for i, answer in zip(order, together, strict=True):
                    answers[i].put(answer)
    finally:
        for i in going:
            answers[i].put(None)
        for thread in threads:
            thread.join()
    return ends
