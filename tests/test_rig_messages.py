"""What is refused, and the sentence that says so: file, key, found value, what is allowed."""

import re

import jax.numpy as jnp
import pytest
from rigs import MISSING, tables, with_effects
from rigs import effect as block

from omnijax.laws import BearingViscous
from omnijax.rig import (
    InputError,
    get_parameter,
    load_rig,
    parameter_paths,
    parse_rig,
    rig_text,
    save_rig,
    set_parameter,
)

TWICE = r"`effect\.bearing-viscous\.w1` stands twice: a rig file has one block an effect and place"
W1 = ("wheel", 1)
NAN = float("nan")

SINGLE = [
    (("sphere", "radius"), -1.0, "`sphere.radius` must lie in (0, inf), but is -1.0."),
    (("sphere", "mass"), 0, "`sphere.mass` must lie in (0, inf), but is 0."),
    (("sphere", "mass"), True, "`sphere.mass` must be a number (kg), but is True."),
    (("sphere", "mass"), [5.0], "`sphere.mass` must be a number (kg), but is [5.0]."),
    (("sphere", "mass"), NAN, "`sphere.mass` must be finite, but is nan."),
    (("sphere", "mass"), "5 N", "must be a number in kg or text with such a unit, but is '5 N'."),
    (("sphere", "mass"), "5", "must be a number in kg or text with such a unit, but is '5'."),
    (("sphere", "mass"), "5 blub", "but is '5 blub'. Its unit is not known."),
    (("sphere", "mass"), "-5 kg", "`sphere.mass` must lie in (0, inf), but is '-5 kg' (-5 kg)."),
    (("sphere", "mass"), MISSING, "`sphere.mass` is missing. Give a value in kg."),
    (("sphere", "inertia"), [[1, 0], [0, 1]], "must be a number or 3 rows of 3 numbers, but is"),
    (("sphere", "inertia"), [[2, 1, 0], [0, 2, 0], [0, 0, 2]], "must be symmetric, but is"),
    (("sphere", "inertia"), [[1, 2, 0], [2, 1, 0], [0, 0, 1]], "must be positive definite"),
    (("sphere", "inertia"), -1, "`sphere.inertia` must lie in (0, inf), but is -1."),
    (("sphere", "centre_of_mass"), [0, 0], "must be a list of 3 numbers, but is [0, 0]."),
    (("sphere", "radus"), 1, "`sphere.radus` is not a key of a rig file. Did you mean `radius`?"),
    (("sphere",), 3, "`sphere` must be a table, but is 3."),
    (("sphere",), MISSING, "`sphere` is missing."),
    (("platform", "gravity"), 9.81, "`platform.gravity` must be a list of 3 numbers, but is 9.81."),
    (("whel",), [], "`whel` is not a key of a rig file. Did you mean `wheel`?"),
    (("wheel",), [], "a rig needs at least one [[wheel]] block, but has none."),
    (("wheel",), {}, "`wheel` must be a list of tables ([[wheel]]), but is {}."),
    ((*W1, "roundness"), 1.3, "`wheel.w2.roundness` must lie in [0, 1], but is 1.3."),
    ((*W1, "roundness"), -0.1, "`wheel.w2.roundness` must lie in [0, 1], but is -0.1."),
    (
        (*W1, "rollers"),
        14.5,
        "`wheel.w2.rollers` must be a whole number in [1, 1000], but is 14.5.",
    ),
    ((*W1, "rollers"), 0, "`wheel.w2.rollers` must lie in [1, 1000], but is 0."),
    ((*W1, "radius"), 13, "`wheel.w2.radius` must lie below 12.14 m for these gaps, but is 13.0"),
    ((*W1, "normal"), [1, 1, 0], "must be a unit vector (length 1 within 1 %), but [1, 1, 0]"),
    ((*W1, "normal"), [1, 0, 0], "`wheel.w2.drive` must be perpendicular to `normal`"),
    ((*W1, "profile"), "gated-sin", "but is 'gated-sin'. Did you mean `gated-sine`?"),
    ((*W1, "profile"), 3, "`wheel.w2.profile` must be one of gated-sine, continuous-sine,"),
    ((*W1, "profile"), "dual-row", "`wheel.w2.row_spacing` is missing: profile 'dual-row' needs"),
    ((*W1, "profile"), "table", "`wheel.w2.table` is missing: profile 'table' needs it."),
    ((*W1, "row_spacing"), 0.1, "belongs to profile 'dual-row' only, but the profile is 'gated-si"),
    ((*W1, "table"), "x.csv", "`wheel.w2.table` belongs to profile 'table' only"),
    ((*W1, "name"), "w1", "`wheel.w1.name` must be unique, but 2 wheels have it."),
    ((*W1, "name"), "all", "`wheel.all.name` must not be 'all': the word has a meaning"),
    ((*W1, "name"), "dR_z", "`wheel.dR_z.name` must not be 'dR_z'"),
    ((*W1, "name"), "a.b", "must be printable text without dots, but is 'a.b'."),
    ((*W1, "name"), "", "`wheel.2.name` must be text of at least one character, but is ''."),
    ((*W1, "name"), 2, "`wheel.2.name` must be text, but is 2."),
    ((*W1, "contact"), 1, "`wheel.w2.contact` must be a table, but is 1."),
    ((*W1, "contact", "stiffness"), 0, "`wheel.w2.contact.stiffness` must lie in (0, 1e+15]"),
    ((*W1, "contact", "stiffness"), 1e16, "`wheel.w2.contact.stiffness` must lie in (0, 1e+15]"),
    ((*W1, "mount", "stiffness"), "2e15 N/m", "must lie in (0, 1e+15], but is '2e15 N/m'"),
    ((*W1, "closure", "stiffness"), 1e16, "`wheel.w2.closure.stiffness` must lie in [0, 1e+15]"),
    (
        (*W1, "contact", "damping"),
        -1,
        "`wheel.w2.contact.damping` must lie in [0, inf), but is -1.",
    ),
    ((*W1, "contact", "stifness"), 1, "Did you mean `stiffness`?"),
    (
        (*W1, "mount", "damping"),
        MISSING,
        "`wheel.w2.mount.damping` is missing. Give a value in N s",
    ),
    (("uncertainty", "contact.damping"), 0, "must lie in (0, inf), but is 0."),
    (("uncertainty", "contact.stifness"), 0.1, "Did you mean `contact.stiffness`?"),
    (("uncertainty", "wheel.w9.radius"), 0.1, "must be a parameter of the rig, but is none."),
    (("uncertainty", "wheel.rollers"), 0.1, "must be a parameter of the rig, but is none."),
    (("uncertainty", "contact"), {"damping": 0.1}, 'needs its key in quotes: "contact.damping"'),
]


