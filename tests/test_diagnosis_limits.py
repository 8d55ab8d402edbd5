"""Upper limits hold as often as they say."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binomtest, norm
from seeds import drawn_anew
from test_diagnosis_search import balance, law

from omnijax.diagnosis import SmallModel
from omnijax.diagnosis._answered import _excluded, _unexplained
from omnijax.diagnosis._search.candidates import Candidate
from omnijax.diagnosis._search.fit import refit
from omnijax.diagnosis._search.limits import both_signs, one_sign, upper_limits
from omnijax.diagnosis._search.model import Point
from omnijax.diagnosis._search.search import Search
from omnijax.laws import EFFECTS


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


@pytest.mark.parametrize("verdict, wider", [("unknown", 3.0), ("named", 1.0), ("none", 1.0)])
def test_beside_a_gap_that_nothing_explains_limits_are_wider(verdict, wider):
    """A delay of 1 ms lay above its limit of 0.34 ms where 40 a held-out row were left."""

    def at_w1(id):
        return SimpleNamespace(id=id, place="w1", indistinguishable_from=[])

    evidence = SimpleNamespace(model=SimpleNamespace(dof=lambda _: 1000))
    outcome = SimpleNamespace(
        held_after=9000.0, rivals={0: [(at_w1("actuator-lag"), 5.0, 1.0)]},
        fit=SimpleNamespace(point=SimpleNamespace(effects=(at_w1("actuator-delay"),))),
    )  # fmt: skip
    limits = [
        {"id": id, "place": "w1", "limit_95": x, "largest": 1.0}
        for id, x in (
            ("actuator-delay", 1e-5),
            ("actuator-lag", 1e-5),
            ("creep", 2e-4),
            ("motor-gain", 0.5),
            ("gap", None),
        )
    ]
    named = [at_w1("actuator-delay")] if verdict == "named" else []
    judged = SimpleNamespace(verdict=verdict)
    times = _unexplained(evidence, outcome, judged)  # pyright: ignore
    bounds = [{"id": f"bound-{x}", "place": "w1", "limit_95": 4.0, "share": x} for x in (0.2, 0.5)]
    told = {x["id"]: x["limit_95"] for x in _excluded([*limits, *bounds], outcome, named, times)}  # pyright: ignore
    assert told["bound-0.2"] == 4.0  # the lower the stronger: no wider one is excluded
    assert told["bound-0.5"] == (None if wider > 2 else 4.0)
    assert times == wider and told["creep"] == pytest.approx(wider * 2e-4)
    assert told["motor-gain"] == (None if wider > 2 else 0.5)  # no larger one than 1 is possible
    assert told["gap"] is None and "actuator-delay" not in told
    assert ("actuator-lag" in told) == (verdict == "named")


def test_the_limit_of_a_saturation_is_the_highest_bound_that_the_runs_exclude():
    """It was the share of a law at some bound, without a unit: who reads it learns nothing."""
    rng = drawn_anew("bounds")
    base = np.linalg.qr(rng.normal(size=(3000, 4)))[0].T
    noise, sizes = rng.normal(size=3000), {4.0: 1.0, 3.0: 9.0, 2.0: 30.0, 1.0: 60.0}

    def residual(values, laws, split):
        return noise - sum(sizes[float(x.limit)] * base[3] for x in laws)

    class Bounded(SmallModel):
        def candidates(self, point):
            laws = [self.laws["actuator-saturation"](np.asarray(b)) for b in sizes]
            return [
                Candidate(
                    "actuator-saturation",
                    "all",
                    (SimpleNamespace(law=law),),
                    lambda c, b=b: {"limit": b},
                )
                for b, law in zip(sizes, laws, strict=True)
            ]

        def columns(self, point, candidates):
            return np.stack([size * base[3] for size in sizes.values()])

    model = Bounded(residual, [], {"actuator-saturation": EFFECTS["actuator-saturation"]}, "all")
    fit = refit(model, Point(np.zeros(0)))
    (limit,) = upper_limits(model, fit, Search(model).scan(fit)[1], set())
    assert (limit["parameter"], limit["unit"], limit["limit_95"]) == ("limit", "N m", 3.0)


@pytest.mark.parametrize("size", [1e-22, 0.1, 1e3])
@pytest.mark.parametrize("id, key", [("creep", "creepage"), ("sensor-gain", "g")])
def test_no_limit_is_told_above_the_largest_size_that_an_effect_may_have(size, id, key):
    """Of a creep of which nothing is seen the runs excluded more than 1.6e22: that was rounding."""
    rng = drawn_anew("largest")
    shape = np.linalg.qr(rng.normal(size=(1000, 1)))[0].T
    noise = rng.normal(size=1000)
    share = EFFECTS[id]

    class Sharing(SmallModel):
        def candidates(self, point):
            unit = SimpleNamespace(law=share(np.asarray(1.0)))
            return [Candidate(id, "w1", (unit,), lambda c: {key: c[0]})]

        def columns(self, point, candidates):
            return size * shape

    def residual(values, laws, split):
        return noise - size * sum(float(getattr(x, key)) for x in laws) * shape[0]

    model = Sharing(residual, [], {id: share}, "w1")
    fit = refit(model, Point(np.zeros(0)))
    (limit,) = upper_limits(model, fit, Search(model).scan(fit)[1], set())
    assert limit["parameter"] == key
    assert (limit["limit_95"] is None) == (size < 1)
    if size > 1:
        assert limit["limit_95"] < 1
