"""Runs and lanes side by side on the machine's cores.

NumPy and compiled programs let go of the interpreter, so threads are enough.
"""

import contextvars
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

_inside = contextvars.ContextVar("inside", default=False)


def cores() -> int:
    """Processor cores that this thread may use: 1 within `each`, where the others have work."""
    if _inside.get():
        return 1
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def each(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """`function` of every item, in the items' order, as many at a time as there are cores.

    The caller's context (NumPy's error handling) holds in the threads too.
    """
    items = list(items)
    workers = min(cores(), len(items))
    if workers < 2:
        return [function(item) for item in items]

    def work(context: contextvars.Context, item: Item) -> Result:
        return context.run(_marked, function, item)

    with ThreadPoolExecutor(workers) as pool:
        copies = [contextvars.copy_context() for _ in items]
        return list(pool.map(work, copies, items))


def _marked(function: Callable[[Item], Result], item: Item) -> Result:
    _inside.set(True)
    return function(item)
