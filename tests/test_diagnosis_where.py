"""Localisation: planted lines are found where they are, and the null gives uniform p-values."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import kstest
from seeds import drawn_anew

from omnijax.diagnosis._answer.shown import _beside
from omnijax.diagnosis._machine._where.left_motion import accelerating, rolled
from omnijax.diagnosis._machine._where.locate import changing
from omnijax.diagnosis._search import where
from omnijax.diagnosis._search.levels import Level
from omnijax.diagnosis._search.readings import in_all_runs, on_reading
from omnijax.diagnosis._search.where import (
    Asked,
    above_neighbours,
    bins,
    discovered,
    discoveries,
    p_value,
    questions,
    shares,
    shuffle,
    state,
)

N, STEP = 3000, 2e-3
TIME = STEP * np.arange(N)


def sweep(rate=1.2):
    """A wheel that speeds up steadily: rad."""
    return 2.0 * TIME + rate * TIME**2


def strongest(residual, angles, domains=("order", "frequency")):
    answers = shares(residual, questions(TIME, angles, {}))
    kept = [a for a in answers if a["domain"] in domains]
    return max(kept, key=lambda a: a["share"])


def test_a_line_in_orders_is_found_at_its_wheel():
    rng = np.random.default_rng(1)
    angles = {"w1": sweep(), "w2": 0.7 * sweep(2.0)}
    residual = 1.5 * np.cos(7 * angles["w2"] + 0.3) + rng.normal(size=N)
    found = strongest(residual, angles)
    assert (found["domain"], found["value"], found["reference"]) == ("order", 7.0, "w2")


def test_a_line_that_stays_put_in_hertz_is_found_in_hertz():
    rng = np.random.default_rng(2)
    residual = 1.5 * np.cos(2 * np.pi * 13.7 * TIME) + rng.normal(size=N)
    found = strongest(residual, {"w1": sweep()})
    assert found["domain"] == "frequency"
    assert found["value"] == pytest.approx(13.7, abs=0.5)


@pytest.mark.parametrize("frequency", [97.3, 180.0, 243.7])
def test_lines_are_found_up_to_half_the_sampling_rate(frequency):
    rng = np.random.default_rng(12)
    residual = 0.5 * np.cos(2 * np.pi * frequency * TIME) + rng.normal(size=N)
    found = strongest(residual, {"w1": sweep()})
    assert found["domain"] == "frequency"
    assert found["value"] == pytest.approx(frequency, abs=0.5)


def test_bands_share_all_power_of_noise_between_them():
    asked = [q for q in questions(TIME, {}, {}) if q.domain == "frequency"]
    noise = np.random.default_rng(13).normal(size=N)
    total = sum(a["share"] for a in shares(noise, asked))
    assert total == pytest.approx(1.0, abs=0.01)  # but the mean and the last, odd line


def test_an_order_beyond_half_the_sampling_rate_is_not_folded():
    rng = np.random.default_rng(3)
    angle = (
        40.0 * TIME + 12.0 * TIME**2
    )  # order 39 passes 250 Hz at the start and 1100 Hz at the end
    assert 39 * (40 + 24 * TIME[-1]) / (2 * np.pi) > 1 / STEP
    residual = np.cos(39 * angle) + rng.normal(size=N)
    found = strongest(residual, {"w1": angle})
    assert (found["domain"], found["value"]) == ("order", 39.0)


def test_p_values_of_white_noise_are_uniform():
    rng = np.random.default_rng(4)
    angle = sweep()
    basis = np.linalg.qr(np.c_[np.cos(5 * angle), np.sin(5 * angle)])[0]
    found = []
    for k in range(120):
        residual = rng.normal(size=N)
        power = residual @ residual
        null = np.sum((basis.T @ shuffle(residual, k)) ** 2, axis=0) / power
        found.append(p_value(np.sum((basis.T @ residual) ** 2) / power, null))
    assert kstest(found, "uniform").pvalue > 0.01
    assert np.mean(np.array(found) < 0.05) < 0.15


def test_noise_alone_gives_no_discoveries_and_a_line_does():
    rng = np.random.default_rng(5)
    angles = {"w1": sweep()}
    asked = questions(TIME, angles, {"speed w1": np.gradient(angles["w1"], STEP)})
    for seed in range(8):  # 550 questions each, at a rate of 1 % of all that is reported
        assert discoveries(shares(rng.normal(size=N), asked, seed)) == []
    noise = rng.normal(size=N)
    assert discoveries(shares(noise + np.cos(3 * angles["w1"]), asked))[0]["value"] == 3.0


def test_a_band_over_its_neighbours_is_an_f_law_in_noise_of_any_smooth_colour():
    rng = drawn_anew("bands")
    asked = Asked(questions(TIME, {}, {}))
    middle = np.array([q.value for q in asked.bands])
    lines = np.array([q.size / 2 for q in asked.bands])
    white = rng.normal(size=(N, 8))
    for noise in (white, white + lfilter([0.8], [1, -0.9], rng.normal(size=(N, 8)), axis=0)):
        powers = asked.lines(noise)
        p = [above_neighbours(middle, x, lines)[20:-20:5] for x in powers.T]  # apart: independent
        assert kstest(np.ravel(p), "uniform").pvalue > 1e-4
        powers[60] = 40 * powers[55:66].mean(axis=0)  # a line
        assert all(above_neighbours(middle, x, lines)[60] < 1e-12 for x in powers.T)


def test_a_number_that_fades_over_a_run_is_found_and_one_that_is_off_is_not():
    rng = drawn_anew("fading")
    stiff, soft = np.cos(9 * sweep()), np.cos(7 * sweep(2.0))
    asked = changing({"contact.stiffness": np.c_[stiff, soft], "effect": np.ones((N, 1))})
    noise = rng.normal(size=N)
    assert discoveries(shares(noise + 0.2 * stiff, (), own=asked)) == []
    fading = shares(noise + 0.5 * (2 * TIME / TIME[-1] - 1) * soft, (), own=asked)
    best = discoveries(fading)[0]
    assert (best["domain"], best["reference"]) == ("change", "contact.stiffness")


def test_noise_of_the_angles_that_enters_the_tangents_is_no_change_of_a_number():
    """Measured angles enter the prediction, and what is left in theta is their noise."""
    rng = drawn_anew("noisy tangents")
    smooth, noise = 40 * np.cos(9 * sweep()), rng.normal(size=N)
    ramp = 2 * TIME / TIME[-1] - 1
    tangents = {"inertia": smooth[:, None], "radius": (ramp * smooth + noise)[:, None]}
    least = 3 * float(np.linalg.norm(noise))
    best = discoveries(shares(noise, (), own=changing(tangents)))[0]
    assert best["share"] > 0.5  # it is the noise itself
    assert discoveries(shares(noise, (), own=changing(tangents, least))) == []
    fading = shares(noise + 0.02 * ramp**2 * smooth, (), own=changing(tangents, least))
    assert discoveries(fading)[0]["reference"] == "radius"


def test_a_motion_shows_in_both_of_its_sensors_and_their_noise_does_not():
    """Coloured noises that are each other's like in power, and a hidden resonance beside them."""
    rng = np.random.default_rng(31)
    ringing = np.asarray(lfilter([1.0], [1, -1.9, 0.98], rng.normal(size=N)))  # of no state
    away = ringing / ringing.std()
    pull = np.gradient(np.gradient(away, STEP), STEP)
    noises = [lfilter([1.0], [1, -1.9, 0.98], rng.normal(size=(2, N)), axis=1) for _ in range(6)]
    for displacement, felt in noises:
        own = accelerating("dR_x", displacement + rng.normal(size=N), STEP)
        (answer,) = shares(felt + rng.normal(size=N), (), own=own)
        assert answer["p"] > 1e-3
    own = accelerating("dR_x", away + rng.normal(size=N), STEP)
    (best,) = discoveries(shares(pull / pull.std() + rng.normal(size=N), (), own=own))
    assert (best["domain"], best["reference"]) == ("motion", "dR_x")
    assert best["share"] > 0.3  # a half is noise


