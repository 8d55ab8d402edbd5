"""Directions of wheels: from angles, and from vectors with few digits."""

import tomllib

import numpy as np
import pytest
from rigs import MISSING, tables

from omnijax.rig import InputError, direction_angles, parse_rig, rig_notes, rig_text

VECTORS = [(("wheel", 0, key), MISSING) for key in ("normal", "drive")]


def placed(**angles):
    """The Atlas rig with its first wheel at `angles`."""
    return parse_rig(tables(*VECTORS, *((("wheel", 0, key), x) for key, x in angles.items())))


@pytest.mark.parametrize("seed", range(4))
def test_angles_say_where_the_wheel_touches_and_where_its_rim_runs(seed):
    rng = np.random.default_rng(seed)
    zenith, azimuth, skew = rng.uniform([0.1, -3, -1.5], [3.0, 3, 1.5])
    rig = placed(zenith=zenith, azimuth=f"{np.degrees(azimuth)} deg", skew=skew)
    normal, drive = (np.asarray(x[0]) for x in (rig.wheels.normal, rig.wheels.drive))
    touch = -normal  # sphere centre -> wheel
    assert np.arccos(touch[2]) == pytest.approx(zenith, abs=1e-12)
    assert np.arctan2(touch[1], touch[0]) == pytest.approx(azimuth, abs=1e-12)
    level = np.cross([0, 0, 1], touch) / np.sin(zenith)  # along the circle of latitude
    down = np.cross(level, touch)  # towards the lower pole
    assert down[2] == pytest.approx(-np.sin(zenith))
    assert np.arctan2(drive @ down, drive @ level) == pytest.approx(skew, abs=1e-12)
    assert abs(drive @ normal) < 1e-15 and drive @ drive == pytest.approx(1, abs=1e-15)


def test_a_wheel_above_the_ball_presses_down_and_runs_level():
    rig = placed(zenith="45 deg", azimuth=0)
    np.testing.assert_allclose(rig.wheels.normal[0], [-(0.5**0.5), 0, -(0.5**0.5)], atol=1e-15)
    assert rig.wheels.drive[0].tolist() == [0.0, 1.0, 0.0]


def test_the_half_turn_is_told_as_it_is_typed():
    rig = placed(zenith="45 deg", azimuth="180 deg", skew="180 deg")
    shown = direction_angles(rig.wheels.normal[0], rig.wheels.drive[0])
    assert shown == pytest.approx([45, 180, 180], abs=1e-9)


def test_vectors_of_few_digits_are_made_exact_and_said(tmp_path):
    data = tables((("wheel", 0, "normal"), [0.7071, 0, 0.7071]), (("wheel", 0, "drive"), [0, 1, 0]))
    rig = parse_rig(data)
    np.testing.assert_allclose(rig.wheels.normal[0], [0.5**0.5, 0, 0.5**0.5], rtol=1e-15)
    again = parse_rig(tomllib.loads(rig_text(rig)))
    np.testing.assert_array_equal(again.wheels.normal, rig.wheels.normal)
    text = rig_text(parse_rig(tables())).replace(
        "normal = [1.0, 0.0, 0.0]", "normal = [0.999, 0.001, 0]", 1
    )
    (tmp_path / "rig.toml").write_text(text)
    [note] = rig_notes(tmp_path / "rig.toml")
    assert note.startswith("`wheel.w1`: `normal` has length 0.999001")
    assert rig_notes("atlas") == []


def test_what_is_no_direction_is_refused():
    with pytest.raises(InputError, match=r"length 1\.414214\. Its direction is \[0\.7071068, 0\.7"):
        parse_rig(tables((("wheel", 0, "normal"), [1, 1, 0])))
    with pytest.raises(InputError, match="has angles and `normal`: give one of the two"):
        parse_rig(tables((("wheel", 0, "zenith"), 1), (("wheel", 0, "azimuth"), 1)))
    with pytest.raises(InputError, match=r"`wheel\.w1\.azimuth` is missing\. Give an angle"):
        placed(zenith="45 deg")
    with pytest.raises(InputError, match=r"`wheel\.w1\.skew` must be a number in rad or text"):
        placed(zenith=1, azimuth=1, skew="3 m")


@pytest.mark.parametrize(
    ("key", "given", "most"),
    [("zenith", 45, 3.14), ("azimuth", 120.0, 6.28), ("skew", "-30", -6.28), ("zenith", -3.2, 0.1)],
)
def test_degrees_without_a_unit_are_not_taken_as_rad(key, given, most):
    """`omnijax init --zenith 45` is in degrees; the same number in a rig file was 45 rad."""
    angles = {"zenith": 1, "azimuth": 1}
    with pytest.raises(InputError) as caught:
        placed(**angles | {key: given})
    told = f'`wheel.w1.{key}` = {given} without a unit is in rad; did you mean "{given} deg"?'
    assert caught.value.problems == (told,)
    placed(**angles | {key: most})
    placed(**angles | {key: "400°"})
