"""What a rig file leaves open: numbers, tensors, directions as angles, sensors."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from omnijax import InputError, get_parameter
from omnijax.cli import run
from omnijax.diagnosis._machine._candidates.uncertain import (
    rig_priors,
    with_parameters,
    with_sensors,
)
from omnijax.rig import load_rig, rig_text, save_rig
from omnijax.rig._directions import unit_vectors

LINES = """
"wheel.radius" = 5e-4
"wheel.normal" = "0.2 deg"
"wheel.w1.drive" = 0.01
"sphere.inertia" = 0.02
"sensor.dR.gain" = 0.005
"sensor.a.delay" = "0.2 ms"
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """The bundled rig with everything open."""
    text = rig_text(load_rig("atlas"))
    head, _, _ = text.partition("[uncertainty]")
    path = tmp_path_factory.mktemp("rig") / "rig.toml"
    path.write_text(head + "\n[uncertainty]\n" + LINES)
    return load_rig(path)


def test_every_open_number_is_a_prior(rig, tmp_path):
    priors = {p.name: p for p in rig_priors(rig)}
    names = list(rig.names)
    assert {f"wheel.{n}.radius" for n in names} <= set(priors)
    assert priors[f"wheel.{names[0]}.normal.first"].sigma == pytest.approx(np.deg2rad(0.2))
    assert f"wheel.{names[1]}.drive.first" not in priors
    assert priors["sensor.a.delay"].sigma == pytest.approx(2e-4)
    assert not priors["sensor.dR.gain"].relative
    save_rig(rig, tmp_path / "again.toml")
    assert rig_priors(load_rig(tmp_path / "again.toml")) == rig_priors(rig)


def test_a_direction_is_tilted_by_the_angle_and_stays_a_direction(rig):
    name = rig.names[1]
    paths = (f"wheel.{name}.normal.first", f"wheel.{name}.normal.second")
    tilted = with_parameters(rig, paths, np.array([0.003, 0.004]))
    old, new = np.asarray(rig.wheels.normal), np.asarray(tilted.wheels.normal)
    assert np.linalg.norm(new, axis=1) == pytest.approx(np.ones(rig.size), abs=1e-12)
    turned = np.arccos(np.clip(np.sum(old * new, axis=1), -1, 1))
    assert turned[1] == pytest.approx(0.005, rel=1e-3)
    assert np.delete(turned, 1) == pytest.approx(0.0, abs=1e-7)


def test_a_tensor_is_scaled_and_a_sensor_gets_a_law(rig):
    paths = ("sphere.inertia", "sensor.dR.gain", "sensor.a.delay")
    values = (np.asarray(rig.sphere.inertia) if np.ndim(rig.sphere.inertia) == 0 else 1.0) * 1.1
    changed = with_sensors(with_parameters(rig, paths, np.array([values, 0.01, 0.0])), paths,
                           (values, 0.01, 0.0))  # fmt: skip
    old, new = (np.diag(np.asarray(x.sphere.inertia_matrix)) for x in (rig, changed))
    assert new == pytest.approx(1.1 * old)
    (placed,) = changed.at("sensor")
    assert placed.place == "dR" and float(placed.law.g) == 0.01


def test_what_cannot_be_open_is_refused(tmp_path):
    text = rig_text(load_rig("atlas")).partition("[uncertainty]")[0]
    for line, match in (('"wheel.rollers" = 0.1', "must be a parameter of the rig"),
                        ('"sensor.b.gain" = 0.1', "must be a parameter of the rig"),
                        ('"wheel.radius" = "0.1 mm"', "`uncertainty.wheel.radius` must be a share"),
                        ('"contact.stiffness" = "2 deg"', "must be a share such as 0.1"),
                        ('"wheel.normal" = "1 mm"', 'must be an angle such as "0.2 deg"'),
                        ('"sphere.centre_of_mass" = "1 deg"', "must be a length"),
                        ('"sensor.a.delay" = -1', "must lie in")):  # fmt: skip
        path = tmp_path / "rig.toml"
        path.write_text(f"{text}\n[uncertainty]\n{line}\n")
        with pytest.raises(InputError, match=match):
            load_rig(path)


def stated(tmp_path, uncertainty: str, **changes: str):
    """The bundled rig with other text in it and under `[uncertainty]`."""
    text = rig_text(load_rig("atlas")).partition("[uncertainty]")[0]
    for old, new in changes.values():
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "rig.toml").write_text(f"{text}\n[uncertainty]\n{uncertainty}\n")
    return load_rig(tmp_path / "rig.toml")


def test_a_share_of_nothing_is_told_and_not_dropped(tmp_path, capsys):
    """A roundness, a spring and a damping of 0 had been listed and left as they were."""
    zeros = {
        "roundness": ("roundness = 0.4485", "roundness = 0"),
        "closure": ("closure = { stiffness = 20000.0", "closure = { stiffness = 0"),
    }
    lines = '"wheel.w1.roundness" = 0.02\n"closure.stiffness" = 0.1\n"wheel.radius" = 1e-3'
    rig = stated(tmp_path, lines, **zeros)
    with pytest.raises(InputError) as error:
        rig_priors(rig)
    (sentence,) = error.value.problems
    names = ["wheel.w1.roundness", *(f"wheel.w{i}.closure.stiffness" for i in (1, 2, 3))]
    assert all(f"`{name}`" in sentence for name in names) and "radius" not in sentence
    assert "are 0 in the rig" in sentence
    assert run(["check", str(tmp_path / "rig.toml")]) == 0
    assert "a share of 0 is nothing" in " ".join(capsys.readouterr().out.split())
    with pytest.raises(InputError, match="the rig has none: leave it out"):
        rig_priors(stated(tmp_path, '"platform.gravity" = "1 deg"'))


