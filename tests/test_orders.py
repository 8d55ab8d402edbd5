"""Orders: planted lines are found where they are, stay where they must, and fold as they should."""

import dataclasses
import json

import jax.numpy as jnp
import numpy as np
import pytest
from machines import RECORDINGS, machine
from rigs import tables

from omnijax import (
    Recording,
    cli,
    parse_rig,
    propagate,
    read_recording,
    speeds,
    write_recording,
)
from omnijax.vibration import modes, order_track, rpm_order_map

pytestmark = pytest.mark.brief

RATE = 500.0
TIME = np.arange(3000) / RATE
# a run-up from 6 to 30 rad/s: order 14 rises from 13 to 67 Hz
ANGLE = 0.3 + 6 * TIME + 2 * TIME**2
NOISE = 1e-7 * np.random.default_rng(2).standard_normal(len(TIME))


def recording(values, angle=ANGLE):
    """A recording in which only wheel 2 turns and dR_y is `values`."""
    channels = {f"torque_{i}": np.zeros(len(TIME)) for i in (1, 2, 3)}
    channels |= {"theta_1": 0 * angle, "theta_2": angle, "dR_y": values}
    return Recording("run", None, TIME, channels, 3)  # pyright: ignore


def test_an_order_line_stays_put_and_a_line_in_hz_does_not():
    values = 3e-6 * np.cos(14 * ANGLE + 0.5) + 2e-6 * np.sin(2 * np.pi * 31 * TIME) + NOISE
    found = rpm_order_map(recording(values), "dR_y", "2", turns=2, max_order=40)
    order, level = found.strongest(1)[0]
    assert order == pytest.approx(14, abs=0.13)
    assert level == pytest.approx(3e-6, rel=0.05)
    off = np.where(np.abs(found.orders - 14) > 3, found.amplitude, 0)
    hz = found.orders[np.argmax(off, axis=1)] * found.speed / 60
    apart = np.abs(31 * 60 / found.speed - 14) > 4
    np.testing.assert_allclose(hz[apart], 31, rtol=0.08)
    assert found.speed[0] < 100
    assert found.speed[-1] > 250


def test_amplitudes_as_peak_rms_and_power_and_a_flat_top():
    """A sine of 3 µm between two orders of the map: RMS 3/√2, power 9/2, as MATLAB has them."""
    run = recording(3e-6 * np.cos(14.06 * ANGLE + 0.5))
    kinds = {k: rpm_order_map(run, "dR_y", "2", amplitude=k) for k in ("peak", "rms", "power")}
    level = {k: found.strongest(1)[0][1] for k, found in kinds.items()}
    assert level["peak"] == pytest.approx(3e-6, rel=0.02)
    assert level["rms"] == pytest.approx(level["peak"] / np.sqrt(2), rel=1e-12)
    assert kinds["power"].unit == "(m)^2"
    assert level["power"] == pytest.approx(level["rms"] ** 2, rel=0.01)
    track = order_track(run, [14.06], "dR_y", "2", amplitude="rms")
    np.testing.assert_allclose(track.amplitude, 3e-6 / np.sqrt(2), rtol=1e-6)
    hann, flat = (
        rpm_order_map(run, "dR_y", "2", turns=4, window=w).amplitude for w in ("hann", "flattop")
    )
    at = np.argmin(np.abs(kinds["peak"].orders - 14.25))  # 0.19 orders beside the line
    assert np.all(np.abs(flat[:, at] / 3e-6 - 1) < 0.02) and np.all(hann[:, at] < 2.5e-6)


def test_tracks_give_amplitude_and_phase_of_close_orders():
    growing = 1e-6 * (1 + TIME)
    values = growing * np.cos(14 * ANGLE + 0.5) + 4e-6 * np.cos(14.6 * ANGLE - 1) + NOISE
    track = order_track(recording(values), [14, 14.6], "dR_y", "2", turns=3)
    np.testing.assert_allclose(track.amplitude[:, 0], 1e-6 * (1 + track.time), rtol=0.06)
    np.testing.assert_allclose(track.amplitude[:, 1], 4e-6, rtol=0.03)
    np.testing.assert_allclose(track.phase[:, 0], 0.5, atol=0.05)
    assert not track.aliased.any()


