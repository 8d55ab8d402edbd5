"""One name for a quantity: in the rig file, the commands, Python and on pages."""

import re
from pathlib import Path

import pytest

import omnijax
from omnijax.rig import FACTS
from omnijax.simulation import Trajectory

PAGE = (Path(__file__).parents[1] / "docs" / "glossary.md").read_text(encoding="utf-8")
HELP = (Path(__file__).parent / "data" / "help.txt").read_text(encoding="utf-8")
NAMES = PAGE[PAGE.index("## One name everywhere") :]
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in NAMES.splitlines()
    if line.startswith("| ") and "---" not in line
]
QUANTITIES = [row for row in ROWS if len(row) == 4][1:]
DRIVES = [row for row in ROWS if len(row) == 5][1:]
RIG = omnijax.load_rig("atlas")


@pytest.mark.parametrize("row", QUANTITIES, ids=lambda row: row[0])
def test_a_quantity_of_the_rig_has_its_name_unit_and_label(row):
    for path in re.findall(r"`([^`]+)`", row[1]):
        assert omnijax.parameter_info(RIG, path.replace("w1", RIG.names[0])).unit == row[3]
    labels = [fact.label for fact in FACTS.values()]
    if not row[2].startswith("sphere "):
        assert any(label.startswith(row[2]) for label in labels), labels


def test_every_number_that_check_prints_of_a_wheel_is_in_the_glossary():
    said = PAGE.lower()
    for fact in FACTS.values():
        word = fact.label.split(" (")[0].rsplit(" ", 1)[0].lower()
        assert word in said or word.split()[0] in said, fact.label


@pytest.mark.parametrize("row", DRIVES, ids=lambda row: row[0])
def test_a_drive_has_its_option_and_its_channel_of_a_run(row):
    for option in re.findall(r"`(--[a-z]+)", row[1]):
        assert re.search(rf"{option}\b", HELP), option
    for channel in re.findall(r"`run\.(\w+)`", row[4]):
        assert channel in Trajectory.__dataclass_fields__
    for name in re.findall(r"`(\w+)`", row[4]):
        assert hasattr(omnijax, name)


def test_the_metrics_of_the_glossary_are_metrics():
    words = re.findall(r"`(\w*(?:rms|peak))`", NAMES)
    assert len(words) >= 6 and set(words) <= set(omnijax.METRICS)