def test_one_wheel_may_speak_for_itself_in_any_order(tmp_path):
    lines = '"wheel.w1.contact.damping" = 0.5\n"contact.damping" = 0.3'
    for text in (lines, "\n".join(reversed(lines.splitlines()))):
        sigmas = {p.name: p.sigma for p in rig_priors(stated(tmp_path, text))}
        assert sigmas == {f"wheel.w{i}.contact.damping": 0.5 if i == 1 else 0.3 for i in (1, 2, 3)}


def test_vectors_are_open_by_lengths_and_angles(tmp_path, capsys):
    lines = '"sphere.centre_of_mass" = "1 mm"\n"platform.gravity" = "0.5 deg"'
    gravity = ("[platform]", "[platform]\ngravity = [0, 0, -9.81]")
    rig = stated(tmp_path, lines, gravity=gravity)
    priors = {p.name: p for p in rig_priors(rig)}
    assert [priors[f"sphere.centre_of_mass.{a}"].at(1.0) for a in "xyz"] == pytest.approx(
        [1e-3] * 3
    )
    assert priors["platform.gravity.first"].sigma == pytest.approx(np.deg2rad(0.5))
    paths = ("sphere.centre_of_mass.y", "platform.gravity.second")
    changed = with_parameters(rig, paths, np.array([2e-3, 0.01]))
    assert np.asarray(changed.sphere.centre_of_mass).tolist() == [0.0, 2e-3, 0.0]
    down = np.asarray(changed.platform.gravity)
    assert np.linalg.norm(down) == pytest.approx(9.81) and down[2] == pytest.approx(
        -9.81 * np.cos(0.01)
    )
    assert run(["check", str(tmp_path / "rig.toml")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "sphere.centre_of_mass 1 mm, platform.gravity 0.5 °" in said


def test_a_negative_number_of_an_effect_stays_open(tmp_path):
    """It had been dropped without a word."""
    block = "[[effect]]\nid = 'creep'\nplace = 'w1'\nparameters = { creepage = -0.01 }\n"
    rig = stated(
        tmp_path, '"effect.creep.w1.creepage" = 0.1', effect=("[platform]", block + "[platform]")
    )
    (prior,) = rig_priors(rig)
    assert prior.at(1.0) == pytest.approx(-0.01 * np.exp(0.1))


@pytest.mark.parametrize("angles", [(1.0, 0.7, 0.3), (2.2, -2.0, 0.0), (0.4, 3.0, -1.2)])
def test_a_wheels_angles_are_turned_as_the_rig_file_means_them(angles, tmp_path):
    """The directions of the turned wheel are those of the file with the sum of the angles."""
    by = (0.004, -0.003, 0.002)
    lines = '"wheel.zenith" = "0.2 deg"\n"wheel.w1.azimuth" = 0.01\n"wheel.w1.skew" = "1 mrad"'
    rig = stated(tmp_path, lines)
    priors = {p.name: p.sigma for p in rig_priors(rig)}
    assert priors["wheel.w3.zenith"] == pytest.approx(np.deg2rad(0.2))
    assert priors["wheel.w1.skew"] == pytest.approx(1e-3) and len(priors) == 5
    turned = (rig.wheels.normal, rig.wheels.drive), map(jnp.asarray, unit_vectors(*angles))
    rig = eqx.tree_at(
        lambda r: (r.wheels.normal, r.wheels.drive), rig,
        [old.at[0].set(new) for old, new in zip(*turned, strict=True)],
    )  # fmt: skip
    paths = tuple(f"wheel.w1.{key}" for key in ("zenith", "azimuth", "skew"))
    turned = with_parameters(rig, paths, np.array(by))
    wanted = unit_vectors(*(a + b for a, b in zip(angles, by, strict=True)))
    for key, vector in zip(("normal", "drive"), wanted, strict=True):
        turned_to = np.asarray(get_parameter(turned, f"wheel.w1.{key}"))
        np.testing.assert_allclose(turned_to, vector, atol=1e-14)


def test_a_wheel_at_a_pole_has_a_zenith_too(tmp_path):
    """Atlas's third wheel touches at the lower pole, where there is no azimuth."""
    rig = stated(tmp_path, '"wheel.w3.zenith" = "0.2 deg"')
    turned = with_parameters(rig, ("wheel.w3.zenith",), np.array([0.003]))
    normals = [np.asarray(get_parameter(x, "wheel.w3.normal")) for x in (rig, turned)]
    assert np.arccos(normals[0] @ normals[1]) == pytest.approx(0.003, rel=1e-6)
    drive = np.asarray(get_parameter(turned, "wheel.w3.drive"))
    assert drive @ normals[1] == pytest.approx(0.0, abs=1e-15)
