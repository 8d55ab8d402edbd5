"""The tutorials of experiments/ run as they stand and assert their own answers."""

import runpy
from pathlib import Path

import matplotlib as mpl
import pytest
from tiers import tiered

pytestmark = pytest.mark.long

TUTORIALS = sorted((Path(__file__).parents[1] / "experiments").glob("tutorial_*.py"))


def dear(path):
    """All but one: test_python, test_sweep, test_design_rig and test_diagnosis ask for the same."""
    return path.stem != "tutorial_3_sensitivity"


@pytest.mark.parametrize("path", tiered(TUTORIALS, dear), ids=lambda path: path.stem)
def test_tutorial(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with mpl.rc_context():
        runpy.run_path(str(path), run_name="__main__")


def test_tutorials_read_as_notebooks():
    assert [path.stem.split("_")[1] for path in TUTORIALS] == ["1", "2", "3", "4", "5"]
    for path in TUTORIALS:
        text = path.read_text()
        assert text.startswith("# %% [markdown]\n# # "), path
        assert "**Question.**" in text and "**Answer.**" in text and "assert" in text, path
