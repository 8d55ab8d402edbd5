"""`omnijax init`: machines from a geometry, and study files."""

from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from omnijax.cli import run
from omnijax.cli._starter import EXAMPLES
from omnijax.cli.init import Studies
from omnijax.dynamics import fitting_speeds, mobility
from omnijax.rig import get_parameter, load_rig
from omnijax.study import load_study


@pytest.mark.parametrize("seed", range(3))
def test_a_geometry_becomes_a_rig(seed, tmp_path):
    rng = np.random.default_rng(seed)
    wheels, radius = int(rng.integers(2, 7)), rng.uniform(0.05, 1.0)
    zenith, skew = rng.uniform(20, 80) + rng.integers(0, 2) * 80, rng.uniform(-40, 40)
    file = str(tmp_path / "rig.toml")
    shape = ["--wheels", str(wheels), "--zenith", f"{zenith}", "--skew", f"{skew}deg"]
    assert run(["init", file, *shape, "--radius", f"{1e3 * radius}mm", "--rollers", "7"]) == 0
    rig = load_rig(file)
    assert rig.size == wheels and rig.wheels.rollers.tolist() == [7.0] * wheels
    assert float(rig.sphere.radius) == pytest.approx(radius, rel=1e-5)
    np.testing.assert_allclose(rig.wheels.normal[:, 2], -np.cos(np.radians(zenith)), rtol=1e-7)
    level = np.cross([0, 0, 1], -np.asarray(rig.wheels.normal)) / np.sin(np.radians(zenith))
    along = np.sum(level * np.asarray(rig.wheels.drive), axis=1)
    np.testing.assert_allclose(along, np.cos(np.radians(skew)), rtol=1e-7)
    total = np.asarray(rig.wheels.closure.preload) @ np.asarray(rig.wheels.normal)
    above = zenith < 90
    mass = rig.platform.mass + rig.wheels.mass.sum() if above else rig.sphere.mass
    weight = float(mass) * 9.81 * (-1 if above else 1)  # the wheels push the ball down, or hold it
    assert abs(total[2]) >= min(1.99 * abs(weight), 20 * abs(np.cos(np.radians(zenith))))
    assert np.sign(total[2]) == np.sign(weight)


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_example_is_a_rig_with_three_driven_axes(name, tmp_path, capsys):
    file = str(tmp_path / "rig.toml")
    assert run(["init", file, "--example", name]) == 0
    assert np.linalg.cond(np.asarray(load_rig(file).wheels.spin_axis)) < 3


@pytest.mark.parametrize("name", EXAMPLES)
@pytest.mark.parametrize("kind", get_args(Studies))
def test_study_files_fit_the_rig_that_they_name(kind, name, tmp_path, monkeypatch):
    """Speeds that fit each other, and ranges around the rig's own numbers."""
    monkeypatch.chdir(tmp_path)
    assert run(["init", "own.toml", "--example", name]) == 0
    (tmp_path / "sub").mkdir()
    assert run(["init", "sub/study.toml", "--study", kind, "--rig", "own.toml"]) == 0
    study = load_study("sub/study.toml")
    assert study.rig.size == EXAMPLES[name].wheels
    speed = np.array(study.drives[0].values)
    back = np.array(fitting_speeds(study.rig, np.asarray(mobility(study.rig).to_sphere) @ speed))
    np.testing.assert_allclose(back, speed, rtol=1e-4)  # written with six figures
    assert np.min(np.abs(speed)) > 0
    for v in study.variables:
        own = np.asarray(get_parameter(study.rig, v.name))
        assert v.low < own.min() and own.max() < v.high < 20 * own.max()


@pytest.mark.parametrize("kind", get_args(Studies))
def test_a_study_of_a_rig_without_steady_state_asks_for_runs(kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(["init"]) == 0
    law = '[[effect]]\nid = "contact-cubic"\nplace = "w1"\nparameters = { K3 = 1e12 }\n'
    with Path("rig.toml").open("a", encoding="utf-8") as file:
        file.write(law)
    assert run(["init", "--study", kind]) == 0
    assert load_study("study.toml").duration == 1.0
    assert "# law `contact-cubic` is not linear" in Path("study.toml").read_text(encoding="utf-8")


def test_a_study_names_a_rig_that_is_there(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(["init", "--study", "design", "--rig", "none.toml"]) == 2
    assert "none.toml" in capsys.readouterr().err
    assert run(["init", "--axis", "axis.toml"]) == 0
    assert run(["init", "--study", "sweep", "--rig", "axis.toml"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "axis.toml: is a machine file of an axis: study files are for rigs" in said
    assert "`omnijax sweep axis.toml --drive LOG`" in said
    assert not (tmp_path / "study.toml").exists()


@pytest.mark.parametrize(
    ("tokens", "sentence"),
    [
        (["--zenith", "200"], "`zenith` must lie between 0 and 180 deg, but is 200."),
        (["--wheels", "0"], "`wheels` must lie in [1, 64], but is 0."),
        (["--radius", "-3mm"], "`radius` must lie in (0, inf) m, but is -0.003."),
        (["--study", "design", "--wheels", "3"], "a study file has no geometry"),
        (["--rig", "y.toml"], "--rig names the machine of a study file: give --study KIND too."),
    ],
)
def test_what_is_no_geometry_is_said(tokens, sentence, tmp_path, capsys):
    assert run(["init", str(tmp_path / "x.toml"), *tokens]) == 2
    assert sentence in capsys.readouterr().err


@pytest.mark.parametrize(
    "tokens", [["init", "best.doc"], ["design", "a.toml", "--rig", "best.doc"]]
)
def test_a_file_by_whose_suffix_no_command_would_know_it_is_refused(
    tokens, tmp_path, monkeypatch, capsys
):
    """It was written: a study of another suffix was then read as a rig."""
    monkeypatch.chdir(tmp_path)
    assert run(tokens) == 2
    assert "`best.doc` must end in .toml." in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_file_is_known_by_its_suffix_in_any_letters(tmp_path, monkeypatch, capsys):
    """`STUDY.TOML` was read as a rig, whose tables it has not."""
    monkeypatch.chdir(tmp_path)
    assert run(["init", "RIG.TOML"]) == 0
    assert run(["init", "STUDY.TOML", "--study", "design", "--rig", "RIG.TOML"]) == 0
    assert run(["check", "STUDY.TOML"]) == 0
    assert run(["init", "--axis", "AXIS.Toml"]) == 0
    capsys.readouterr()
    assert run(["check", "AXIS.Toml"]) == 0
    assert "axis" in capsys.readouterr().out
