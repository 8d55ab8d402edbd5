"""A study asks what `simulate` asks: the same samples, drive and tolerance from the same words."""

import csv
import tomllib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from seeds import drawn_anew

from omnijax import InputError, laws, load_rig, steady_state, sweep
from omnijax._errors import DataWarning
from omnijax.cli import run
from omnijax.cli._inputs.drive import asked, studied
from omnijax.cli._inputs.motion import MotionOptions
from omnijax.laws import FloorVibration, TableShape, WheelRunout
from omnijax.rig import parse_rig, put_parameter, rig_text, save_rig
from omnijax.simulation import TorqueDrive, speeds
from omnijax.study import parse_study, refit_remarks
from omnijax.study._evaluation import Question, evaluation_of, samples_of
from omnijax.study._evaluation.coarse import coarse_samples
from omnijax.study._evaluation.in_step import wheels_in_step
from omnijax.study._evaluation.methods import choose
from omnijax.study._target import read_axes

pytestmark = pytest.mark.brief

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


def question(rig, speeds_, varied=(), duration=None):
    drives = tuple(speeds(row) for row in np.atleast_2d(speeds_))
    return Question(rig, drives, varied, ("rms",), "coupled", duration, rows=True)


def dual_row():
    rig_tables = tomllib.loads(rig_text(load_rig("atlas-tripod")))
    for wheel in rig_tables["wheel"]:
        wheel.update(profile="dual-row", row_spacing=0.01, roundness=0.4)
    return parse_rig(rig_tables)


@pytest.mark.parametrize(
    "settings",
    [{"rate": 100.0}, {"rtol": 1e-5}, {"solver": "tsit5"}, {"max_steps": 9, "rtol": 1e-5}],
)
def test_settings_of_runs_are_refused_where_a_steady_state_is_asked_for(settings):
    """All but the rate were taken, and the answer was that without them."""
    vary = {"contact.stiffness": [1e5, 2e5]}
    with pytest.raises(InputError) as told:
        sweep("atlas", vary, speeds=[3.0, 5.1, 7.3], **settings)
    assert set(told.value.problems) == {
        f"`{name}` is that of a run, which has a `duration`: give both." for name in settings
    }


def test_what_varies_obeys_the_rules_of_several_keys():
    """A sweep gave figures of rigs whose files are refused: a sphere that falls through."""
    for vary, told in (
        ({"wheel.roundness": "0.1:0.6:3"}, "w1.roundness` must lie in .0, 0.5. .* but is 0.6"),
        ({"wheel.w2.rollers": [1, 9], "sphere.radius": [0.01, 1.0]}, "w2.radius` must lie below"),
    ):
        with pytest.raises(InputError, match=f"a rig that cannot be: `wheel.{told}"):
            read_axes(dual_row(), speeds([3.0, 5.1, 7.3]), vary)
    assert read_axes(dual_row(), speeds([3.0, 5.1, 7.3]), {"wheel.roundness": "0.1:0.5:3"})


def test_laws_of_no_file_do_not_stand_in_the_way_of_those_rules():
    class Steeper(laws.ContactCubic):
        id = "contact-steeper"

    rig = dual_row().add(Steeper(jnp.asarray(1e12)), "w2").add(laws.ContactHertz(), "all")
    assert read_axes(rig, speeds([3.0, 5.1, 7.3]), {"wheel.roundness": "0.1:0.5:3"})
    with pytest.raises(InputError, match="a rig that cannot be"):
        read_axes(rig, speeds([3.0, 5.1, 7.3]), {"wheel.roundness": "0.1:0.6:3"})


def test_variables_and_loads_obey_the_rules_of_several_keys(tmp_path):
    save_rig(dual_row(), tmp_path / "rig.toml")
    study = {"rig": "rig.toml", "drive": [{"speed": [3.0, 5.1, 7.3]}]}
    variable = {"path": "wheel.roundness", "low": 0.2, "high": 0.7}
    of_all = r"`wheel\.w1\.roundness` must lie in .* The same holds of w2, w3\."
    with pytest.raises(InputError, match=of_all):
        parse_study(study | {"variable": [variable]}, tmp_path / "study.toml")
    with pytest.raises(InputError, match=r"`wheel\.w1\.roundness` must lie in"):
        load = {"set": {"wheel.w1.roundness": 0.7}}
        parse_study(study | {"load": [load]}, tmp_path / "study.toml")
    assert parse_study(study | {"variable": [variable | {"high": 0.5}]}, tmp_path / "study.toml")


