"""Angles of a machine's log that are told within one turn, and stamps that are rounded."""

import numpy as np
import pytest
from seeds import drawn_anew

from omnijax.machine import Log, LogFile, guess, read_log

TURN = 2 * np.pi
TIME = 5e-3 * np.arange(400)


def log_of(tmp_path, angle, time=TIME):
    """(what `read_log` reads, what `case new` guesses, the faults) of an angle in rad."""
    path = tmp_path / "run.csv"
    table = np.stack([time, np.sin(9 * time), angle], 1)
    np.savetxt(path, table, delimiter=",", header="t,torque,position", comments="", fmt="%.17g")
    file = LogFile(tmp_path / "run.toml", path, channels={"input": "torque"})
    log = read_log(file, {"input": "N m"}, {"position": "rad"})
    return log.outputs["position"], guess(path).signals.position, log.faults


@pytest.mark.parametrize("place", range(6))
def test_an_angle_is_unwound_right_or_not_at_all(tmp_path, place):
    """Of 400 angles at low rates 105 came out with wrong turns, and nothing but `it goes on`."""
    rng = drawn_anew(f"turns of an axis {place}")
    fast = rng.uniform(0.1, 1.0) * np.pi / 5e-3  # rad/s; from a third of a turn a sample on unknown
    true = fast * TIME if place % 2 else fast * np.cumsum(np.sin(3 * TIME)) * 5e-3
    true += 1e-3 * rng.standard_normal(len(true))
    wrapped = true % TURN
    read, guessed, faults = log_of(tmp_path, wrapped)
    np.testing.assert_allclose(read, guessed, atol=1e-9)
    if any("goes on" in x for x in faults):
        np.testing.assert_allclose(np.diff(read), np.diff(true), atol=1e-6)
    else:
        np.testing.assert_allclose(read, wrapped, atol=1e-9)
        assert any("cannot be told" in x for x in faults)


def test_bad_readings_of_an_angle_are_not_turns(tmp_path):
    """A joint that swings by 1 rad, with dropouts: 201 of 800 such angles were unwrapped."""
    rng = drawn_anew("bad readings of an axis")
    angle = 2.9 + 0.3 * np.sin(4 * TIME)
    angle[rng.integers(20, 380, 5)] = -0.5
    read, guessed, faults = log_of(tmp_path, angle)
    np.testing.assert_allclose(read, angle)
    np.testing.assert_allclose(guessed, angle)
    assert any("cannot be told" in x for x in faults) and not any("goes on" in x for x in faults)


@pytest.mark.parametrize("turn", [TURN, 360.0])
def test_a_wrapped_angle_goes_on_in_its_unit(tmp_path, turn):
    """Degrees that nobody said to be such are wrapped at 360."""
    true = turn * (2.5 * np.sin(6 * TIME) + TIME)
    read, _, faults = log_of(tmp_path, true % turn)
    np.testing.assert_allclose(np.diff(read), np.diff(true), atol=1e-6 * turn)
    assert any(f"within {'one turn' if turn == TURN else '360'}" in x for x in faults)


def test_rows_beyond_an_unknown_number_of_turns_are_left_out(tmp_path):
    """A gap of four steps is bridged, but nobody knows how often a fast angle turned in it."""
    true = TURN * 0.2 * np.cumsum(np.sin(60 * TIME))
    missing = np.concatenate([TIME[:150], TIME[154:]])
    read, guessed, faults = log_of(tmp_path, np.interp(missing, TIME, true) % TURN, missing)
    assert len(read) == len(guessed) == 246 and any("150 rows beside it" in x for x in faults)
    np.testing.assert_allclose(np.diff(read), np.diff(true[154:]), atol=1e-6)


@pytest.mark.parametrize("rate", [1e3, 1e4])
def test_stamps_since_1970_tell_the_rate(tmp_path, rate):
    """At 10 kHz the median of the rounded steps was 0.1 % off, and with it every speed."""
    time = np.arange(9000) / rate
    log_of(tmp_path, np.sin(9 * time), 1714600000 + time)
    file = LogFile(tmp_path / "run.toml", tmp_path / "run.csv", channels={"input": "torque"})
    log = read_log(file, {"input": "N m"}, {"position": "rad"})
    assert 1 / log.step == pytest.approx(rate, rel=1e-6) and len(log.time) == 9000
    assert guess(tmp_path / "run.csv").rate == pytest.approx(rate, rel=1e-6)


@pytest.mark.parametrize("step", [1e-3, 1e-4])
def test_a_coarse_encoder_tells_the_speed_that_a_run_begins_with(step):
    """Of 4096 counts a turn at 10 kHz a first difference is off by 4.3 rad/s of 2.1 (RMS)."""
    rng, count, time = drawn_anew(f"first speed {step}"), TURN / 4096, step * np.arange(4000)
    phases, off = rng.uniform(0, 6, 40), []
    for phase in phases:
        shown = {"position": count * np.rint(np.sin(3 * time + phase) / count)}
        log = Log("log", "train", time, {"input": time}, shown)
        off.append(log.start["position"][1] - 3 * np.cos(phase))
    assert np.sqrt(np.mean(np.square(off))) < 0.2
    exact = Log("log", "train", time, {"input": time}, {"position": np.sin(3 * time + 1)})
    assert exact.start["position"][1] == pytest.approx(3 * np.cos(1), rel=1e-4)
