"""An encoder off its centre is asked for where an axis shows its wave, at a size it may have."""

from types import SimpleNamespace

import numpy as np
import pytest

from omnijax.diagnosis._ode._candidates.ranges import ranges_of
from omnijax.diagnosis._ode.build import _places, turns_round
from omnijax.diagnosis._search import Effect, Point
from omnijax.laws import AXIS_EFFECTS, EFFECTS
from omnijax.machine import Axis

ID = "encoder-eccentricity"


@pytest.mark.parametrize(
    "motion, train, held_out, asked",
    [("rotation", 0.25, 0.25, False),  # metres of a screw that nobody said to be such
     ("rotation", 3.0, 7.0, False), ("rotation", 3.3, 0.1, True), ("translation", 9.0, 9.0, False)],
)  # fmt: skip
def test_an_encoders_wave_is_asked_for_where_half_of_it_shows(motion, train, held_out, asked):
    """One of 0.99 rad was named in a log that moves by 0.25; free runs were 13 times worse."""
    wave = np.sin(np.linspace(0, 9, 200)) / 2
    runs = [SimpleNamespace(role="train", shown=1 + train * wave),
            SimpleNamespace(role="held-out", shown=held_out * wave)]  # fmt: skip
    axis = Axis(np.array(1.0), motion=motion)  # pyright: ignore[reportArgumentType]
    assert turns_round(axis, runs) is asked  # pyright: ignore[reportArgumentType]
    for criterion in ("balance", "free-run"):
        places = _places(axis, AXIS_EFFECTS, criterion, {}, "position", asked)
        assert ((ID, "position") in places) is asked


def test_an_encoders_wave_changes_its_slope_by_half_at_most():
    effect = Effect(ID, "position", {"amplitude": 0.01, "phase": 0.3})
    model = SimpleNamespace(laws=EFFECTS, frozen_keys=frozenset())
    scales = SimpleNamespace(speed=1.0, torques=[1.0])
    free = ranges_of(model, Point(np.zeros(0), [effect]), scales, 1.0)  # pyright: ignore[reportArgumentType]
    amplitude, phase = free
    assert (amplitude.low, amplitude.high) == (-0.5, 0.5) and phase.high == np.inf