def test_a_folded_line_is_marked_and_its_track_is_still_right():
    values = 3e-6 * np.cos(100 * ANGLE) + NOISE  # 95 to 477 Hz: beyond 250 Hz it folds
    found = rpm_order_map(recording(values), "dR_y", "2", turns=2, max_order=120)
    slow, fast = found.speed < 130, found.speed > 170
    at = np.argmin(np.abs(found.orders - 100))
    assert not found.aliased[slow, at].any()
    assert found.aliased[fast, at].all()
    assert np.isnan(found.amplitude[fast, at]).all()
    np.testing.assert_allclose(found.amplitude[slow, at], 3e-6, rtol=0.05)
    track = order_track(recording(values), [100], "dR_y", "2", turns=2)
    assert track.aliased[-1, 0]
    np.testing.assert_allclose(track.amplitude[track.aliased], 3e-6, rtol=0.05)


def test_each_window_folds_at_its_own_rate():
    """The rate of the whole run's median marked what the sparse part cannot tell as seen."""
    run = recording(3e-6 * np.cos(14 * ANGLE))
    kept = np.concatenate([np.arange(2000), np.arange(2000, 3000, 4)])
    channels = {name: values[kept] for name, values in run.channels.items()}
    sparse = Recording("run", None, TIME[kept], channels, 3)  # pyright: ignore
    by_rate = rpm_order_map(sparse, "dR_y", "2", turns=2, max_order=40)
    rate = np.where(by_rate.time < 3.5, RATE, RATE / 4)
    clear = np.abs(by_rate.time - 4) > 0.5
    limit = (np.pi * rate / (by_rate.speed / 60 * 2 * np.pi))[:, None]
    np.testing.assert_array_equal(by_rate.aliased[clear], (by_rate.orders > limit)[clear])


def test_missing_samples_and_reversals_do_no_harm():
    angle = 10 * np.sin(TIME) + 12 * TIME
    values = 3e-6 * np.cos(5 * angle)
    values[700:710] = np.nan
    there_and_back = np.where(TIME < 3, angle, 2 * angle[1500] - angle)
    folded = 3e-6 * np.cos(5 * there_and_back)
    for x, a in ((values, angle), (folded, there_and_back)):
        track = order_track(recording(x, a), [5], "dR_y", "2", turns=1.5)
        assert len(track.time) > 4
        np.testing.assert_allclose(track.amplitude[np.isfinite(track.amplitude)], 3e-6, rtol=0.02)


@pytest.mark.full  # in the gate those of a measured run, below
def test_rollers_of_a_simulated_wheel_are_its_orders():
    run = propagate(machine(rollers=10.0), speeds([0.0, 9.0, 0.0]), np.arange(1500) / RATE)
    name = run.names[1]
    found = rpm_order_map(run, f"shape_{name}", name, max_order=35)
    tops = sorted(round(order) for order, _ in found.strongest(3))
    assert tops == [10, 20, 30]
    whole = rpm_order_map(run, "distance", name, max_order=35)
    assert round(whole.strongest(1)[0][0]) % 10 == 0  # which one: a matter of resonance
    assert "orders of wheel" in repr(whole)


def test_a_measured_run_shows_its_roller_orders_and_the_runout_that_hides_in_it():
    """Wheel 1 of twelve rollers shakes the sphere along x; 40.75 µm of runout are order 1."""
    run = read_recording(RECORDINGS / "case-07" / "run-1.csv.gz")
    found = dict(rpm_order_map(run, "dR_x", "1", turns=3, max_order=30).strongest(4))
    assert {1.0, 12.0, 24.0} <= set(found)
    assert found[1.0] == max(found.values()) == pytest.approx(4.075e-5, rel=0.1)
    across = dict(rpm_order_map(run, "dR_y", "1", turns=3, max_order=30).strongest(4))
    assert across.get(1.0, 0.0) < 0.1 * found[1.0]