def test_samples_that_do_not_follow_the_rollers_are_told():
    """`simulate` told of them; a sweep of the same runs did not."""
    rig = load_rig("atlas")  # 14 rollers: 16.3 pass in a second at 7.3 rad/s
    asked, coarse, fine = question(rig, [3.0, 5.1, 7.3]), np.arange(61) / 60, np.arange(101) / 100
    told = coarse_samples(asked, coarse, ())
    assert told is not None and told.startswith("60 samples a second do not follow")
    assert coarse_samples(asked, fine, ()) is None
    (faster,) = read_axes(rig, asked.drives[0], {"speed.scale": "1:2:2"})
    told = coarse_samples(asked._replace(varied=("speed.scale",)), fine, [faster])
    assert told is not None and "32.53 times a second" in told


def test_wheels_in_step_are_told():
    rng, rig = drawn_anew("in step"), load_rig("atlas-tripod")
    pace, other = rng.uniform(0.5, 3), rng.uniform(4.1, 4.9)
    assert wheels_in_step(question(rig, [pace, 1.1 * pace, 1.3 * pace])) is None
    assert wheels_in_step(question(rig, [pace, 0.0, 0.0])) is None  # what rests has no pace
    told = wheels_in_step(question(rig, [pace, other * pace, -pace]))
    assert told is not None and told.startswith("w1 and w3 turn in step, and")
    assert wheels_in_step(question(rig, [pace, other * pace, -pace], ("speed.w3",))) is None
    assert wheels_in_step(question(rig, [[pace, 0, 0], [pace, pace, pace]])) is not None
    p, q = rng.permutation([(1, 2), (2, 3)][rng.integers(2)])
    told = wheels_in_step(question(rig, [p * pace, np.pi * pace, -q * pace]))
    assert told is not None and f"w1 and w3 turn in step, as {p / min(p, q):.4g} : " in told
    assert (
        wheels_in_step(question(rig, [pace, np.pi * pace, 3 * pace])) is None
    )  # less than 3 % of an RMS
    with pytest.warns(DataWarning, match="w1, w2 and w3 turn in step, and"):
        evaluation_of(question(rig, [pace] * 3))
    evaluation_of(question(rig, [pace] * 3, duration=1.0), 100.0)  # takes the angles


def test_levels_of_speeds_and_rollers_that_are_in_step_are_told():
    """A sweep of a wheel's speed was asked as if that wheel stood still."""
    rng, rig = drawn_anew("levels in step"), load_rig("atlas-tripod")
    pace, drive = rng.uniform(0.5, 3), question(rig, [1.0, 1.0, 1.0]).drives[0]

    def told(vary, speeds, rig=rig):
        ranges = read_axes(rig, drive, vary)
        asked = question(rig, [x * pace for x in speeds], tuple(x.path for x in ranges))
        return wheels_in_step(asked, ranges)

    levels = [0.37 * pace, pace, 1.5 * pace, 0.61 * pace]
    said = told({"wheel.mass": [5.0, 6.0], "speed.w2": levels}, [1.0, 1.0, np.pi])
    assert said is not None and said.startswith("w1 and w2 turn in step in 2 of 4 designs, and")
    assert told({"speed.w2": f"{pace}:{3 * pace}"}, [1.0, 1.0, np.pi]) is None  # drawn
    rollers = int(np.asarray(rig.wheels.rollers)[0])
    said = told({"wheel.w1.rollers": [rollers, 2 * rollers + 1, 2 * rollers]}, [1.0, np.e, 1.0])
    assert said is not None and "w1 and w3 turn in step in 2 of 3 designs, and" in said
    unlike = put_parameter(rig, "wheel.w1.rollers", 7 * rollers + 1)
    assert told({"wheel.mass": [5.0]}, [1.0, np.pi, 1.0], unlike) is None
    law = WheelRunout(amplitude=1e-4, phase=0.0)
    said = told({"wheel.mass": [5.0]}, [1.0, np.pi, 1.0], unlike.add(law, "w1").add(law, "w3"))
    assert said is not None and said.startswith("w1 and w3 turn in step, as ")  # once a turn
    pitch = 2 * np.pi / rollers  # a table of a pitch is no more than its rollers
    for period in (pitch, 2 * np.pi):
        table = TableShape.fit(period * np.arange(6) / 6, rng.uniform(0, 1e-4, 6), period)
        measured = eqx.tree_at(lambda r: r.profiles, unlike, (table, unlike.profiles[1], table))
        assert (told({"wheel.mass": [5.0]}, [1.0, np.pi, 1.0], measured) is None) == (
            period == pitch
        )


