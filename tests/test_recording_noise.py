"""The noise floor: what is declared, what repeats or rest show, and when it cannot be known."""

import json

import numpy as np
import pytest
from machines import RECORDINGS
from recordings import columns, write
from seeds import drawn_anew

from omnijax import Recording, read_case, read_recording
from omnijax.recording import noise_floor

rng = np.random.default_rng(3)


def run_of(values, torque=None, noise=None):
    """A recording of one channel group dR, (samples, 3)."""
    torque = np.zeros(len(values)) if torque is None else torque
    time = 2e-3 * np.arange(len(values))
    channels = {f"torque_{i}": torque for i in (1, 2, 3)}
    channels |= {f"force_{axis}": np.zeros(len(values)) for axis in "xyz"}
    channels |= {f"dR_{axis}": values[:, i] for i, axis in enumerate("xyz")}
    return Recording("run", None, time, channels, 3, noise=noise or {})  # pyright: ignore


def busy(samples):
    """Movement of every frequency up to 40 % of the sampling's half, as strong as the noise."""
    spectrum = np.zeros((samples // 2 + 1, 3), complex)
    top = int(0.2 * samples)
    spectrum[:top] = rng.standard_normal((top, 3)) + 1j * rng.standard_normal((top, 3))
    return 3e-4 * np.fft.irfft(spectrum, samples, axis=0)


def test_declared_noise_counts_first(tmp_path):
    table = columns(900, rolling_from=400)
    run = read_recording(write(tmp_path / "run.csv", table, "[noise]\ndR = 5e-6\n"))
    floor = noise_floor([run])
    assert floor.source == {"dR": "declared", "theta": "rest"}
    assert floor.group("dR") == 5e-6
    assert floor.group("theta") == pytest.approx(1e-4, rel=0.15)
    assert "dR: 5e-06 (declared)" in str(floor)


def test_rest_is_measured_even_while_the_floor_shakes():
    n, late = 900, np.where(np.arange(900) > 500, 1.0, 0.0)
    shaking = 3e-5 * np.sin(2 * np.pi * 17 * 2e-3 * np.arange(n))[:, None]
    values = shaking + late[:, None] * busy(n) + 2e-6 * rng.standard_normal((n, 3))
    floor = noise_floor([run_of(values, late)])
    assert floor.source == {"dR": "rest"}
    assert floor.group("dR") == pytest.approx(2e-6, rel=0.15)


def test_the_error_of_an_estimate_is_its_scatter():
    """Rest, and repeats: deviations in units of the stated error, over many draws."""
    late = np.where(np.arange(700) > 400, 1.0, 0.0)
    pulls = {"rest": [], "repeats": []}
    for _ in range(150):
        runs = [run_of(rng.standard_normal((700, 3)), late) for _ in range(2)]
        for how, some in (("rest", runs[:1]), ("repeats", runs)):
            floor = noise_floor(some)
            assert floor.source["dR"] == how
            pulls[how].append((floor.group("dR") - 1) / floor.error["dR"])
    for found in pulls.values():
        assert abs(np.mean(found)) < 0.3
        assert 0.8 < np.std(found) < 1.2


def test_repeats_show_the_noise_of_runs_without_rest():
    n = 700
    torque, course = 1 + 0.1 * np.sin(np.arange(n)), busy(n)
    noisy = [run_of(course + 2e-6 * rng.standard_normal((n, 3)), torque) for _ in range(2)]
    floor = noise_floor(noisy)
    assert floor.source == {"dR": "repeats"}
    assert floor.group("dR") == pytest.approx(2e-6, rel=0.05)


def test_quiet_stretches_serve_a_run_without_rest_and_busy_ones_do_not():
    n = 4096
    torque = 1 + 0.1 * np.sin(np.arange(n))
    noise = 2e-6 * rng.standard_normal((n, 3))
    bursts = np.where(np.sin(2e-3 * np.arange(n)) > 0.3, 1.0, 0.0)[:, None]
    floor = noise_floor([run_of(bursts * busy(n) + noise, torque)])
    assert floor.source == {"dR": "quiet stretches"}
    assert floor.group("dR") == pytest.approx(2e-6, rel=0.1)

    swelling = np.linspace(1, 12, n)[:, None] * 20
    floor = noise_floor([run_of(swelling * busy(n) + noise, torque)])
    assert floor.source == {"dR": "unknown"}
    assert not floor.known
    assert np.isnan(floor.group("dR"))


def without(run, column, how):
    """The run where a column is not in the file, or empty."""
    if how == "empty":
        run.channels[column][:] = np.nan
    else:
        del run.channels[column]
    return run


@pytest.mark.parametrize("how", ["absent", "empty"])
@pytest.mark.parametrize("source", ["rest", "repeats", "quiet stretches", "short rest"])
def test_a_column_that_was_not_measured_hides_no_noise_of_the_others(source, how):
    """The whole group was unknown, and the digits of its file were taken for the noise."""
    drawn = drawn_anew(f"lost column, {source}, {how}")
    column, n = drawn.choice(["dR_x", "dR_y", "dR_z"]), 4096
    late = {"rest": n // 2, "short rest": 200}.get(source, 0)
    torque = np.where(np.arange(n) >= late, 1 + 0.1 * np.sin(np.arange(n)), 0.0)
    moving = (np.arange(n) >= late) * np.linspace(20, 240, n)
    if source == "quiet stretches":
        moving = np.where(np.sin(2e-3 * np.arange(n)) > 0.3, 1.0, 0.0)
    course = moving[:, None] * busy(n)
    runs = [
        without(run_of(course + 2e-6 * drawn.standard_normal((n, 3)), torque), column, how)
        for _ in range(2 if source == "repeats" else 1)
    ]
    floor = noise_floor(runs)
    assert floor.source == {"dR": source}
    assert sorted(floor.sigma) == sorted({"dR_x", "dR_y", "dR_z"} - {column})
    assert floor.group("dR") == pytest.approx(2e-6, rel=0.25)


def test_what_every_measured_column_declares_is_declared():
    run = run_of(2e-6 * rng.standard_normal((900, 3)), noise={"dR_x": 3e-6, "dR_y": 4e-6})
    floor = noise_floor([without(run, "dR_z", "absent")])
    assert floor.source == {"dR": "declared"}
    assert floor.sigma == {"dR_x": 3e-6, "dR_y": 4e-6}


@pytest.mark.parametrize("case", ["case-04", "case-09", "case-11"])
def test_undeclared_noise_of_an_independent_program(case):
    truth = json.loads((RECORDINGS / case / "truth.json").read_text())["noise"]
    floor = noise_floor(read_case(RECORDINGS / case).runs)
    for group, sigma in truth.items():
        assert floor.group(group) == pytest.approx(sigma, rel=0.08), (case, group, floor.source)