def test_what_hangs_on_a_reading_is_asked_of_its_channel_alone():
    rng = drawn_anew("reading")
    read = np.cos(9 * sweep())
    columns = {"dR_x": rng.normal(size=N) - 0.6 * read**3, "dR_y": rng.normal(size=N)}
    own = {c: [state(f"reading {c}", bins(read))] for c in columns}
    _, answers = discovered(TIME, columns, {}, {}, own=own)
    asked = {a["channel"]: a["stands"] for a in answers if a["domain"] == "reading"}
    assert asked == {"dR_x": True, "dR_y": False}


def test_where_nothing_stands_the_channels_that_are_missed_most_are_shown(monkeypatch):
    """A smooth miss of 50 sigma looks like noise of its colour: that all is well was said of it."""
    monkeypatch.setattr(where, "discoveries", lambda answers: [])
    rng = drawn_anew("nothing stands")
    columns = {f"a_{c}": rng.normal(size=N) for c in "xyz"}
    columns |= {"theta_1": 50 * np.cumsum(rng.normal(size=N)) / np.sqrt(N)}
    columns |= {"Omega_x": 1e-12 * rng.normal(size=N)}  # nobody measured it
    shown, answers = discovered(TIME, columns, {"w1": sweep()}, {})
    assert {a["channel"] for a in shown} == {"theta_1"} and len(shown) == 3
    assert {a["channel"] for a in answers} == {*columns} - {"Omega_x"}