def test_results_are_tables_in_a_notebook_and_datasets():
    values = 3e-6 * np.cos(14 * ANGLE + 0.5)
    found = rpm_order_map(recording(values), "dR_y", "2", turns=2, max_order=30)
    track = order_track(recording(values), [14, 15], "dR_y", "2")
    assert "<td>14</td>" in found._repr_html_() and "<td>14</td>" in track._repr_html_()
    data = found.to_xarray()
    assert data["amplitude"].attrs["units"] == "m" and data["speed"].attrs["units"] == "rpm"
    assert float(data["amplitude"].sel(order=14.0).mean()) == pytest.approx(3e-6, rel=0.05)
    assert float(track.to_xarray()["phase"].sel(order=14.0).mean()) == pytest.approx(0.5, abs=0.05)
    modes_ = modes(machine())
    assert "damping ratio" in modes_._repr_html_()
    np.testing.assert_array_equal(modes_.to_xarray()["frequency"], modes_.frequency)


def test_pictures_show_orders_and_units():
    values = 3e-6 * np.cos(14 * ANGLE + 0.5)
    found = rpm_order_map(recording(values), "dR_y", "2", turns=2, max_order=30)
    for axes in (found.plot(), found.plot(over="speed"), found.plot_waterfall()):
        assert axes.get_xlabel() == "order of wheel 2"
    axes = found.plot_waterfall()
    axes.figure.canvas.draw()
    bar, length = axes.lines[-1], axes.texts[-1]
    assert length.get_text().endswith(" µm")
    assert length.get_window_extent().x0 > bar.get_window_extent().x1 + bar.get_linewidth()
    axes = order_track(recording(values), [14], "dR_y", "2").plot(over="speed")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("speed (rpm)", "ΔR_y, peak (µm)")
    drawn = np.concatenate([line.get_ydata() for line in axes.lines])
    assert np.nanmax(drawn) == pytest.approx(3, rel=0.02)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda r: rpm_order_map(r, "dR_q", "2"), "`channel` must be distance or one of"),
        (lambda r: rpm_order_map(r, "dR_y", "w9"), "`reference` must be one of 1, 2, 3, sphere"),
        (lambda r: rpm_order_map(r, "dR_y", "1"), "wheel 1 turns 0 times in this run"),
        (lambda r: rpm_order_map(r, "dR_y", "3"), "its angle was not measured"),
        (lambda r: rpm_order_map(r, "dR_y", "sphere"), "Omega was not measured"),
        (lambda r: order_track(r, [-1], "dR_y", "2"), "`orders` must be positive numbers"),
        (lambda r: order_track(r, [np.nan], "dR_y", "2"), "`orders` must be positive numbers"),
        (lambda r: order_track(r, "14, x", "dR_y", "2"), "`orders` must be a plain number"),
        (lambda r: order_track(r, [1], "dR_y", "2", turns=0), r"`turns` must lie in \(0, inf\)"),
        (lambda r: order_track(r, [1], "dR_y", "2", turns=1e5), r"`turns` must lie in \[0\.01, 1"),
        (lambda r: rpm_order_map(r, "dR_y", "2", max_order=1e9), "`max_order` must lie in"),
        (lambda r: rpm_order_map(r, "dR_y", 9), "`reference` must be one of 1, 2, 3, sphere"),
        (lambda r: order_track(r, [1], "dR_y", "2").plot(over="x"), "`over` must be time or speed"),
    ],
)
def test_what_cannot_be_analysed_is_said(call, message):
    with pytest.raises(ValueError, match=message):
        call(recording(jnp.asarray(NOISE)))


