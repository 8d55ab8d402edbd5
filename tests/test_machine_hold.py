"""Held or linear: how an input is read between its samples, told from the log alone."""

import numpy as np
import pytest

from omnijax.machine import LogSignals, acting, input_hold
from tests.seeds import drawn_anew


def moved(rng, hold, late=0.0):
    """An exactly integrated motor with viscous and dry friction, 40 steps a sample."""
    rate, fine = np.exp(rng.uniform(np.log(150), np.log(800))), 40
    step, count = 1 / rate, round(6 * rate)
    time = np.arange(count * fine) / rate / fine
    f, p = rng.uniform(0.2, 2.0, 5), rng.uniform(0, 6, 5)
    u = np.sin(2 * np.pi * np.arange(count)[:, None] * step * f + p).sum(axis=1)
    at = time - late
    early = np.clip(np.floor(at / step + 1e-9).astype(int), 0, count - 1)
    given = u[early] if hold == "held" else np.interp(at, np.arange(count) * step, u)
    q, v, out, h = 0.0, 0.0, [], step / fine
    for k, force in enumerate(given):
        if k % fine == 0:
            out.append(q)
        a = 20 * force - v - 6 * np.tanh(v / 0.05)
        v, q = v + h * a, q + h * v + h * h / 2 * a
    noise = 1e-6 * rng.normal(size=count)
    return LogSignals(np.array(out) + noise, u, step, {})


@pytest.mark.parametrize("hold", ["linear", "held"])
def test_the_log_shows_whether_its_input_was_held(hold):
    told = input_hold([moved(drawn_anew(hold), hold)], turns=True)
    assert told.hold == hold and hold in told.sentence, told


def test_a_long_delay_is_no_hold():
    log = moved(drawn_anew("late"), "linear", 0.02)
    told = input_hold([log], turns=False)
    assert told.late * log.step / 2 == pytest.approx(0.02, rel=0.2) and not told.sure, told


@pytest.mark.parametrize("hold", ["linear", "held"])
def test_what_acts_is_the_course_between_the_samples_to_fourth_order(hold):
    x = np.arange(400) * drawn_anew(hold).uniform(0.1, 0.2)  # rad of a sine a sample
    step, inner = x[1], slice(3, -3)
    late, size = (step / 2, np.sinc(step / 2 / np.pi)) if hold == "held" else (
        0.0, np.sinc(step / 2 / np.pi) ** 2)  # fmt: skip
    np.testing.assert_allclose(
        acting(np.sin(x), hold)[inner], size * np.sin(x - late)[inner], atol=step**4 / 50
    )
