"""Seconds from the start of a second process to its first result (CPU time, as microseconds)."""

import subprocess
import sys
import tempfile

from ._clock import Tool

_FIRST = """
import numpy as np, omnijax
rig = omnijax.load_rig("atlas")
run = omnijax.simulate(rig, omnijax.speeds([0.1, 1.2, 0.3]), np.linspace(0, 8, 8001))
assert run.ok, run.message()
"""


def tools(skip) -> list[Tool]:
    """`import jax` alone, and `simulate` of the Atlas rig, 8 s, with and without a warm cache."""
    import os

    def process(text):
        cache = tempfile.mkdtemp(prefix="omnijax-cache-")  # one for each tool
        environment = dict(os.environ, OMNIJAX_CACHE_DIR=cache)
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed package has its bytecode

        def run():
            subprocess.run([sys.executable, "-c", text], check=True, env=environment)

        return run

    note = "8 s of the Atlas rig, 8001 samples"
    return [
        Tool("omnijax no cache", process(_FIRST), 1, lambda _: None, 1, "compiles", True),
        Tool("import jax", process("import jax"), 1, lambda _: None, 3),
        Tool("omnijax", process(_FIRST), 1, lambda _: None, 3, note),
    ]
