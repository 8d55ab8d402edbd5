"""Every sensor law on a signal drawn anew, against a closed form; sampled ones at three rates."""

import jax.numpy as jnp
import numpy as np
import pytest
from formulas import sensor
from seeds import drawn_anew
from test_formulas import applied, made

from omnijax.laws._measurement import delayed, low_passed

STATIC = {  # law: (parameters at random, what it shows of y at t)
    "sensor-gain": (lambda r: {"g": r.uniform(-0.5, 0.5)}, lambda p, t, y: (1 + p["g"]) * y),
    "sensor-drift": (
        lambda r: {"a": r.normal(), "b": r.normal()},
        lambda p, t, y: y + p["a"] + p["b"] * t[:, None],
    ),
    "sensor-crosstalk": (
        lambda r: {f"X_{a}": r.normal() for a in ("xy", "xz", "yx", "yz", "zx", "zy")},
        lambda p, t, y: np.stack([
            y[:, 0] + p["X_xy"] * y[:, 1] + p["X_xz"] * y[:, 2],
            y[:, 1] + p["X_yx"] * y[:, 0] + p["X_yz"] * y[:, 2],
            y[:, 2] + p["X_zx"] * y[:, 0] + p["X_zy"] * y[:, 1],
        ], axis=1),
    ),
    "sensor-saturation": (
        lambda r: {"limit": r.uniform(0.2, 1)},
        lambda p, t, y: np.sign(y) * np.minimum(np.abs(y), p["limit"]),
    ),
    "sensor-rectified": (lambda r: {}, lambda p, t, y: np.sqrt(y**2)),
    "encoder-eccentricity": (
        lambda r: {"amplitude": r.uniform(0.1, 1), "phase": r.uniform(0, 6)},
        lambda p, t, y: y + p["amplitude"] * np.imag(
            np.exp(1j * (y + p["phase"])) - np.exp(1j * (y[:1] + p["phase"]))
        ),
    ),
}  # fmt: skip
LENGTH = 1.0  # s


class Signal:
    """Sums of three sines in three channels, and what delays and lags make of them."""

    def __init__(self, rng):
        self.a, self.w, self.phi = rng.uniform([[[0.3]], [[2.0]], [[0.0]]], [[[1]], [[25]], [[6]]],
                                               (3, 3, 3))  # fmt: skip

    def at(self, t):
        """Values (t, 3)."""
        return np.sum(self.a * np.sin(self.w * t[:, None, None] + self.phi), axis=1)

    def delayed(self, t, d):
        """The first value until d, the signal of d before from then on."""
        return self.at(np.maximum(t - d, 0.0))

    def lagged(self, t, tau):
        """Steady response of a first-order low pass, and the start's transient."""
        response = 1 / (1 + 1j * self.w * tau)
        wave = self.a * np.exp(1j * self.phi) * response
        steady = np.sum(np.imag(wave * np.exp(1j * self.w * t[:, None, None])), axis=1)
        return steady + np.exp(-t / tau)[:, None] * (self.at(t[:1]) - steady[:1])


@pytest.mark.parametrize("name", list(STATIC))
def test_a_law_of_one_sample_shows_its_closed_form(name):
    rng = drawn_anew(name)
    t, (draw, shown) = np.linspace(0, LENGTH, 101), STATIC[name]
    y, parameters = Signal(rng).at(t), draw(rng)
    port, signal = sensor(t, y)
    found = applied(made(name, parameters), port, signal).reshape(y.shape)
    np.testing.assert_allclose(y + found, shown(parameters, t, y), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("name", "key", "order"), [("sensor-delay", "delay", 3),
                                                    ("sensor-lag", "tau", 2)])  # fmt: skip
def test_a_law_between_samples_closes_in_by_its_order(name, key, order):
    """Cubic between samples, and linear: by an eighth and a quarter as the samples double."""
    rng = drawn_anew(name)
    whole, size = Signal(rng), (rng.integers(4, 20) + 1 / 3) / 400  # s, a third between samples
    errors = []
    for count in (400, 800, 1600):
        t = np.linspace(0, LENGTH, count + 1)
        y = whole.at(t)
        shown = y + applied(made(name, {key: size}), *sensor(t, y)).reshape(y.shape)
        expected = whole.delayed(t, size) if key == "delay" else whole.lagged(t, size)
        since = t > 2 * size  # the kink at the end of a delay is no cubic
        errors.append(np.sqrt(np.mean((shown - expected)[since] ** 2)))
    assert errors[2] < 1e-4 and errors[0] / errors[2] > 0.7 * 4**order, errors


def test_a_delay_reads_a_parabola_to_the_last_sample():
    """Where a signal ends, what comes behind it is not known; half its slope had been taken."""
    rng = drawn_anew("parabola")
    rate, share = rng.uniform(100, 1000), rng.uniform(0.1, 0.9)
    t = np.arange(40) / rate
    a, b, c = rng.normal(size=(3, 3)) * [[1.0], [rate], [rate**2]]
    late = share / rate  # between the last two
    values = a + b * t[:, None] + c * t[:, None] ** 2
    read = np.asarray(delayed(jnp.asarray(t), jnp.asarray(values), late))
    at = (t - late)[:, None]
    np.testing.assert_allclose(read[5:], (a + b * at + c * at**2)[5:], rtol=1e-9, atol=1e-9)


def test_a_delay_between_uneven_samples_is_that_between_even_ones():
    """Slopes were those of even steps: a straight line came out bent."""
    rng = drawn_anew("uneven delay")
    t = np.concatenate([[0.0], np.cumsum(rng.choice([0.002, 0.01, 0.02], 80))])
    delay, powers = rng.uniform(0.005, 0.03), rng.normal(size=(3, 2))
    behind = t >= t[1] + delay  # the first step begins flat, as before the run
    for count in (1, 2, 3):  # up to a parabola
        values = np.polynomial.polynomial.polyval(t, powers[:count]).T.reshape(len(t), -1)
        late = np.polynomial.polynomial.polyval(t - delay, powers[:count]).T.reshape(len(t), -1)
        np.testing.assert_allclose(
            delayed(jnp.asarray(t), jnp.asarray(values), delay)[behind], late[behind], atol=1e-12
        )


def test_two_samples_at_one_time_are_read():
    """A lag of them was not a number, from there on."""
    rng = drawn_anew("one time")
    t, y = jnp.asarray([0.0, 0.01, 0.01, 0.02, 0.03]), rng.normal(size=(5, 2))
    once = np.array([0, 2, 3, 4])
    lagged = np.asarray(low_passed(t, jnp.asarray(y), 0.02))
    assert np.isfinite(lagged).all() and np.isfinite(delayed(t, jnp.asarray(y), 0.004)).all()
    step, level = y.copy(), y[:1]
    step[:3] = level  # no jump at that time: as if it were one sample
    lagged = np.asarray(low_passed(t, jnp.asarray(step), 0.02))
    alone = np.asarray(low_passed(t[once], jnp.asarray(step[once]), 0.02))
    np.testing.assert_allclose(lagged[once], alone, rtol=1e-12)
