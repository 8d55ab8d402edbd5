"""The tutorials of experiments/ run as they stand and assert their own answers."""

import runpy
from pathlib import Path

import matplotlib as mpl
import pytest

pytestmark = pytest.mark.long

TUTORIALS = sorted((Path(__file__).parents[1] / "experiments").glob("tutorial_*.py"))


def full(path):
    """The diagnosis belongs to the whole suite: `test_diagnosis` asks for less of the same."""
    return [pytest.mark.full] if path.stem.startswith("tutorial_5") else []


@pytest.mark.parametrize(
    "path", [pytest.param(path, marks=full(path), id=path.stem) for path in TUTORIALS]
)
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