def test_options_of_orders_are_read_as_drives_are():
    """They ended in an AttributeError, a TypeError or a LinAlgError."""
    run = recording(3e-6 * np.cos(14 * ANGLE))
    want = order_track(run, [14, 28], "dR_y", "2", turns=2)
    for orders, reference, turns in (("14, 28", 2, "2"), (["14", 28], np.int64(2), 2)):
        told = order_track(run, orders, "dR_y", reference, turns=turns)
        np.testing.assert_array_equal(told.amplitude, want.amplitude)
    told = rpm_order_map(run, "dR_y", 2, max_order="20")
    assert told.orders[-1] == pytest.approx(20, abs=0.1)


@pytest.mark.full  # in the gate channels by their names: test_python
def test_wheels_called_x_y_and_z_leave_the_axes_what_they_are():
    """The wheels' places were read in the place of the axes'."""
    data = tables()
    for wheel, name in zip(data["wheel"], "zxy", strict=True):
        wheel["name"] = name
    run = propagate(parse_rig(data), speeds([10.0, 9.0, 8.0]), np.arange(800) / 800)
    named = dataclasses.replace(run, names=("w1", "w2", "w3"))
    for channel in ("dR_x", "dR_z", "force_x"):
        with_axes, plain = (order_track(r, [14], channel, "1") for r in (run, named))
        np.testing.assert_array_equal(with_axes.amplitude, plain.amplitude)
    assert order_track(run, [14], "theta_z", "x").channel == "theta_z"


def _orders(capsys, *arguments):
    code = cli.run(["orders", *map(str, arguments)])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_the_command_names_the_passing_of_rollers_and_writes_a_page(capsys, tmp_path):
    values = 3e-4 * np.cos(28 * ANGLE) + 1e-4 * np.cos(9.5 * ANGLE)
    path = write_recording(tmp_path / "run.csv", recording(values))
    options = ["--channel", "dR_y", "--reference", "2", "--rig", "atlas", "--track", "28,9.5"]
    code, said, _ = _orders(capsys, path, *options, "--out", tmp_path / "page", "--json")
    found = json.loads(said)
    assert code == 0
    assert [round(row["order"], 1) for row in found["orders"][:2]] == [28.0, 9.5]
    assert found["orders"][0]["meaning"] == "2 × the passing of wheel w2's rollers"
    assert found["orders"][1]["meaning"] == ""
    named = [{"2": "w2"}.get(word, word) for word in options]  # as the rig calls it
    assert json.loads(_orders(capsys, path, *named, "--json")[1])["orders"] == found["orders"]
    alike = recording(values)
    alike.channels["theta_1"], alike.channels["theta_3"] = ANGLE, 0 * ANGLE
    path = write_recording(tmp_path / "alike.csv", alike)
    found = json.loads(_orders(capsys, path, *options, "--json")[1])
    assert found["orders"][0]["meaning"] == "2 × the passing of the rollers of wheels w1 and w2"
    page = (tmp_path / "page" / "index.html").read_text(encoding="utf-8")
    assert "Order 28 of wheel 2 is the strongest" in page
    tracks = np.genfromtxt(tmp_path / "page" / "order-tracks.csv", delimiter=",", names=True)
    np.testing.assert_allclose(tracks["order_28__µm"], 300, rtol=0.02)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--channel", "dR_q"], "`channel` must be distance or one of"),
        (["--channel", "dR_y"], "`reference` cannot be wheel 1: its angle was not"),
        (["--channel", "dR_y", "--reference", "2", "--track", "9;8"], "`track` must be orders"),
    ],
)
def test_the_command_says_what_cannot_be_analysed(capsys, tmp_path, options, message):
    path = write_recording(tmp_path / "run.csv", recording(NOISE))
    code, _, said = _orders(capsys, path, *options)
    assert code == 2
    assert f"run.csv: {message}" in said
