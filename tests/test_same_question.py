"""A study asks what `simulate` asks: the same samples, drive and tolerance from the same words."""

import csv

import jax
import numpy as np
import pytest
from seeds import drawn_anew

from omnijax import InputError, load_rig
from omnijax._errors import DataWarning
from omnijax.cli import run
from omnijax.cli._drive import asked, studied
from omnijax.cli._motion import MotionOptions
from omnijax.simulation import TorqueDrive
from omnijax.study._evaluation import samples_of

STUDY = """
rig = "atlas"
duration = 0.02
rtol = 1e-5

[[drive]]
torque = [1.0, 2.0, 1.5]

[[variable]]
path = "sphere.mass"
low = 4
high = 6
levels = 2
distribution = "normal"
"""


def test_a_length_that_is_no_whole_number_of_samples_is_cut_alike():
    """Ramps end with the last sample, too."""
    rng, rig = drawn_anew("lengths"), load_rig("atlas")
    for _ in range(20):
        length, rate = rng.uniform(0.05, 2.0), rng.uniform(100, 1000)
        motion = MotionOptions(speed="0..3,2,1", duration=f"{length} s", rate=f"{rate} Hz")
        single, study = asked(rig, motion, None), studied(rig, motion, None)
        np.testing.assert_array_equal(samples_of(study.duration, study.rate), single.times)
        for one, other in zip(*map(jax.tree.leaves, (single.drive, study.drive)), strict=True):
            np.testing.assert_array_equal(one, other)


def recorded(path, time, rng):
    """A recording of torques, forces and angles at `time` (s)."""
    names = [f"{group}_{i}" for group in ("torque", "theta") for i in (1, 2, 3)]
    names += [f"{group}_{axis}" for group in ("force", "Omega") for axis in "xyz"]
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["t", *names])
        rows.writerows([t, *rng.normal(size=len(names))] for t in time)
    return path


def test_a_recording_that_begins_late_drives_a_study_from_its_beginning(tmp_path):
    """Its torques had been left out but for the first sample's."""
    rng, rig = drawn_anew("late"), load_rig("atlas")
    start = rng.uniform(3, 300)
    file = recorded(tmp_path / "late.csv", start + 4e-3 * np.arange(200), rng)
    single, study = asked(rig, MotionOptions(), file), studied(rig, MotionOptions(), file)
    assert isinstance(single.drive, TorqueDrive) and isinstance(study.drive, TorqueDrive)
    times = samples_of(study.duration, study.rate)
    np.testing.assert_allclose(times, single.times - start, atol=1e-9)
    between = start + rng.uniform(0, 0.79, 50)
    for name in ("torque", "force"):
        for t in between:
            theirs, ours = getattr(single.drive, name)(t), getattr(study.drive, name)(t - start)
            np.testing.assert_allclose(ours, theirs, rtol=1e-7, atol=1e-9)
    np.testing.assert_array_equal(single.drive.initial_angle, study.drive.initial_angle)


def test_samples_that_are_not_even_are_told(tmp_path):
    rng, time = drawn_anew("uneven"), 4e-3 * np.arange(200)
    studied(load_rig("atlas"), MotionOptions(), recorded(tmp_path / "even.csv", time, rng))
    gap = recorded(tmp_path / "gap.csv", np.delete(time, slice(80, 90)), rng)
    with pytest.warns(DataWarning, match=r"^gap\.csv is not sampled evenly"):
        studied(load_rig("atlas"), MotionOptions(), gap)


@pytest.mark.parametrize("command", ["sweep", "sensitivity"])
def test_the_tolerance_of_a_study_file_is_handed_on(command, tmp_path, capsys, monkeypatch):
    file, given = tmp_path / "study.toml", {}
    file.write_text(STUDY, encoding="utf-8")

    def noted(*args, **how):
        given.update(how)
        raise InputError("asked.")

    monkeypatch.setattr(f"omnijax.study.{command}", noted)
    assert run([command, str(file)]) == 2
    assert given["rtol"] == 1e-5
    assert "`distribution` is for `global-sensitivity`" in " ".join(capsys.readouterr().err.split())
    if command == "sweep":
        assert run([command, str(file), "--rtol", "1e-7"]) == 2
        assert "--rtol stands in the study file" in capsys.readouterr().err
