"""Random numbers that are drawn anew in every run; a failing test shows how to draw them again."""

import os
import secrets

import numpy as np


def drawn_anew(name: str) -> np.random.Generator:
    """A generator with a seed of its own, or with `OMNIJAX_TEST_SEED`; prints which."""
    seed = int(os.environ.get("OMNIJAX_TEST_SEED") or secrets.randbits(32))
    print(f"{name}: to draw the same again, OMNIJAX_TEST_SEED={seed}")
    return np.random.default_rng(seed)
