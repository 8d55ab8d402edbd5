"""Results that `jax.vmap` made: what they say, and what is asked of one alone."""

from typing import Any

import numpy as np
from jax.core import Tracer

from ._errors import refuse_batch, size_words
from ._status import Status


def check_single(shape: tuple[int, ...]) -> None:
    """`InputError` for the `shape` of a batch of results, as `jax.vmap` makes it."""
    refuse_batch(shape, ", from `jax.vmap` or `simulate_many`,")


def single_status(status: Any) -> Status:
    """How one run or steady state ended; `InputError` for a batch."""
    check_single(np.shape(status))
    return Status(int(status))


def batch_words(status: Any) -> str:
    """How a batch ended, counted, or that its numbers are not known yet; "" of a single status."""
    if isinstance(status, Tracer):
        return "traced"
    if not np.ndim(status):
        return ""
    codes, counts = np.unique(np.asarray(status), return_counts=True)
    ends = (f"{n} {Status(int(c)).text}" for c, n in zip(codes, counts, strict=True))
    return f"a batch of {size_words(np.shape(status))}: {', '.join(ends)}"
