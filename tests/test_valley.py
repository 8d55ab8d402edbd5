"""A walk along calibrations that the runs do not tell apart."""

import dataclasses

import numpy as np
import pytest

from omnijax.diagnosis import Point, Prior, SmallModel, along
from omnijax.diagnosis._search.fit import refit
from omnijax.diagnosis._search.scan import Signatures, taken_up
from omnijax.diagnosis._search.starts import at_finite_strength
from omnijax.diagnosis._search.valley import along_valley, ends_of_valleys
from omnijax.laws import EFFECTS, ShaftSignal

IDS = ("bearing-coulomb", "load-friction", "friction-asymmetry")


def servo(mu, damping=0.1, emf=1.2):
    """J w' = T - d w - mu |T| sign w with the motor's T = u - e w: without mu only d + e shows."""
    laws, sets = {k: EFFECTS[k] for k in IDS}, {}
    t, rng = 0.01 * np.arange(1500), np.random.default_rng(0)
    for split in ("train", "held-out"):
        p = rng.uniform(0, 6, 3)
        w = 3 * np.sin(0.9 * t + p[0]) + 2 * np.sin(2.3 * t + p[1])
        rate, dry = np.gradient(w, 0.01), np.tanh(w / 0.05)
        # u of J w' + d w = T (1 - mu sign T sign w) with J = 0.5
        needed = 0.5 * rate + damping * w
        u = needed / (1 - mu * np.sign(needed) * dry) + emf * w
        sets[split] = w, rate, u + 0.01 * rng.normal(size=len(t))

    def residual(p, laws, split):
        w, rate, u = sets[split]
        torque = u - p["e"] * w
        hidden = sum(along(x, ShaftSignal(0 * w, w, torque, load=torque)) for x in laws)
        return (torque + hidden - p["J"] * rate - p["d"] * w) / 0.01

    names = ("J", "d", "e")
    model = SmallModel(residual, [Prior(k, 0.6, 0.6) for k in names], laws, "shaft")
    model.settings = dataclasses.replace(model.settings, both_anchors=True)
    return model


def promised(model, fit):
    """Cost by id that starts at finite strength promise, over that of the fit."""
    table = Signatures(c := model.candidates(fit.point), model.columns(fit.point, c))
    scan = table.scan(fit.residual, taken_up(fit.jacobian, 3), fit.point.u)
    starts = at_finite_strength(model, fit, scan.scores, set(model.laws))
    return {s.point.effects[-1].id: s.cost / fit.cost for s in starts}


def test_the_walk_keeps_what_the_runs_tell_and_reaches_the_bounds():
    model = servo(0.0)
    fit = refit(model, Point(np.zeros(3)))
    ends = ends_of_valleys(model, fit)
    assert sorted(p.u[2] for p in ends)[0] < -3.4 and sorted(p.u[1] for p in ends)[0] < -3.4
    points = [*along_valley(model, fit, ends[0].u - fit.point.u), *ends]
    sums = [sum(model.priors[k].at(p.u[k]) for k in (1, 2)) for p in points]
    np.testing.assert_allclose(sums, 1.3, atol=0.002)
    shares = [model.priors[2].at(p.u[2]) / s for p, s in zip(points, sums, strict=True)]
    assert min(shares) < 0.15 and max(shares) > 0.85
    for r in model.residuals(points, "train"):
        assert float(r @ r) == pytest.approx(fit.chi2, rel=0.01)


def test_there_is_no_walk_where_the_runs_tell_all_numbers():
    model = servo(0.0)
    told, model.priors = model.residual, model.priors[:2]
    model.residual = lambda p, laws, split: told(p | {"e": 1.2}, laws, split)
    assert ends_of_valleys(model, refit(model, Point(np.zeros(2)))) == []


def test_a_law_is_tried_where_its_valley_makes_it_what_it_is():
    model = servo(0.3)
    fit = refit(model, Point(np.zeros(3)))
    cost = promised(model, fit)  # of load friction 0.15 where the calibration ended
    assert cost["load-friction"] < 0.1
    assert cost["bearing-coulomb"] > 0.4