@pytest.mark.parametrize(("path", "value", "sentence"), SINGLE)
def test_one_wrong_key_gives_one_sentence(path, value, sentence):
    with pytest.raises(InputError, match=re.escape(sentence)) as caught:
        parse_rig(tables((path, value)), "machine.toml")
    unrelated = [p for p in caught.value.problems if sentence not in p]
    assert not unrelated or path in {("wheel",), (*W1, "name")}  # uncertainty and places hang on it
    assert all(problem.startswith("machine.toml: `") for problem in caught.value.problems)


EFFECTS = [
    (block("wheel-runot", "w1"), "must be the id of a known effect, but is 'wheel-runot'. Did you"),
    (
        block("wheel-runout", "w4", amplitude=0, phase=0),
        "must be one of w1, w2, w3, but is 'w4'.",
    ),
    (
        block("wheel-runout", "all", amplitude=0, phase=0),
        "must be one of w1, w2, w3, but is 'all'",
    ),
    (
        block("wheel-runout", "w1", amplitude=0),
        "`effect.wheel-runout.w1.phase` is missing. Give a",
    ),
    (block("wheel-runout", "w1", amplitud=1, amplitude=0, phase=0), "Did you mean `amplitude`?"),
    (block("wheel-runout", "w1", amplitude="1 kg", phase=0), "must be a number in m or text with"),
    (block("wheel-runout", "w1", amplitude=True, phase=0), "must be a number (m), but is True."),
    (block("lift-off", "all", force=1), "`effect.lift-off.all.force` is not a parameter of"),
    (block("contact-relaxation", "w1", K1=1, tau=0), "tau` must lie in (0, inf), but is 0."),
    (
        block("damaged-roller", "w1", roller=14, severity=1),
        "must lie in [0, 13], but",
    ),
    (block("damaged-roller", "w1", roller=1.5, severity=1), "must be a whole number in [0, 13]"),
    (block("unbalance", "sphere", offset=[1, 2]), "must be a list of 3 numbers, but is [1, 2]."),
    (block("sphere-out-of-round", "sphere", amplitude=1, axis=[0, 0, 0]), "must not be the zero"),
    (
        block("cogging", "w1", amplitudes=[0.1, 0.1], orders=[3, -2], phases=[0, 0]),
        "`effect.cogging.w1.orders` must lie in [0, inf), but is -2.",
    ),
    (block("creep", "w1", creepage=2), "creepage` must lie in [-1, 1], but is 2."),
    (block("sensor-gain", "dr", g=0.1), "must be one of theta, Omega, dR, a, but is 'dr'. Did you"),
    (block("sensor-drift", "dR_w", a=0, b=0), "theta_3, Omega_x, Omega_y, Omega_z, dR_x, dR_y,"),
    (block("sensor-drift", "dR_z", a=0, b="1 m"), "b` must be a number in m/s or text with such"),
    (block("air-drag", "w1", D=1), "`effect.air-drag.place` must be one of sphere, but is 'w1'."),
    ({"place": "w1"}, "`effect.1.id` is missing."),
    ({"id": "lift-off"}, "`effect.lift-off.place` is missing."),
    (block("creep", "w1"), "`effect.creep.w1.creepage` is missing."),
    ({"id": "lift-off", "place": "all", "law": "no.py"}, "no.py: no such Python file of laws"),
    ({"id": "lift-off", "place": "all", "gain": 1}, "`effect.lift-off.gain` is not a key of a rig"),
    ({"id": "lift-off", "place": "all", "k": 1}, "numbers stand in `parameters = { k = ... }`."),
]