def test_where_a_residual_begins_and_ends_says_nothing_of_what_it_hangs_on():
    """The line that takes its ends away leaves a mean, which lies in the bins of every state."""
    rng = np.random.default_rng(173)
    reading = np.cos(9 * sweep())
    asked = [state("reading dR_x", bins(reading)), state("position w1", bins(sweep()))]
    for offset in (0.0, 0.4):  # of the samples at the ends
        left = 0.4 * reading**3 + rng.normal(size=N)
        left[:50] += offset
        left[-50:] += offset
        assert shares(left, (), own=asked)[0]["p"] < 1e-9
    walks = np.cumsum(rng.normal(size=(30, N)), axis=1)
    p = np.array([[a["p"] for a in shares(x, (), own=asked)] for x in walks])
    assert np.all(np.median(p, axis=0) > 0.2)
    assert np.mean(p < 0.05) < 0.2


@pytest.mark.parametrize("phase", [0.4, 1.9, 3.5, 5.0])
def test_a_wave_of_few_turns_is_its_wheels_though_its_ends_are_taken_away(phase):
    """What a residual loses with its level is lost to the wave that is asked for too.

    Else p of its order was 1e-6 to 4e-8.
    """
    rng = np.random.default_rng(7)
    angle = sweep()  # nine turns
    left = 4 * np.cos(angle + phase) + rng.normal(size=N)
    answers = shares(left, questions(TIME, {"w2": angle}, {"phase w2": np.mod(angle, 2 * np.pi)}))
    own = {a["domain"]: a for a in answers if a["domain"] == "phase" or a["value"] == 1.0}
    assert own["order"]["share"] > 0.85
    assert own["order"]["p"] < 1e-9
    assert own["phase"]["p"] < 1e-13


def slow(rng, count):
    """A motion below 4 Hz of RMS 1, at 250 Hz."""
    frequency = np.fft.rfftfreq(count, 4e-3)
    size = np.where((frequency > 0.3) & (frequency < 4), 1 / np.maximum(frequency, 0.3), 0.0)
    out = np.fft.irfft(size * np.exp(2j * np.pi * rng.random(len(frequency))), count)
    return out / out.std()


