"""Upper limits hold as often as they say."""

import numpy as np
import pytest
from scipy.stats import binomtest, norm
from test_diagnosis_search import balance, law

from omnijax.diagnosis._search.fit import refit
from omnijax.diagnosis._search.limits import both_signs, one_sign, upper_limits
from omnijax.diagnosis._search.model import Point
from omnijax.diagnosis._search.search import Search


def test_limits_of_a_known_strength_are_those_of_the_normal_law():
    assert one_sign(6.0, 1.0) == pytest.approx(6 + norm.isf(0.05), abs=1e-3)
    assert both_signs(-6.0, 2.0) == pytest.approx(6 + 2 * norm.isf(0.05), abs=1e-3)
    assert one_sign(-5.0, 1.0) == one_sign(0.0, 1.0)  # far below zero excludes no more than zero


@pytest.mark.parametrize("limit", [one_sign, both_signs])
def test_limits_cover_what_they_say(limit):
    rng = np.random.default_rng(1)
    true = rng.uniform(2, 6, 3000)
    sign = 1.0 if limit is one_sign else rng.choice([-1.0, 1.0], 3000)
    seen = sign * true + rng.normal(size=3000)
    held = [t < limit(float(c), 1.0) for t, c in zip(true, seen, strict=True)]
    assert binomtest(sum(held), 3000, 0.95).pvalue > 0.01


def test_a_planted_effect_lies_below_its_limit_as_often_as_said():
    """Sizes too small to be named, the machine calibrated beside them."""
    rng, held = np.random.default_rng(2), []
    for seed in range(40):
        true = rng.uniform(0, 2e-3)
        model = balance([law("bearing-coulomb", true)], seed=seed)
        fit = refit(model, Point(np.zeros(2)))
        _, signatures = Search(model).scan(fit)
        limits = {x["id"]: x for x in upper_limits(model, fit, signatures, set())}
        held.append(true < limits["bearing-coulomb"]["limit_95"])
        assert limits["bearing-coulomb"]["unit"] == "N m"
    assert binomtest(sum(held), len(held), 0.95).pvalue > 0.01
