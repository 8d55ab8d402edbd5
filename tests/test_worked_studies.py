"""The worked studies of experiments/ run as they stand and assert their own answers."""

from pathlib import Path

import pytest
from test_shapes import holds

pytestmark = pytest.mark.long

FOLDER = Path(__file__).parents[1] / "experiments"
LONG_STUDIES = ("wheel_design", "robust_design", "spread_design", "pareto_front3")
SHORT_STUDIES = ("part_tolerances", "stiffness_claim")
STUDIES = [*SHORT_STUDIES, *(pytest.param(name, marks=pytest.mark.full) for name in LONG_STUDIES)]


@pytest.mark.parametrize("name", STUDIES)
def test_worked_study(name, tmp_path):
    """With every annotated shape checked on the way."""
    holds(name, tmp_path)


def test_every_study_file_belongs_to_an_experiment():
    text = "".join(path.read_text(encoding="utf-8") for path in FOLDER.glob("*.py"))
    for path in (FOLDER / "studies").glob("*.toml"):
        assert f'"{path.name}"' in text, path
