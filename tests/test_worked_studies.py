"""The worked studies of experiments/ run as they stand and assert their own answers."""

import runpy
from pathlib import Path

import matplotlib as mpl
import pytest

pytestmark = pytest.mark.long

FOLDER = Path(__file__).parents[1] / "experiments"
STUDIES = (
    "wheel_design",
    "robust_design",
    "spread_design",
    "pareto_front3",
    "part_tolerances",
    "stiffness_claim",
)


@pytest.mark.parametrize("name", STUDIES)
def test_worked_study(name, tmp_path, monkeypatch):
    monkeypatch.setattr("sys.argv", [name, str(tmp_path)])
    with mpl.rc_context():
        runpy.run_path(str(FOLDER / f"{name}.py"), run_name="__main__")


def test_every_study_file_belongs_to_an_experiment():
    text = "".join(path.read_text(encoding="utf-8") for path in FOLDER.glob("*.py"))
    for path in (FOLDER / "studies").glob("*.toml"):
        assert f'"{path.name}"' in text, path
