"""The table of metrics, and what a run says of contacts that slip or lift off."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from seeds import drawn_anew

from omnijax import METRICS, InputError, evaluate, load_rig, simulate, speeds
from omnijax._cubic import cubic_peak
from omnijax._status import Status
from omnijax.cli._simulate.summary import summarise
from omnijax.simulation import RunChannels
from omnijax.study import load_study
from omnijax.study._evaluation.evaluation import margin_status
from omnijax.vibration import STEADY_METRICS, follows, metric_problem, peak

pytestmark = pytest.mark.brief


@pytest.fixture(scope="module")
def run():
    return simulate(load_rig("atlas"), speeds([0.1, 1.2, 0.3]), np.linspace(0, 0.2, 21))


def test_an_old_word_for_an_acceleration_says_whose_is_meant(run, tmp_path):
    for word in ("acceleration_rms", "acceleration_peak", "weighted_acceleration"):
        problem = metric_problem(word)
        assert problem is not None and f"write sphere_{word}" in problem
    with pytest.raises(ValueError, match="does not say whose acceleration it is"):
        evaluate(run, load_rig("atlas"), "rms,acceleration_rms")
    (tmp_path / "s.toml").write_text(
        "rig = 'atlas'\n[objective]\nmetric = 'acceleration_rms'\n[[drive]]\nspeed=[1,2,3]"
    )
    with pytest.raises(ValueError, match="write sphere_acceleration_rms"):
        load_study(tmp_path / "s.toml")


def test_the_table_tells_every_metric():
    for name, metric in METRICS.items():
        assert metric.unit and metric.meaning and callable(metric.of_run), name
        assert (metric.of_steady is not None) == (name in STEADY_METRICS)


def test_the_summary_of_a_run_has_the_metrics_own_figures(run):
    rig = load_rig("atlas")
    found = summarise(run, rig)
    named = {name: found[name] for name in METRICS if name in found}
    assert len(named) == 8
    for name, value in evaluate(run, rig, tuple(named)).items():
        assert value == pytest.approx(named[name], rel=1e-12)
    assert found["platform_acceleration_rms"] != pytest.approx(found["sphere_acceleration_rms"])


def test_a_run_says_which_wheel_lifts_off_and_slips_and_when(run):
    assert run.message().startswith("ok: 21 samples")
    lost = dataclasses.replace(
        run,
        normal_force=run.normal_force.at[7:9, 1].set(-1.0),
        slip_margin=jnp.asarray(run.slip_margin).at[5, 2].set(-1.0),
    )
    assert [str(loss) for loss in lost.contact_losses()] == [
        "w3 slips at 0.05 s",
        "w2 lifts off at 0.07 s",
    ]
    assert lost.message().startswith("ok, but w3 slips at 0.05 s (1 more of slip or lift-off): 21")


@pytest.mark.parametrize("normal", [12.0, 0.0, -3.0])
@pytest.mark.parametrize("slip", [5.0, -1.0])
def test_a_run_and_a_sweep_call_the_same_contacts_lost(run, normal, slip):
    """A contact that parts by the law `lift-off` has no load, and a run had said nothing of it."""
    given = dataclasses.replace(
        run,
        normal_force=run.normal_force.at[7, 1].set(normal),
        slip_margin=jnp.asarray(run.slip_margin).at[5, 2].set(slip),
    )
    least = jnp.min(given.normal_force), jnp.min(given.slip_margin)
    status = Status(int(margin_status(*least)))
    kinds = {loss.kind for loss in given.contact_losses()}
    assert (status == Status.LIFT_OFF) == given.lift_off == ("lifts off" in kinds)
    assert given.slip == ("slips" in kinds)
    assert (status == Status.SLIP) == (given.slip and not given.lift_off)


def test_the_inner_maximum_of_cubics():
    """Against a fine grid; a run that starts at rest has a rate of rounding size there."""
    rng = drawn_anew("cubics")
    u = np.linspace(0, 1, 4001)
    for rate in (0.0, 1e-17, -1e-17, 1e-9, None):
        for _ in range(200):
            (y0, y1), (first, d1) = rng.normal(size=2) ** 2, rng.normal(size=2)
            d0 = first if rate is None else rate
            c2, c3 = 3 * (y1 - y0) - 2 * d0 - d1, 2 * (y0 - y1) + d0 + d1
            values = y0 + u * (d0 + u * (c2 + u * c3))
            at = int(np.argmax(values))
            inside = 0 < at < len(u) - 1
            ends = max(y0, y1)
            top = max(float(cubic_peak(y0, y1, d0, d1)), ends)
            right = min(values[at], 2 * ends) if inside else ends
            assert top == pytest.approx(right, rel=1e-6, abs=1e-6)


def test_a_peak_between_samples_that_do_not_follow_the_vibration_is_bounded():
    """At 5 samples a second the peak was twice the largest value that the motion reached."""
    rng = drawn_anew("coarse samples")
    for _ in range(6):
        omega, phase = rng.uniform(20, 300, 4), rng.uniform(0, 2 * np.pi, (4, 3))
        size = rng.normal(size=(4, 3)) / omega[:, None]

        def vibration(t, size=size, omega=omega, phase=phase):
            angle = omega[:, None] * t[:, None, None] + phase
            return (size * np.cos(angle)).sum(1), -(size * omega[:, None] * np.sin(angle)).sum(1)

        fine, coarse = np.linspace(0, 2, 20_001), np.linspace(0, 2, rng.integers(5, 15))
        top = np.max(np.linalg.norm(vibration(fine)[0], axis=1))
        t = np.linspace(0, 2, int(2 * 8 * omega.max() / (2 * np.pi)))
        assert follows(t, *vibration(t)) and not follows(coarse, *vibration(coarse))
        assert float(peak(jnp.asarray(t), *map(jnp.asarray, vibration(t)))) <= 1.02 * top
        values, rates = vibration(coarse)
        largest = np.max(np.linalg.norm(values, axis=1))
        bounded = float(peak(jnp.asarray(coarse), jnp.asarray(values), jnp.asarray(rates)))
        assert largest <= bounded <= np.sqrt(2) * largest * (1 + 1e-12)


MEANS = (*(name for name in METRICS if "rms" in name), "smooth_peak")


def channels(t):
    """A run that swings ever faster, at the times `t`."""
    one = np.sin(3 * t**2)[:, None] * np.array([1.0, 0.3, -0.2]) + 0.2 * t[:, None]
    return RunChannels(*map(jnp.asarray, (t, one, one, one, one, one, one, one)))


def test_a_mean_over_a_run_is_one_over_its_time_however_its_samples_lie():
    """It was one over the samples: 14 % off where the samples were denser at the start."""
    rig, even, dense = load_rig("atlas"), np.linspace(0, 2, 4001), np.linspace(0, 1, 4001) ** 2 * 2
    by_even = evaluate(channels(even), rig, MEANS)
    by_dense = evaluate(channels(dense), rig, MEANS)
    traced = jax.jit(lambda run: evaluate(run, rig, MEANS))(channels(dense))
    for name in MEANS:
        assert by_dense[name] == pytest.approx(float(by_even[name]), rel=2e-3), name
        assert traced[name] == pytest.approx(float(by_dense[name]), rel=1e-12), name
    square = np.sum(np.asarray(channels(even).dR) ** 2, axis=1)
    assert float(by_even["rms"]) == pytest.approx(np.sqrt(np.mean(square)), rel=1e-15)
    twice = np.repeat(dense, 2)  # a time that stands twice counts once
    assert evaluate(channels(twice), rig, "rms")["rms"] == pytest.approx(
        float(by_dense["rms"]), rel=1e-3
    )


def test_a_weighted_acceleration_asks_for_even_times():
    rig, name = load_rig("atlas"), "sphere_weighted_acceleration"
    even, dense = channels(np.linspace(0, 2, 401)), channels(np.linspace(0, 1, 401) ** 2 * 2)
    assert np.isfinite(evaluate(even, rig, name)[name])
    with pytest.raises(InputError, match="needs samples at even times, but the steps"):
        evaluate(dense, rig, name)
    assert np.isnan(jax.jit(lambda run: evaluate(run, rig, name)[name])(dense))
    digits = even._replace(t=jnp.round(even.t, 4))
    assert np.isfinite(evaluate(digits, rig, name)[name])


def test_the_summary_of_a_run_has_means_over_its_time(run):
    at = np.concatenate([np.linspace(0, 0.01, 11), np.linspace(0.02, 0.2, 10)])
    given = dataclasses.replace(run, t=jnp.asarray(at), dR=jnp.asarray(at[:, None] * np.ones(3)))
    row = next(row for row in given.summary().channels if row.channel == "dR_x")
    assert row.rms == pytest.approx(0.2 / np.sqrt(3), rel=0.1)
    assert row.rms > 1.2 * np.sqrt(np.mean(at**2))
