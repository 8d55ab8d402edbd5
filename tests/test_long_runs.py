"""Long runs: made in pieces, which a kill leaves, and which are the run that goes on."""

import sys

import numpy as np
import pytest
from machines import ORTHOGONAL, SKEW, machine
from tiers import tiered

from omnijax.simulation import Gathered, propagate, propagate_in_pieces, speeds, table

pytestmark = pytest.mark.brief

PIECE = 64


@pytest.fixture(scope="module")
def rng():
    return np.random.default_rng(19)


def drives(rng, size):
    """Constant speeds, and a table with a jump, ramps and a value held at its end (as `ramp`)."""
    knots = np.sort(np.append(rng.uniform(0.05, 0.4, 4), [0.05, 0.2, 0.2, 0.4]))
    draw = 2 * rng.standard_normal((len(knots), size))
    angles = rng.uniform(0, 6, size).tolist()
    constant = speeds(draw[0].tolist(), rng.standard_normal(3).tolist(), angles)
    return {"constant": constant, "table": speeds(table(knots, draw), initial_angle=angles)}


def gathered(parts, length, runs=None):
    runs = runs or Gathered(length)
    for piece in parts:
        runs.add(piece.run)
    return runs.whole()


# constant speeds in the gate: killed runs of test_files
@pytest.mark.parametrize("kind", tiered(["constant", "table"], "constant".__eq__))
def test_pieces_are_the_run_and_go_on_from_any_of_them(rng, kind):
    rig = machine((SKEW, ORTHOGONAL)[rng.integers(2)], roundness=rng.uniform(0, 1))
    times = 0.03 + np.arange(3 * PIECE + 17) * 2e-3
    drive = drives(rng, rig.size)[kind]
    whole = propagate(rig, drive, times)
    parts = list(propagate_in_pieces(rig, drive, times, samples=PIECE))
    assert len(parts) > 3
    cut = int(rng.integers(1, len(parts)))
    done = sum(len(piece.run.t) for piece in parts[:cut])
    runs = Gathered(len(times))
    for piece in parts[:cut]:
        runs.add(piece.run)
    rest = propagate_in_pieces(
        rig, drive, times[done - 1 :], samples=PIECE, begun=parts[cut - 1].end, origin=times[0]
    )
    again = gathered(rest, len(times), runs)
    once = gathered(parts, len(times))
    for name in whole.UNITS:
        left, right = np.asarray(once[name]), np.asarray(whole[name])
        np.testing.assert_array_equal(left, again[name], err_msg=name)
        size = max(np.abs(right).max(), 1e-12)
        np.testing.assert_allclose(left, right, atol=1e-6 * size, err_msg=name)


@pytest.mark.full  # in the gate the pieces' numbers, above
def test_pieces_of_runs_of_any_length_are_one_program(rng, monkeypatch):
    """Every power of two was a program of its own: `simulate` compiled 4 s for another duration."""
    module, lengths = sys.modules[propagate.__module__], set()
    once = module._constant

    def noted(rig, drive, grid, *others):
        lengths.add(len(grid))
        return once(rig, drive, grid, *others)

    monkeypatch.setattr(module, "_constant", noted)
    rig = machine(SKEW)
    drive = drives(rng, rig.size)["constant"]
    for count in (1, int(rng.integers(2, PIECE)), PIECE, 2 * PIECE + 3):
        parts = list(propagate_in_pieces(rig, drive, np.arange(count) * 2e-3, samples=PIECE))
        assert sum(len(piece.run.t) for piece in parts) == count
    assert lengths == {PIECE}
