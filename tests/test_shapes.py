"""Annotated shapes hold in the product's flows, checked at every call."""

import subprocess
import sys
from pathlib import Path

import pytest
from every_shape import FLOWS
from tiers import tiered

pytestmark = pytest.mark.long


def holds(flow, folder):
    """A flow in a process of its own: the checker has to stand before omnijax is imported."""
    program = [sys.executable, str(Path(__file__).with_name("every_shape.py")), str(folder), flow]
    run = subprocess.run(program, check=False, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr[-3000:]
    assert f"shapes hold: {flow}" in run.stdout


@pytest.mark.parametrize("flow", tiered(FLOWS, ("sweeps", "torques").__contains__))
def test_every_annotated_shape_holds(flow, tmp_path):
    holds(flow, tmp_path)