def test_an_effect_without_a_place_is_called_by_its_id():
    with pytest.raises(InputError) as caught:
        parse_rig(with_effects({"id": "creep"}))
    first, second = caught.value.problems
    assert first.endswith("`effect.creep.place` is missing.")
    assert "`effect.creep.creepage` is missing." in second


@pytest.mark.parametrize(("effect", "sentence"), EFFECTS)
def test_one_wrong_effect_gives_one_sentence(effect, sentence):
    with pytest.raises(InputError, match=re.escape(sentence)) as caught:
        parse_rig(with_effects(effect))
    assert len(caught.value.problems) == 1


def test_the_same_effect_twice_at_one_place_is_refused():
    twice = block("bearing-viscous", "w1", b=0.1)
    with pytest.raises(InputError, match=TWICE):
        parse_rig(with_effects(twice, twice))
    parse_rig(with_effects(twice, block("bearing-viscous", "all", b=0.1)))


def test_the_same_law_twice_at_one_place_has_no_path_and_no_file(tmp_path):
    rig, law = parse_rig(with_effects()), BearingViscous(jnp.asarray(0.1))
    rig = rig.add(law, "w1").add(law, "all")
    set_parameter(rig, "effect.bearing-viscous.w1.b", 0.2)
    doubled = rig.add(law, "w1")
    for refused in (
        lambda: rig_text(doubled),
        lambda: save_rig(doubled, tmp_path / "rig.toml"),
        lambda: set_parameter(doubled, "effect.bearing-viscous.w1.b", 0.2),
        lambda: get_parameter(doubled, "effect.bearing-viscous.w1.b"),
        lambda: parameter_paths(doubled),
    ):
        with pytest.raises(InputError, match=TWICE):
            refused()
    assert not list(tmp_path.iterdir())
    set_parameter(doubled, "effect.bearing-viscous.all.b", 0.2)


