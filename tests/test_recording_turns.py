"""Wrapped wheel angles: unwrapped where that can be told; an unwrapped one is never touched."""

import numpy as np
import pytest
from recordings import columns, write
from seeds import drawn_anew

from omnijax import read_recording
from omnijax.recording._turns import unwrap

TURN = 2 * np.pi


def motion(rng, samples, step):
    """An angle that swings and turns on, at up to some turns a second."""
    t = step * np.arange(samples)
    swings = rng.normal(0, rng.uniform(0.2, 12), 3) / np.arange(1, 4)
    phases = np.outer(np.arange(1, 4) * rng.uniform(0.2, 3, 3), t) + rng.uniform(0, 7, (3, 1))
    angle = swings @ np.sin(phases) + rng.normal(0, 3) * t
    angle += 10.0 ** rng.uniform(-6, -2.5) * rng.standard_normal(samples)
    count = rng.choice([0, TURN / 4096, TURN / 200])
    return t, count * np.rint(angle / count) if count else angle


def spoilt(rng, t, angle):
    """With missing values, a missing stretch and missing rows, in some."""
    angle, n = angle.copy(), len(t)
    if rng.random() < 0.5:
        begin = rng.integers(n)
        angle[begin : begin + rng.integers(1, 200)] = np.nan
    if rng.random() < 0.3:
        angle[rng.random(n) < 0.02] = np.nan
    begin = rng.integers(1, n)
    rows = np.ones(n, bool)
    rows[begin : begin + rng.integers(60)] = rng.random() < 0.7
    return rows, t[rows], angle[rows]


def read(t, angle):
    values = angle.copy()
    return values, unwrap("run.csv", {"theta_1": values}, t, np.arange(len(t)) + 1)


def test_an_unwrapped_angle_is_never_touched():
    rng = drawn_anew("unwrapped angles")
    for _ in range(600):
        t, angle = motion(rng, rng.integers(30, 2000), 10.0 ** rng.uniform(-3, -0.5))
        if rng.random() < 0.3:  # bad readings, of any size or of none
            bad = rng.random(len(t)) < 0.01
            angle[bad] = rng.choice([0.0, angle[0], *rng.uniform(-8, 8, 3)], bad.sum())
        if rng.random() < 0.2:
            angle = rng.uniform(0, TURN, len(t))
        _, t, angle = spoilt(rng, t, angle)
        values, faults = read(t, angle)
        assert faults == []
        np.testing.assert_array_equal(values, angle)


def test_a_wrapped_angle_is_unwrapped_right_or_not_at_all():
    rng, whole = drawn_anew("wrapped angles"), 0
    for _ in range(400):
        t, true = motion(rng, rng.integers(100, 2000), 10.0 ** rng.uniform(-3, -1.5))
        below = rng.choice([0.0, -np.pi])
        rows, t, angle = spoilt(rng, t, (true - below) % TURN + below)
        values, faults = read(t, angle)
        if not faults:
            np.testing.assert_array_equal(values, angle)
            continue
        assert {x.kind for x in faults} == {"wrapped"}
        off = (values - true[rows])[np.isfinite(values)]
        np.testing.assert_allclose(off, off[0], atol=1e-6)
        lost = np.isfinite(angle).sum() - len(off)
        assert (lost > 0) == (len(faults) == 2)
        whole += lost == 0
    assert whole > 150


@pytest.mark.parametrize(("modulus", "said"), [
    (TURN, "one turn"), (4 * TURN, "4 turns"), (2**16 * TURN / 1000, "411.775 rad"),
])  # fmt: skip
def test_moduli_that_are_told(modulus, said):
    t = 1e-3 * np.arange(20000)
    true = TURN / 1000 * np.rint((90 * t + 4 * np.sin(9 * t)) / TURN * 1000)
    values, faults = read(t, true % modulus)
    assert f"the angle jumps by {said}" in faults[0].what
    np.testing.assert_allclose(values, true, atol=1e-6)


def test_an_angle_in_degrees_without_a_unit():
    t = 1e-3 * np.arange(4000)
    values, faults = read(t, np.rad2deg(9 * t) % 360)
    assert "the angle jumps by 360 5 times (it is wrapped); it is unwrapped" in str(faults[0])
    np.testing.assert_allclose(values, np.rad2deg(9 * t), atol=1e-9)


def test_an_encoder_that_is_slower_than_the_other_channels():
    t, true = 1e-3 * np.arange(4000), 5e-3 * np.arange(4000)
    angle = np.where(np.arange(4000) % 5, np.nan, true % TURN)
    values, faults = read(t, angle)
    assert [x.kind for x in faults] == ["wrapped"]
    np.testing.assert_allclose(values[::5], true[::5], atol=1e-9)


def test_a_wheel_at_rest_where_the_angle_begins_anew():
    rng = drawn_anew("a wheel at rest")
    true = 1e-3 * rng.standard_normal(400)
    values, faults = read(2e-3 * np.arange(400), true % TURN)
    assert [x.kind for x in faults] == ["wrapped"]
    np.testing.assert_allclose(values - values[0], true - true[0], atol=1e-9)


def test_too_few_samples_a_turn_tell_nothing():
    t = 0.1 * np.arange(400)
    angle = 25 * t % TURN
    values, faults = read(t, angle)
    assert faults == [] and np.array_equal(values, angle)


def test_the_reader_unwraps_and_says_so(tmp_path):
    table = columns(2000)
    for i in (1, 3):
        table[f"theta_{i}"] = (2 * table[f"theta_{i}"]) % TURN
    run = read_recording(write(tmp_path / "run.csv", table, None))
    assert [(x.column, x.kind) for x in run.faults] == [
        ("theta_1", "wrapped"),
        ("theta_3", "wrapped"),
    ]
    for i in (1, 3):
        np.testing.assert_allclose(
            run.channels[f"theta_{i}"], 2 * columns(2000)[f"theta_{i}"], atol=1e-7
        )
