"""The worked studies of experiments/ run as they stand and assert their own answers."""

from pathlib import Path

import pytest
from test_shapes import holds
from tiers import tiered

pytestmark = pytest.mark.long

FOLDER = Path(__file__).parents[1] / "experiments"
LONG_STUDIES = (
    "wheel_design", "robust_design", "spread_design", "pareto_front", "pareto_front3",
    "part_tolerances",
)  # fmt: skip
STUDIES = (*LONG_STUDIES, "stiffness_claim")


@pytest.mark.parametrize("name", tiered(STUDIES, LONG_STUDIES.__contains__))
def test_worked_study(name, tmp_path):
    """With every annotated shape checked on the way."""
    if name == "pareto_front":
        pytest.importorskip("pymoo")  # the method that it compares with
    holds([name], tmp_path)


def test_every_study_file_belongs_to_an_experiment():
    text = "".join(path.read_text(encoding="utf-8") for path in FOLDER.glob("*.py"))
    for path in (FOLDER / "studies").glob("*.toml"):
        assert f'"{path.name}"' in text, path