def test_hertz_contact_needs_a_preload():
    data = with_effects(block("contact-hertz", "w2"))
    data["wheel"][1]["closure"]["preload"] = 0
    with pytest.raises(InputError, match=r"`effect\.contact-hertz\.w2` needs a preload"):
        parse_rig(data)
    data["wheel"][1]["closure"]["preload"] = "0 N"  # text was not compared
    with pytest.raises(InputError, match=r"`wheel\.w2\.closure\.preload` is 0\."):
        parse_rig(data)
    data["effect"][0]["place"] = "w1"
    parse_rig(data)


def test_a_damaged_roller_is_one_of_the_wheel_however_their_number_is_written():
    data = with_effects(block("damaged-roller", "w2", roller=14, severity=0.1))
    data["wheel"][1]["rollers"] = "14"
    with pytest.raises(InputError, match=r"roller` must lie in \[0, 13\], but is 14"):
        parse_rig(data)


def test_no_wheel_is_called_by_the_word_for_all_of_a_drive():
    """A wheel called scale took the place of `speed.scale`."""
    data = tables()
    data["wheel"][1]["name"] = "scale"
    with pytest.raises(InputError, match=r"`wheel.scale.name` must not be 'scale': the word has"):
        parse_rig(data)


def test_dual_row_wheels_are_mostly_roller():
    wheel = {"profile": "dual-row", "row_spacing": 0.03, "roundness": 0.51}
    data = tables(*((("wheel", 0, key), value) for key, value in wheel.items()))
    with pytest.raises(InputError, match=r"must lie in \[0, 0\.5\] for profile 'dual-row'"):
        parse_rig(data)
    data["wheel"][0]["roundness"] = 0.5
    parse_rig(data)


def test_all_errors_come_at_once():
    data = tables(
        (("sphere", "mass"), -1),
        ((*W1, "roundness"), 2),
        ((*W1, "normal"), [1, 0, 0]),
        (("effect",), [block("wheel-runot", "w1"), block("creep", "w1", creepage="x")]),
        (("uncertainty", "sphere.mas"), 0.1),
    )
    with pytest.raises(InputError) as caught:
        parse_rig(data, "rig.toml")
    assert len(caught.value.problems) == 6
    assert str(caught.value).count("\n") == 5


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match=r"No such file or directory\. Did you mean `atlas`\?"):
        load_rig("atlsa")
    with pytest.raises(InputError, match="is a folder, not a file"):
        load_rig(tmp_path)
    bad = tmp_path / "bad.toml"
    bad.write_bytes(b"[sphere]\nradius = = 3\n")
    with pytest.raises(InputError, match=r"bad\.toml: is not valid TOML: .*line 2"):
        load_rig(bad)
    bad.write_bytes(b"[sphere]\nname = '\xff'\n")
    with pytest.raises(InputError, match=r"is not UTF-8 text: .* at byte 17"):
        load_rig(bad)


def test_what_is_wrong_with_every_wheel_is_said_once():
    """Three wheels with one table of contact gave every sentence three times."""
    data = tables()
    contact = dict(data["wheel"][0]["contact"])
    contact["stifness"] = contact.pop("stiffness")
    for wheel in data["wheel"]:
        wheel["contact"] = contact
    data["wheel"][1]["rollers"] = 0
    with pytest.raises(InputError) as caught:
        parse_rig(data)
    assert set(caught.value.problems) == {
        "`wheel.w1.contact.stiffness` is missing. Give a value in N/m. The same holds of w2, w3.",
        "`wheel.w1.contact.stifness` is not a key of a rig file. Did you mean `stiffness`? "
        "The same holds of w2, w3.",
        "`wheel.w2.rollers` must lie in [1, 1000], but is 0.",
    }
