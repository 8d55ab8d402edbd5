"""What a log lacks costs a diagnosis what it lacks, and is told: cells, rows, clocks, groups."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from seeds import drawn_anew
from test_plant import recorded

from omnijax import InputError
from omnijax.diagnosis import Point, RigModel, diagnose
from omnijax.diagnosis._machine import said_of_compared, to_run
from omnijax.diagnosis._search import levels
from omnijax.laws import EFFECTS
from omnijax.recording import Recording, channels, read_case
from omnijax.recording._grid import BRIDGE, grid_of, on_even_times
from omnijax.recording._shorten import thinned

NOISE = {"dR": 2e-6, "theta": 1e-4, "Omega": 1e-4, "a": 5e-3}
TORQUES = channels("torque", 3)
SECONDS = 2.4


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """A folder of two short runs of a healthy machine, and their tables."""
    folder = tmp_path_factory.mktemp("gaps")
    _, _, tables = recorded(folder, 71, SECONDS)
    return folder, tables


def read(case, change) -> list[Recording]:
    """The runs once every table has been changed."""
    folder, tables = case
    for k, table in enumerate(tables):
        changed = change({c: np.array(x) for c, x in table.items()})
        rows = zip(*changed.values(), strict=True)
        text = "\n".join([",".join(changed), *(",".join(f"{x:.12g}" for x in r) for r in rows)])
        (folder / f"run-{k + 1}.csv").write_text(text.replace("nan", "") + "\n", encoding="utf-8")
    return read_case(folder).runs


def left_of(case, runs: list[Recording]) -> tuple[np.ndarray, RigModel]:
    """What the stated machine leaves of the fitted run, and the model."""
    rig = read_case(case[0]).rig
    model = RigModel(rig, [to_run(run) for run in runs], NOISE, dict(EFFECTS))
    (left,) = model.residuals([Point(np.zeros(len(model.priors)))], "train")
    return left, model


def emptied(columns, lost: slice):
    """A change: cells of these columns are empty."""

    def change(table: dict[str, Any]) -> dict[str, Any]:
        for c in columns:
            table[c][lost] = np.nan
        return table

    return change


def cut(lost):
    """A change: these rows are missing."""
    return lambda table: {c: np.delete(x, lost) for c, x in table.items()}


def test_empty_cells_of_a_torque_cost_what_missing_rows_cost(case):
    """A straight line had counted as measured: a healthy machine was off by 170 sigma."""
    rng = drawn_anew("empty torques")
    second_window = int(rng.integers(520, 750))  # the first one stays
    lost = slice(second_window, second_window + int(rng.integers(BRIDGE + 1, 200)))
    empty, rows = read(case, emptied(TORQUES, lost)), read(case, cut(lost))
    (one, model), (other, second) = left_of(case, empty), left_of(case, rows)
    assert not np.any(model.machine.runs[0].known[lost])
    ours, theirs = model.machine.rows[0], second.machine.rows[0]
    np.testing.assert_array_equal(ours.rotation > 0, theirs.rotation > 0)
    np.testing.assert_array_equal(ours.elastic > 0, theirs.elastic > 0)
    np.testing.assert_allclose(one, other, atol=1e-6)
    assert 0.9 < np.sqrt(np.mean(ours.split(one)[1][ours.rotation > 0] ** 2)) < 1.1


def test_what_was_lost_stays_lost_in_parts_of_a_run(case):
    run = read(case, emptied(TORQUES[1:2], slice(300, 340)))[0]
    np.testing.assert_array_equal(np.flatnonzero(run.lost), np.arange(300, 340))
    less = thinned(run, 7)
    near = np.abs(run.rows[::7] - 320.5) < 20 + 6
    np.testing.assert_array_equal(less.lost, near)
    assert not dataclasses.replace(run, time=run.time[:9], channels={}).lost.any()


def test_rounded_times_of_an_even_clock_move_no_sample(case):
    """Steps of 3, 3 and 4 ms were a hole in ten samples: nothing was compared, and all was well."""
    rng = drawn_anew("rounded times")
    for rate, decimals in (
        (300.0, 3),
        (499.85, 3),
        (400.0, 3),
        (rng.uniform(100, 490), 3),
        (128, 6),
    ):
        true = np.arange(int(2.3 * rate)) / rate
        grid = grid_of(np.round(true, decimals) + round(rng.uniform(0, 99), 3))
        assert grid.even and grid.size == len(true), rate
        assert not grid.gaps.any()
        assert grid.step == pytest.approx(1 / rate, rel=1e-3)

    def sampled(table):
        t = np.arange(0, table["t"][-1], 1 / 300)
        return {c: np.interp(t, table["t"], x) for c, x in table.items()} | {"t": np.round(t, 3)}

    runs = read(case, sampled)
    assert [f.kind for f in runs[0].faults] == ["uneven sampling"]
    assert "s apart (their times are rounded to 0.001 s)" in (runs[0].faults[0].consequence)
    run = to_run(runs[0])
    assert run.known.all() and run.step == pytest.approx(1 / 300, rel=1e-4)
    np.testing.assert_array_equal(run.outputs["a"], runs[0].group("a"))


def test_single_rows_that_are_lost_cost_no_more_than_themselves(case):
    """One in a hundred had cost each window of Omega and theta, and four fifths of dR and a."""
    rng, count = drawn_anew("lost rows"), len(case[1][0]["t"])
    lost = 5 + np.flatnonzero(rng.random(count - 10) < 0.01)
    runs = read(case, cut(lost))
    left, model = left_of(case, runs)
    rows, run = model.machine.rows[0], model.machine.runs[0]
    assert run.known.all()
    whole = np.setdiff1d(np.arange(count), lost)
    np.testing.assert_array_equal(np.flatnonzero((rows.rotation > 0).all(axis=1)), whole)
    np.testing.assert_array_equal(np.flatnonzero((rows.elastic > 0).all(axis=1)), whole)
    for part, weight in zip(rows.split(left), (rows.elastic, rows.rotation), strict=True):
        assert 0.9 < np.sqrt(np.mean(part[weight > 0] ** 2)) < 1.1


def test_an_uneven_clock_is_made_even_and_its_noise_stays_white():
    rng, step, count = drawn_anew("uneven clocks"), 2e-3, 4000
    time = np.cumsum(step * (1 + 0.08 * np.abs(rng.standard_normal(count))))
    kept = np.ones(count, bool)
    kept[2000:2040] = False
    time = time[kept] - time[0]
    grid = grid_of(time)
    assert not grid.even
    true = grid.step * np.arange(grid.size)

    def wave(t):
        return np.stack([np.sin(2 * np.pi * f * t + f) for f in (3.0, 20.0, 45.0)], axis=1)

    moved = on_even_times(grid, wave(time))
    hole = np.isnan(moved[:, 0])
    assert 38 <= hole.sum() <= 43
    error = np.abs(moved - wave(true))[~hole]
    assert np.all(np.sqrt(np.mean(error**2, axis=0)) < [1e-7, 1e-3, 0.01])
    noise = on_even_times(grid, rng.standard_normal((len(time), 8)))[~hole]
    assert np.mean(noise**2) == pytest.approx(1.0, abs=0.06)
    assert abs(np.mean(noise[1:] * noise[:-1])) < 0.06
    linear = np.stack([np.interp(true, time, x) for x in rng.standard_normal((8, len(time)))], 1)
    assert np.mean(linear**2) < 0.75  # what had been worse


def test_a_short_part_between_two_gaps_of_an_uneven_clock_is_not_used():
    time = np.cumsum(np.random.default_rng(0).uniform(0.9, 1.1, 100))
    time = np.delete(time, np.r_[40:46, 50:56])
    moved = on_even_times(grid_of(time), np.ones((len(time), 1)))[:, 0]
    assert np.isnan(moved).sum() in range(15, 20)
    assert moved[np.isfinite(moved)] == pytest.approx(1.0, abs=1e-12)


def test_what_is_hardly_compared_is_said(case):
    """Where windows of Omega and theta lie in a gap, and dR and a ring after it."""

    def change(table):
        return emptied(["a_z"], slice(0, 1000))(emptied(TORQUES, slice(600, 640))(table))

    _, model = left_of(case, read(case, change))
    first, second = said_of_compared(model.machine)
    assert first == (
        "run-1: compared is 84 % of the samples of dR_x, dR_y, dR_z, a_x, a_y; 17 % of the samples "
        "of a_z; 42 % of the samples of Omega_x, Omega_y, Omega_z, theta_1, theta_2, theta_3."
    )
    assert second == first.replace("run-1", "run-2")
    _, whole = left_of(case, read(case, lambda table: table))
    assert said_of_compared(whole.machine) == []


def test_runs_of_which_nothing_can_be_compared_are_refused(case):
    """The answer was `none`, with upper limits."""

    def change(table):
        for first in range(0, 1200, 100):
            table = emptied(TORQUES, slice(first + 20, first + 30))(table)
        return table

    read(case, change)
    with pytest.raises(InputError, match="run-1: of no channel of the fitted runs can more than"):
        diagnose(case[0])


def without(*groups: str):
    """A change: these output groups were not measured."""
    return lambda table: {c: x for c, x in table.items() if c.split("_")[0] not in groups}


class Reached(Exception):
    """The diagnosis goes on to its model."""


@pytest.mark.parametrize("role", ["train", "held-out"])
def test_a_run_that_tells_no_motion_is_left_out_and_said(case, monkeypatch, role):
    """It had ended the diagnosis of all the others."""
    kept = []

    def reached(case, runs, *_):
        kept.extend(run.name for run in runs)
        raise Reached

    read(case, lambda table: table)
    whole = read_case(case[0])
    still = without("theta", "Omega")(whole.runs[0].channels)
    silent = dataclasses.replace(whole.runs[0], name="silent", role=role, channels=still)
    monkeypatch.setattr("omnijax.diagnosis._diagnose._model", reached)
    with pytest.raises(Reached):
        diagnose(dataclasses.replace(whole, runs=[silent, *whole.runs]))
    assert kept == ["run-1", "run-2"]
    with pytest.raises(InputError, match="silent: neither Omega nor theta_1, theta_2, theta_3 was"):
        diagnose(dataclasses.replace(whole, runs=[silent, whole.runs[1]]))


def test_a_diagnosis_is_refused_where_no_run_tells_its_motion(case):
    read(case, without("theta", "Omega"))
    with pytest.raises(InputError) as error:
        diagnose(case[0])
    assert list(error.value.problems) == [
        "No run is left that can be used.",
        *(
            f"run-{k}: neither Omega nor theta_1, theta_2, theta_3 was measured, so its motion is "
            "not known; the run is not used."
            for k in (1, 2)
        ),
    ]


@pytest.mark.parametrize("steps", [(2e-3, 4e-3), (4e-3, 2e-3), (2e-3, 2e-3)])
def test_lines_of_runs_of_other_rates_stand_at_their_frequencies(steps):
    """They were all put on the first run's frequencies: 80 Hz of a run at 250 Hz were 160 Hz."""
    rng = drawn_anew("lines of two rates")
    lines, parts = (rng.uniform(15, 50), rng.uniform(60, 115)), []
    for step, line in zip(steps, lines, strict=True):
        t = step * np.arange(2000)
        a = rng.standard_normal((2000, 3)) + np.sin(2 * np.pi * line * t)[:, None]
        parts.append(np.concatenate([np.zeros((2000, 3)), a], axis=1))
    rows = [
        SimpleNamespace(size=x.size, split=lambda own: (own.reshape(-1, 6), None)) for x in parts
    ]
    model: Any = SimpleNamespace(
        residuals=lambda *_: [np.concatenate([x.ravel() for x in parts])],
        splits={"train": [0, 1]},
        machine=SimpleNamespace(
            runs=[SimpleNamespace(step=step, samples=2000) for step in steps], rows=rows
        ),
    )
    strongest = sorted(RigModel._lines(model, Point(np.zeros(0)))[:2])
    assert strongest == pytest.approx(lines, abs=0.1)
    lag: Any = SimpleNamespace(key="tau")
    assert RigModel._ends(model, Point(np.zeros(0)), lag)["low"] == pytest.approx(0.25 * max(steps))


def test_runs_of_other_rates_show_no_colour_together():
    """Cycles a sample are other frequencies there."""
    rng = drawn_anew("colours of two rates")
    white, walk = rng.standard_normal((2, 3000))
    columns = [white, walk + 0.3 * np.cumsum(rng.standard_normal(3000))]
    together = levels(columns, True, [2e-3, 2.001e-3])
    assert {x.colour for x in together} == {"wandering"}
    apart = levels(columns, True, [2e-3, 4e-3])
    assert [x.colour for x in apart] == ["white", "wandering"]
    assert levels(columns[:1], True)[0].ratio == apart[0].ratio
