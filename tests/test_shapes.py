"""Annotated shapes hold in the product's flows, checked at every call."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from every_shape import FLOWS
from tiers import tiered

pytestmark = pytest.mark.long


DEAR = ("runs", "steady", "run_slopes", "sweeps", "torques", "four_wheels", "steady_slopes")


def holds(flows, folder):
    """Flows in a process of their own: the checker has to stand before omnijax is imported."""
    program = [sys.executable, str(Path(__file__).with_name("every_shape.py")), str(folder)]
    env = os.environ | {"JAX_DISABLE_MOST_OPTIMIZATIONS": "1"}  # its programs run briefly
    run = subprocess.run([*program, *flows], check=False, capture_output=True, text=True, env=env)
    assert run.returncode == 0, run.stderr[-3000:]
    assert all(f"shapes hold: {flow}" in run.stdout for flow in flows)


@pytest.mark.parametrize("dear", tiered([False, True], bool), ids=["flows", "dear flows"])
def test_every_annotated_shape_holds(dear, tmp_path):
    holds([flow for flow in FLOWS if (flow in DEAR) == dear], tmp_path)
