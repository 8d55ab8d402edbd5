"""Seconds from the start of a second process to its first result (CPU time, as microseconds)."""

import subprocess
import sys
import tempfile

from ._clock import Tool

_FIRST = """
import numpy as np, omnijax
rig = omnijax.load_rig("atlas")
run = omnijax.simulate(rig, omnijax.speeds([0.1, 1.2, 0.3]), np.linspace(0, 8, 8001){extra})
assert run.ok, run.message()
"""


def tools(skip) -> list[Tool]:
    """`import jax` alone, and `simulate` of the Atlas rig, 8 s, with and without a warm cache."""
    import os

    cache = tempfile.mkdtemp(prefix="omnijax-cache-")
    environment = dict(os.environ, OMNIJAX_CACHE_DIR=cache)

    def process(text):
        def run():
            subprocess.run([sys.executable, "-c", text], check=True, env=environment)

        return run

    first = process(_FIRST.format(extra=""))
    empty = Tool("omnijax no cache", first, 1, lambda _: None, 1, "compiles")
    return [
        empty,  # its one round comes before the others' second
        Tool("import jax", process("import jax"), 1, lambda _: None, 3),
        Tool("omnijax", first, 1, lambda _: None, 3, "8 s of the Atlas rig, 8001 samples"),
    ]