def wandering(rng, count, memory):
    """Noise of RMS 1.8 that remembers, beside some that does not."""
    out = np.asarray(lfilter([1.0], [1, -memory], rng.normal(size=count)))
    return 1.8 * out / out.std() + 0.3 * rng.normal(size=count)


def bent(x):
    """What a straight line leaves of a sensor's soft limit, RMS 2.5."""
    out = np.tanh(0.7 * x) - np.polyval(np.polyfit(x, np.tanh(0.7 * x), 1), x)
    return 2.5 * out / out.std()


@pytest.mark.parametrize("memory", [0.0, 0.5])
def test_a_function_of_the_reading_stands_beside_noise_of_its_colour(memory):
    """By its steps at the samples of one run it did not: both are slow."""
    rng = np.random.default_rng(170)
    for _ in range(3):
        read = [slow(rng, 750) for _ in range(2)]
        left = [bent(x) + wandering(rng, 750, memory) for x in read]
        answer = on_reading("dR_x", left, read)
        assert answer is not None
        assert (answer["domain"], answer["reference"]) == ("reading", "dR_x")
        assert answer["p"] < 1e-6
        truth = np.mean(np.square([bent(x) for x in read])) / np.var(left)
        assert answer["share"] == pytest.approx(truth, abs=0.2)  # beside what was weighed as noise


@pytest.mark.parametrize("memory", [0.5, 0.97])
def test_noise_of_any_colour_is_no_function_of_the_reading(memory):
    rng = np.random.default_rng(171)
    p = []
    for k in range(16):
        read = [slow(rng, 750) for _ in range(2)]
        answer = on_reading("dR_x", [wandering(rng, 750, memory) for _ in read], read, k)
        assert answer is not None
        p.append(answer["p"])
    assert min(p) > 1e-3
    assert np.median(p) > 0.2


def test_a_channel_that_is_not_there_is_asked_nothing():
    rng = np.random.default_rng(172)
    read, missing = [slow(rng, 750)], [np.full(750, np.nan)]
    assert on_reading("dR_x", missing, read) is None
    assert on_reading("dR_x", [rng.normal(size=750)], [np.ones(750)]) is None


def test_what_a_discovery_leaves_is_the_most_that_noise_can_be():
    """Weighed by a spectrum that holds the discovery, a channel looks as loud as white noise."""
    level = Level(1.0, 0.02, 1.0)
    assert _beside(level, 0.6).ratio == 0.6
    assert _beside(level, 0.97) is level  # within what it is known to
    assert _beside(level, np.inf) is level


def test_a_motion_that_wheels_and_the_sphere_show_is_no_noise():
    """A torque that is missed leaves both slow; each alone looks like noise that wanders."""
    rng = np.random.default_rng(174)
    axis, windows = np.array([[0.6, 0.0, 0.8]]), [slice(k, k + 250) for k in (0, 250, 500)]
    answers = []
    for truth in (1.0, 0.0):
        lengths, shapes = [], []
        for _ in range(3):
            turning, other = (0.02 * slow(rng, 750)[:, None] for _ in range(2))
            speed = axis * turning + 0.01 * rng.normal(size=(750, 3))
            moved = rolled(axis * (truth * turning + (1 - truth) * other), axis, STEP, windows)
            lengths.append(moved[:, 0] + 3e-5 * rng.normal(size=750))
            shapes.append(rolled(speed, axis, STEP, windows))
        answers.append(in_all_runs("motion Omega", lengths, shapes))
    real, chance = answers
    assert real is not None and chance is not None
    assert (real["domain"], real["reference"]) == ("motion", "Omega")
    assert real["p"] < 1e-6 and real["share"] > 0.7
    assert chance["p"] > 1e-3
