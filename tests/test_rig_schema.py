"""The JSON Schema accepts what the reader accepts, and refuses what an editor can see."""

import tomllib
from importlib import resources

import jsonschema
import pytest
from rigs import ATLAS, MISSING, effect, tables, with_effects

from omnijax.rig import bundled_rigs, json_schema, parse_rig

VALIDATOR = jsonschema.Draft202012Validator(json_schema())


def test_it_is_a_schema():
    jsonschema.Draft202012Validator.check_schema(json_schema())


@pytest.mark.parametrize("name", bundled_rigs())
def test_bundled_rigs_are_valid(name):
    VALIDATOR.validate(tomllib.loads(bundled_rigs()[name].read_text(encoding="utf-8")))


def test_the_commented_file_is_valid_also_with_its_comments_taken_off():
    file = resources.files("omnijax") / "rig" / "data" / "template" / "rig.toml"
    text = file.read_text(encoding="utf-8")
    VALIDATOR.validate(tomllib.loads(text))
    assert parse_rig(tomllib.loads(text)).size == 3
    first = text.index("# [[effect]]")
    last = text.index("# [[effect]]                  # a law of your own")
    block = text[first:last].replace("\n# ", "\n").removeprefix("# ")
    text = text[:first] + block + text[last:]
    text = text.replace("# gravity", "gravity").replace("# centre_of_mass", "centre_of_mass")
    rig = parse_rig(tomllib.loads(text))
    assert rig.effects[0].law.id == "wheel-runout" and rig.platform.gravity[2] == -9.81


GOOD = [
    tables((("sphere", "inertia"), [[1, 0, 0], [0, 1, 0], [0, 0, 1]])),
    tables((("sphere", "mass"), "5 kg")),
    with_effects(effect("wheel-runout", "w1", amplitude=1e-4, phase="90 deg")),
    with_effects({"id": "lift-off", "place": "all"}),
]
BAD = [
    tables((("sphere", "radus"), 1)),
    tables((("sphere", "mass"), MISSING)),
    tables((("sphere", "mass"), -5)),
    tables((("wheel", 0, "roundness"), 1.2)),
    tables((("wheel", 0, "rollers"), 14.5)),
    tables((("wheel", 0, "profile"), "round")),
    tables((("wheel", 0, "normal"), [1, 0])),
    with_effects(effect("wheel-runot", "w1")),
    with_effects(effect("wheel-runout", "w1", amplitud=1, phase=0)),
    with_effects(effect("wheel-runout", "w1", amplitude=1, phase=0, amplitud=1)),
    with_effects({"id": "wheel-runout", "place": "w1"}),
]


@pytest.mark.parametrize("data", GOOD)
def test_good_files(data):
    VALIDATOR.validate(data)
    parse_rig(data)


@pytest.mark.parametrize("data", BAD)
def test_bad_files(data):
    assert not VALIDATOR.is_valid(data)
    with pytest.raises(ValueError, match="`"):
        parse_rig(data)


def test_the_baseline_is_the_papers():
    assert ATLAS["sphere"]["radius"] == 1.22
    assert [wheel["contact"]["stiffness"] for wheel in ATLAS["wheel"]] == [188208.0] * 3
