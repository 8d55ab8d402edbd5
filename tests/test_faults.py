"""A part of the attacks drawn at random; `python -m tests.faults` runs all."""

import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.faults.inputs import attack, cases, prepare


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes in folders")
def test_wrong_inputs_end_with_a_sentence_and_change_nothing(tmp_path, monkeypatch):
    every = cases()
    assert len(every) >= 300 and len({case.name for case in every}) == len(every)
    monkeypatch.chdir(tmp_path)
    prepare(tmp_path)
    wrong = {case.name: said for case in cases(60, seed=7) if (said := attack(case)) is not None}
    assert wrong == {}
