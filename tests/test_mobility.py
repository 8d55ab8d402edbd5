"""Which motions the wheels drive, both ways, and what weight presses with."""

import jax.numpy as jnp
import numpy as np
import pytest

from omnijax.cli import run
from omnijax.cli._starter import EXAMPLES, Geometry, rig_text
from omnijax.dynamics import Rolling, incompatibility, mobility, sliding, weight, wheel_speeds
from omnijax.rig import load_rig


def built(tmp_path, geometry):
    (tmp_path / "rig.toml").write_text(rig_text(geometry), encoding="utf-8")
    return load_rig(tmp_path / "rig.toml")


@pytest.mark.parametrize("seed", range(3))
def test_the_matrices_are_the_kinematics_of_round_wheels(seed, tmp_path):
    rng = np.random.default_rng(seed)
    wheels = int(rng.integers(3, 7))
    geometry = EXAMPLES["four-wheel"]._replace(
        wheels=wheels, zenith=rng.uniform(100, 150), skew=20.0
    )
    rig = built(tmp_path, geometry)
    round_ = Rolling(rig.wheels.radius, rig.wheels.spin_axis)
    found, omega, speed = mobility(rig), rng.normal(size=3), rng.normal(size=wheels)
    np.testing.assert_allclose(found.to_wheels @ omega, wheel_speeds(rig, round_, jnp.array(omega)))
    np.testing.assert_allclose(found.to_sphere @ (found.to_wheels @ omega), omega, rtol=1e-12)
    slides = incompatibility(rig, round_, jnp.array(speed))
    np.testing.assert_allclose(sliding(rig, speed), slides, rtol=1e-9, atol=1e-12)
    assert found.driven == 3 and len(found.conflicts) == wheels - 3
    np.testing.assert_allclose(found.to_sphere @ found.conflicts.T, 0, atol=1e-12)


def nearly_singular(folder):
    """A file of four wheels skewed in turn by +-30 deg: they drive one axis at 1 : 300."""
    text = rig_text(EXAMPLES["four-wheel"]._replace(zenith=125.0))
    for number, skew in enumerate([30, -30, 30, -30]):
        head, skewed, rest = text.partition(f'name = "w{number + 1}"')
        text = head + skewed + rest.replace('skew = "0 deg"', f'skew = "{skew} deg"', 1)
    file = folder / "x.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_a_nearly_singular_machine_is_told(tmp_path, capsys):
    file = nearly_singular(tmp_path)
    found = mobility(load_rig(file))
    values = np.linalg.svd(np.asarray(load_rig(file).wheels.spin_axis))[1]
    assert found.condition == pytest.approx(values[0] / values[2], rel=1e-9)
    assert found.condition == pytest.approx(307, rel=0.01)
    assert run(["check", str(file)]) == 0
    assert "the wheels hardly drive the axis (" in " ".join(capsys.readouterr().out.split())


@pytest.mark.full  # in the gate its check, above, and speeds that do not fit: test_speed_misfits
def test_a_run_of_a_nearly_singular_machine_tells_it_too(tmp_path, capsys):
    file = nearly_singular(tmp_path)
    drive = ["--speed", "60rpm,20rpm,-60rpm,10rpm", "--duration", "20ms"]
    assert run(["simulate", str(file), *drive]) == 0
    warned = " ".join(capsys.readouterr().err.split())
    assert "The speeds do not fit each other" in warned and "hardly drive the axis" in warned


@pytest.mark.full  # in the gate its words: test_hold
def test_a_run_of_a_sphere_that_is_not_held_says_so(tmp_path, capsys):
    file = tmp_path / "x.toml"
    text = rig_text(EXAMPLES["ballbot"])
    file.write_text(text.replace('azimuth = "120 deg"', 'azimuth = "0 deg"'), encoding="utf-8")
    drive = ["--speed", "1,1,1", "--duration", "20ms"]
    assert run(["simulate", str(file), *drive]) == 0
    warned = " ".join(capsys.readouterr().err.split())
    assert "do not hold the sphere in every direction: it drifts off" in warned
    assert "no wheel drives the axis (" in warned
    assert run(["simulate", str(file), *drive, "--model", "paper"]) == 0  # sums what wheels sag
    assert "drifts off" not in capsys.readouterr().err


def test_profiles_that_differ_leave_the_table_its_width(tmp_path, capsys):
    file = tmp_path / "x.toml"
    text = rig_text(EXAMPLES["ballbot"])
    file.write_text(text.replace('"rollers"', '"continuous-sine"', 1), encoding="utf-8")
    assert run(["check", str(file)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "profiles: w1 continuous-sine, w2 rollers, w3 rollers" in lines
    assert max(map(len, lines[1:])) <= 80


def test_undriven_axes_and_weight(tmp_path):
    equator = Geometry(3, 90.0, 0.0, 0.1, 1.0, 1.0, 0.02, 0.1, 9, 100.0)
    rig = built(tmp_path, equator)
    found, pressed = mobility(rig), weight(rig)
    assert found.driven == 1  # every rim runs along the equator: only the vertical axis turns
    np.testing.assert_allclose(np.abs(found.undriven()[:, 2]), 0, atol=1e-12)
    assert pressed is not None and pressed.missing == pytest.approx(9.81)
    ballbot = built(tmp_path, EXAMPLES["ballbot"])
    pressed = weight(ballbot)
    assert pressed is not None and pressed.missing < 1e-9
    mass = float(ballbot.platform.mass) + float(ballbot.wheels.mass.sum())
    total = pressed.normal @ np.asarray(ballbot.wheels.normal)
    np.testing.assert_allclose(total, [0, 0, -9.81 * mass], atol=1e-9)
