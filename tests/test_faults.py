"""A part of the attacks drawn at random; `python -m tests.faults` runs all and prints figures."""

import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.faults import commands, inputs, writes
from tests.faults.flips import flips_of_a_store
from tests.tiers import tiered

pytestmark = pytest.mark.skipif(
    not hasattr(os, "mkfifo"), reason="this system has no pipes in folders"
)
SEED = 20  # the command draws anew


def test_wrong_inputs_end_with_a_sentence_and_change_nothing(tmp_path, monkeypatch):
    every = inputs.cases()
    assert len(every) >= 600 and len({case.name for case in every}) == len(every)
    monkeypatch.chdir(tmp_path)
    inputs.prepare(tmp_path)
    some = inputs.cases(80, seed=SEED)
    wrong = {case.name: said for case in some if (said := inputs.attack(case)) is not None}
    assert wrong == {}, f"seed {SEED}"


@pytest.mark.parametrize("number", tiered([3, 5], (5).__eq__))
def test_failed_writes_leave_nothing_half_and_flipped_bits_are_named(number, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    commands.prepare_store(tmp_path)
    disk = writes.Disk()
    count, wrong = writes.some_faults(disk, number, seed=SEED)
    disk.close()
    assert (count, wrong) == (number, []), f"seed {SEED}"
    count, wrong = flips_of_a_store(4, seed=SEED)
    assert (count, wrong) == (4, []), f"seed {SEED}"
