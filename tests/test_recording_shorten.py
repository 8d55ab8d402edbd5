"""Runs that are thinned or cut: measured values stay, impulses stay, and it is said."""

import dataclasses

import numpy as np
import pytest
from recordings import columns, write
from seeds import drawn_anew

from omnijax import InputError, read_case, read_recording
from omnijax.cli._frame import run as command
from omnijax.recording._shorten import thinned
from omnijax.rig import bundled_rigs


@pytest.fixture
def run(tmp_path):
    return read_recording(write(tmp_path / "run.csv", columns(samples=601)))


def _drawn_inputs(run, rng):
    """The run with inputs of every frequency that its samples can hold."""
    names = [c for c in run.channels if c.startswith(("torque", "force"))]
    moved = {c: rng.standard_normal(len(run)) + np.sin(run.time) for c in names}
    return dataclasses.replace(run, channels=run.channels | moved), names


def test_kept_outputs_are_those_measured_and_inputs_keep_their_impulse(run):
    rng = drawn_anew("thinned runs")
    for _ in range(20):
        every = int(rng.integers(2, 40))
        whole, inputs = _drawn_inputs(run, rng)
        less = thinned(whole, every)
        np.testing.assert_allclose(less.time, whole.time[::every], 1e-12)
        assert less.step == pytest.approx(every * whole.step)
        for name, x in whole.channels.items():
            if name not in inputs:
                np.testing.assert_array_equal(less.channels[name], x[::every])
                continue
            line = np.interp(whole.time, less.time, less.channels[name])
            missed = (x - line)[: every * (len(less.time) - 1) + 1]
            for knot in range(len(less.time)):  # the nearest line: orthogonal to every hat
                hat = np.interp(whole.time[: len(missed)], less.time, np.eye(len(less.time))[knot])
                assert abs(hat @ missed) < 1e-9 * np.linalg.norm(x)


def test_an_input_that_is_straight_between_kept_samples_stays_as_it_is(run):
    rng = drawn_anew("straight inputs")
    corners = run.time[::5]
    straight = {
        c: np.interp(run.time, corners, rng.standard_normal(len(corners)))
        for c in run.channels if c.startswith("torque")
    }  # fmt: skip
    less = thinned(dataclasses.replace(run, channels=run.channels | straight), 5)
    for name, x in straight.items():
        np.testing.assert_allclose(less.channels[name], x[::5], atol=1e-12)


def test_gaps_stay_on_the_grid(run):
    rng = drawn_anew("gaps of thinned runs")
    lost = np.zeros(len(run), bool)
    lost[rng.integers(50, 500) + np.arange(40)] = True
    gapped = dataclasses.replace(
        run, time=run.time[~lost], rows=run.rows[~lost],
        channels={c: x[~lost] for c, x in run.channels.items()},
    )  # fmt: skip
    less = thinned(gapped, 6)
    places = np.rint(less.time / run.step).astype(int)
    assert np.all(places % 6 == 0)
    assert not np.any(lost[places])
    np.testing.assert_array_equal(less.rows, places + 1)
    assert all(np.isfinite(less.channels[f"torque_{i}"]).all() for i in (1, 2, 3))


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "rig.toml").write_bytes(bundled_rigs()["atlas"].read_bytes())
    for seed, name in enumerate(("a", "b")):
        write(tmp_path / f"{name}.csv", columns(samples=1000, seed=seed))
    return tmp_path


def test_cases_say_what_is_left_and_keep_the_whole_runs_for_the_noise(folder):
    case = read_case(folder)
    less = case.first(1.5).thinned(3)
    assert [len(x) for x in less.runs] == [251, 251]
    assert [len(x) for x in less.noise_runs] == [1000, 1000]
    said = [f.what + "; " + f.consequence for f in less.all_faults if f.file == "b.csv"]
    assert "751 samples at 500 Hz; one in 3 is compared; the inputs between are averaged" in said
    assert "1.998 s long; its first 1.5 s are used" in said
    assert case.thinned(1).runs == case.runs == case.first(5.0).runs
    for every in (0, -2, 1000):
        with pytest.raises(InputError, match=rf"a\.csv: one sample in {every} cannot .* 1 to 999"):
            case.thinned(every)
    with pytest.raises(InputError, match=r"a\.csv: the first 0\.001 s hold no two samples: more"):
        case.first(1e-3)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--thin", "0"], "`thin` is 0, but must be 1 or more"),
        (["--thin", "1.5"], "'1.5' is no whole number"),
        (["--thin", "20"], "a run needs 100 samples"),
        (["--first", "0s"], "`first` must lie in (0, inf) s"),
        (["--first", "3 kg"], "`first`"),
        (["--first", "0.1s"], "a run needs 100 samples"),
    ],
)
def test_what_cannot_be_left_is_refused(folder, options, said, capsys):
    assert command(["diagnose", str(folder), *options, "--out", str(folder / "answer")]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert not (folder / "answer").exists()
