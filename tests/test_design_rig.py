"""Designs of the rig from study files, through the command line."""

import numpy as np

from omnijax.cli._frame import run
from omnijax.study import parse_study
from omnijax.study._design_rig import RigCases
from omnijax.study._tolerance import allocate

SPEED = (3.0, 5.1, 7.3)
TEXT = """
rig = "atlas"
[[drive]]
speed = [3.0, 5.1, 7.3]
[[variable]]
path = "contact.damping"
low = 60
high = 2000
[[variable]]
path = "closure.preload"
low = 60
high = 300
[[constraint]]
quantity = "slip_margin"
min = 30.0
[[constraint]]
quantity = "preload"
max = 120.0
[search]
starts = 3
batch = 3
"""


def test_cases_are_every_drive_with_every_load():
    study = parse_study(
        {
            "drive": [{"name": "slow", "speed": [1, 2, 3]}, {"name": "fast", "speed": [4, 5, 6]}],
            "load": [
                {"name": "light", "set": {"sphere.mass": 4.0}},
                {"name": "heavy", "set": {"wheel.mass": 0.5}},
            ],
            "tolerance": {"contact.stiffness": 0.1, "draws": 4},
        }
    )
    cases = RigCases(study, ("rms",))
    assert cases.cases == ("slow, light", "slow, heavy", "fast, light", "fast, heavy")
    assert cases.load_paths[0] == "sphere.mass" and cases.loads.shape == (2, 4)
    assert np.allclose(cases.loads, [[4.0, 0.25, 0.25, 0.25], [5.0, 0.5, 0.5, 0.5]])
    assert cases.draws().shape == (5, 3) and np.allclose(np.abs(cases.draws()[1:]), 0.1)


def test_allocation_uses_up_the_room():
    """z sqrt(sum (g t)^2 / 3) = room, equal parts, and a capped part leaves its share."""
    slopes = np.array([3.0, -1.0, 0.001, 0.0])
    width = allocate(slopes, 0.1, 0.95)
    assert np.isclose(1.6448536 * np.sqrt(np.sum((slopes * width) ** 2) / 3), 0.1)
    assert np.isclose(3.0 * width[0], width[1]) and width[2] == width[3] == 0.2


def test_json_of_a_failed_study_is_one_message(tmp_path, capsys):
    path = tmp_path / "study.toml"
    path.write_text(TEXT.replace('"contact.damping"', '"contact.dampin"'))
    assert run(["design", str(path), "--json"]) == 2
    text = capsys.readouterr().err
    assert "Did you mean `contact.damping`?" in text and "Traceback" not in text
