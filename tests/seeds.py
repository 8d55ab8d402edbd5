"""Random numbers that are drawn anew in every run; a failing test shows how to draw them again."""

import os
import secrets
import zlib

import numpy as np


def drawn_anew(name: str) -> np.random.Generator:
    """A generator of the run's seed and `name`: tests of other names draw other numbers.

    The run's seed is `OMNIJAX_TEST_SEED`, else drawn; it is printed.
    """
    seed = int(os.environ.get("OMNIJAX_TEST_SEED") or secrets.randbits(32))
    print(f"{name}: to draw the same again, OMNIJAX_TEST_SEED={seed}")
    return np.random.default_rng([seed, zlib.crc32(name.encode())])