def test_a_phase_of_the_long_run_that_does_not_count_is_refused():
    rig = load_rig("atlas-tripod").add(
        FloorVibration(amplitude=0.1, frequency=13.0, phase=0.1, direction=jnp.array([0, 0, 1.0])),
        "platform",
    )
    with pytest.raises(InputError, match=r"phase` is varied, and figures of the long run"):
        choose(question(rig, [1.0, 0.0, 2.3], ("effect.floor-vibration.platform.phase",)))


def test_a_start_angle_that_does_not_count_is_refused(capsys):
    """The figures of the long run stayed as they were, without a word."""
    words = ["sweep", "atlas-tripod", "--vary", "angle.w2=0,0.1", "--speed", "1,2,3"]
    assert run(words) == 2
    assert "a `duration`: `angle.w2` is varied, and figures" in capsys.readouterr().err
    rig = load_rig("atlas-tripod")
    assert choose(question(rig, [1.0, 0.0, 2.0], ("angle.w2",)))[0] == "steady-bulk"  # it rests
    with pytest.raises(InputError, match=r"`angle\.w2` is varied"):
        choose(question(rig, [1.0, 0.0, 2.0], ("angle.w2", "speed.w2")))


@pytest.mark.full
def test_the_long_run_of_wheels_in_step_is_the_mean_over_their_start_angles():
    rng, rig = drawn_anew("mean over angles"), load_rig("atlas-tripod")
    pace = rng.uniform(3.0, 12.0)
    pitch = 2 * np.pi / np.asarray(rig.wheels.rollers)
    angles = [list(rng.uniform(0, 1) + p * np.arange(16) / 16) for p in pitch[:2]]
    runs = sweep(rig, {"angle.w1": angles[0], "angle.w2": angles[1]}, ("rms",),
                 speeds=[pace] * 3, duration=40.0, rate=100.0).to_xarray()  # fmt: skip
    steady = steady_state(rig, [pace] * 3)
    mean = np.sqrt(np.mean(runs.rms.values**2))
    assert mean == pytest.approx(float(steady.rms), rel=0.01)
    assert np.ptp(runs.rms.values) > 0.1 * mean  # they do matter


def test_speeds_that_fit_the_sphere_of_another_rig_are_told(capsys, monkeypatch):
    """A sweep of the radius turned every sphere at another speed, without a word."""
    rng, rig = drawn_anew("refit"), load_rig("atlas-tripod")
    told = refit_remarks(rig, ["sphere.mass", "speed.w1", "wheel.w2.radius", "contact.stiffness"])
    assert len(told) == 1 and "with `wheel.w2.radius` varied" in told[0]
    assert refit_remarks(rig, ["sphere.mass", "wheel.roundness", "force.x"]) == []
    omega = ",".join(f"{x:.3f}" for x in rng.uniform(0.5, 2, 3))
    words = ["sweep", "atlas-tripod", "--omega", omega, "--vary", "sphere.radius=0.9,1.0"]
    words += ["--duration", "20ms"]

    def asked(*_, **__):
        raise InputError("asked.")

    monkeypatch.setattr("omnijax.study.sweep", asked)
    assert run(words) == 2
    told = capsys.readouterr().err
    assert "`sphere.radius` varied, other designs" in told and "asked." in told
    study = {"rig": "atlas-tripod", "drive": [{"omega": [0.0, 1.0, 2.0]}]}
    ranged = {"path": "wheel.radius", "low": 0.03, "high": 0.05}
    with pytest.warns(DataWarning, match="the rig as it stands"):
        parse_study(study | {"variable": [ranged]})
