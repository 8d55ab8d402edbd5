"""Whether an effect is as strong at all times and in all runs, asked of all runs at once."""

import numpy as np
import pytest
from scipy.signal import lfilter

from omnijax.diagnosis._search import AbstractModel, Effect, Point, Prior, refit, unsteady
from omnijax.laws import EFFECTS

ALIKE = 0.05
T = np.arange(0, 8, 0.01)  # s
RUNS = {"train": [0, 1], "held-out": [2]}


class Gained(AbstractModel):
    """Three runs of one channel: a calibrated number times one motion, a gain times another.

    `course` (3, samples) is how the true gain of 1 runs in each of them.
    """

    def __init__(self, course, noise, colour=0.0, seed=0):
        rng = np.random.default_rng([5, seed])
        self.priors, self.laws = [Prior("stiffness", 1.0, 0.1)], EFFECTS
        phase = rng.uniform(0, 6, (3, 1))
        self.change = np.sin(2.1 * T + phase) + 0.4 * np.sin(5.3 * T + phase**2)
        self.base = np.cos(3.0 * T + phase)
        white = rng.normal(size=(3, len(T)))
        self.noise = noise
        self.left = course * self.change + noise * lfilter([1.0], [1.0, -colour], white)

    def residuals(self, points, split):
        out = []
        for p in points:
            g = sum(float(e.values["g"]) for e in p.effects)
            u = self.priors[0].at(float(p.u[0])) - 1.0
            left = self.left - u * self.base - g * self.change
            out.append(left[RUNS[split]].ravel() / self.noise)
        return out

    def moments(self, split):
        return np.repeat(RUNS[split], len(T)), np.tile(T, len(RUNS[split]))

    def dof(self, split):
        return len(RUNS[split]) * len(T)

    def candidates(self, point):
        return []

    def columns(self, point, candidates):
        return np.zeros((0, self.dof("train")))


def found(course, noise, **how):
    """What of the gain is said not to be steady, once it is fitted to the train runs."""
    model = Gained(np.broadcast_to(course, (3, len(T))), noise, **how)
    fit = refit(model, Point(np.zeros(1), (Effect("motor-gain", "w1", {"g": 0.9}),)))
    return unsteady(model, fit, ALIKE)


def test_a_gain_that_falls_as_a_motor_warms_is_told():
    warm = 1 - np.exp(-T / 3)
    (one,) = found(warm, noise=1.2)
    assert one.name == "motor-gain@w1" and one.chance < 1e-6
    assert 0.2 < one.share < 0.5  # of a gain that runs from 0 to 0.93


def test_a_gain_that_is_another_one_in_each_run_is_told():
    (one,) = found(np.array([[1.0], [1.2], [0.9]]), noise=0.4)
    assert one.share == pytest.approx(np.std([1.0, 1.2, 0.9]) / 1.03, rel=0.3)


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_a_steady_gain_is_steady_in_noise_of_any_colour(colour):
    assert not any(found(1.0, noise=1.0, colour=colour, seed=k) for k in range(20))


def test_what_is_sure_but_within_what_a_prediction_may_be_off_is_steady():
    assert found(1 + 0.04 * (T - 4) / 4, noise=0.01) == []
    assert len(found(1 + 0.4 * (T - 4) / 4, noise=0.01)) == 1
