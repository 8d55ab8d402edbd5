"""The result of a diagnosis in a notebook: words, tables, pictures, a dataset."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from seeds import drawn_anew

from omnijax import InputError
from omnijax.diagnosis import Diagnosis, Effect, Named, OutputGap, Point
from omnijax.diagnosis._answer.answer import (
    _sigma,
    answering,
    baseline_table,
    score_table,
    together,
    with_unit_directions,
)
from omnijax.diagnosis._answer.named_effect import alternatives
from omnijax.laws import EFFECTS


@pytest.fixture
def found():
    sizes = {
        "amplitude": {"value": 5e-5, "sigma": 1e-7, "unit": "m"},
        "axis": {"value": [1.0, 0.0], "sigma": None, "unit": "1"},
    }
    effect = Named("wheel-runout", "w<2>", sizes, {})
    where = [{"channel": "dR_y", "domain": "order", "value": 1.0, "reference": "w2", "share": 0.9,
              "p": 1e-9, "rms_over_noise": 5.0, "stands": True},
             {"channel": "dR_y", "domain": "phase", "value": float("nan"), "reference": "w2",
              "share": 0.2, "p": 0.4, "rms_over_noise": 5.0, "stands": False}]  # fmt: skip
    gap = {"dR": OutputGap(2e-6, 1e-5, 2e-6, "m"), "a": OutputGap(5e-3, 5e-3, 5e-3, "m/s^2")}
    baseline = [{"parameter": "wheel.w1.contact.stiffness", "stated": 1e5, "without_effects": 1.1e5,
                 "with_effects": 1.05e5, "relative_sigma": 1e-3}]  # fmt: skip
    scores = [{"step": 1, "id": "wheel-runout", "place": "w2", "gain": 1e4, "p": 0.0},
              {"step": 1, "id": "creep", "place": "w2", "gain": 0.0, "p": 1.0}]  # fmt: skip
    return Diagnosis("named", [effect], where, gap, None, baseline, {}, scores)


def test_the_words_give_answer_and_gap(found):
    assert repr(found) == (
        "Diagnosis(named: wheel-runout@w<2>; gap over noise dR 5 -> 1, a 1 -> 1)"
    )
    found.verdict, found.effects = "none", []
    assert repr(found).startswith("Diagnosis(none; gap")


def test_what_a_named_effect_leaves_is_said(found):
    assert found.remainder == ""
    found.gap["theta"] = OutputGap(
        1e-4, 5e-2, 1.1e-3, "rad"
    )  # nearly all closed, yet far from noise
    assert "still differ by more than the noise (theta 11 times)" in found.remainder
    assert found.to_dict()["notes"][-1] == found.remainder
    found.verdict = "unknown"  # says as much itself
    assert found.remainder == ""


def test_a_diagnosis_comes_back_from_its_file(found, tmp_path):
    found.gap["theta"] = OutputGap(1e-4, 5e-2, float("nan"), "rad")
    found.notes, found.confirmed_on = ["one", "two"], "blocks"
    file = found.save(tmp_path / "diagnosis.json")
    again = Diagnosis.load(file)
    assert again.to_dict() == found.to_dict() and again.notes == found.notes
    assert repr(again) == repr(found) and again._repr_html_() == found._repr_html_()
    assert "kept out of the fit" in again._repr_html_()
    assert again.to_xarray().identical(found.to_xarray())
    again.plot_gap(), again.plot_where(), again.plot_scores()
    for text in ("{}", "[]", "no JSON", '{"verdict": "none", "effects": [{"id": 1}], "gap": {}}'):
        file.write_text(text)
        with pytest.raises(InputError, match="holds no diagnosis"):
            Diagnosis.load(file)


def test_the_table_shows_effects_and_escapes_names(found):
    html = found._repr_html_()
    assert "w&lt;2&gt;" in html and "w<2>" not in html
    assert "5e-05" in html and "before" in html


def test_pictures_show_every_group_candidate_and_place(found):
    gap = found.plot_gap()
    assert [t.get_text() for t in gap.get_xticklabels()] == ["dR", "a"]
    heights = [bar.get_height() for bar in gap.patches]
    np.testing.assert_allclose(heights, [5.0, 1.0, 1.0, 1.0])
    scores = found.plot_scores()
    assert [t.get_text() for t in scores.get_yticklabels()] == ["creep at w2", "wheel-runout at w2"]
    with pytest.raises(ValueError, match="`step` must be one of"):
        found.plot_scores(step=2)
    places = [t.get_text() for t in found.plot_where().get_yticklabels()]
    assert places == ["2  dR_y, phase of w2", "1  dR_y, order 1 of w2"]


def test_the_dataset_holds_gap_parameters_and_scores(found):
    data = found.to_xarray()
    assert data.attrs == {"verdict": "named", "effects": "wheel-runout@w<2>"}
    assert float(data.gap_before.sel(group="dR")) == 1e-5
    assert float(data.parameter_with_effects[0]) == 1.05e5
    assert float(data.score_gain.sel(candidate="wheel-runout@w2")) == 1e4


def test_calibrated_numbers_are_those_of_the_rig_that_is_the_answer():
    """Of a fit with effects that no answer names a refit had moved them."""
    prior = SimpleNamespace(
        name="sphere.mass", unit="kg", value=5.0, sigma=0.1, relative=True,
        at=lambda u: 5.0 * np.exp(0.1 * u), at_bound=lambda u: u > 3,
    )  # fmt: skip

    def fit(u, variance):
        return SimpleNamespace(point=SimpleNamespace(u=np.array([u])),
                               scaled_covariance=lambda dof: np.array([[variance]]))  # fmt: skip

    outcome: Any = SimpleNamespace(priors=(prior,), baseline=fit(0.2, 0.8), fit=fit(4.0, 0.01))
    for verdict, of in (
        ("none", outcome.baseline), ("unknown", outcome.baseline),
        ("named", outcome.fit), ("ambiguous", outcome.fit),
    ):  # fmt: skip
        judged: Any = SimpleNamespace(verdict=verdict)
        assert answering(outcome, judged) is of
        (row,) = baseline_table(outcome, answering(outcome, judged), 100)
        assert row["with_effects"] == prior.at(of.point.u[0])
        assert row["without_effects"] == prior.at(0.2)
        assert row["at_bound"] == (of is outcome.fit)
        assert not row["determined"]  # by what was stated, or at an end of its range
    within: Any = fit(2.0, 0.01)
    (row,) = baseline_table(outcome, within, 100)
    assert row["determined"] and not row["at_bound"] and row["sigma"] > 0


def test_lines_at_one_wheel_are_one_effect():
    def line(place, size, order):
        values = {"amplitude": (size, "N m"), "order": (order, "1"), "phase": (0.3, "rad")}
        parameters = {k: {"value": v, "sigma": 0.01 * v, "unit": u} for k, (v, u) in values.items()}
        return Named("motor-ripple", place, parameters, {"held_out_chi2": 1e3 * size})

    alone, *two = line("w1", 0.01, 7.0), line("w2", 0.01, 5.0), line("w2", 0.03, 8.3)
    single, joined = together([two[0], alone, two[1]])
    assert single is alone
    assert (joined.id, joined.place) == ("cogging", "w2")
    assert joined.parameters["amplitudes"]["value"] == [0.03, 0.01]
    assert joined.parameters["orders"]["value"] == [8.3, 5.0]
    assert joined.parameters["orders"]["sigma"] == pytest.approx([0.083, 0.05])
    assert joined.evidence["held_out_chi2"] == 10.0
    assert set(EFFECTS["cogging"].parameters) == set(joined.parameters)


def test_a_direction_is_as_sure_as_what_turns_it():
    """Its length says nothing, however little is known of it."""
    rng = np.random.default_rng(3)
    value = rng.normal(size=3)
    unit = value / np.linalg.norm(value)
    turn = np.linalg.qr(np.stack([unit, *rng.normal(size=(2, 3))], axis=1))[0]
    covariance = (turn * [1e8, 0.02**2, 0.03**2]) @ turn.T  # along it, and across
    parameter = EFFECTS["floor-vibration"].parameters["direction"]
    sigma = _sigma(parameter, unit, covariance)
    assert np.linalg.norm(sigma) == pytest.approx(np.hypot(0.02, 0.03), rel=1e-6)
    offset = EFFECTS["unbalance"].parameters["offset"]  # a length, not a direction
    np.testing.assert_allclose(_sigma(offset, unit, covariance), np.sqrt(np.diag(covariance)))


@pytest.mark.parametrize(("id", "key"), [("sphere-out-of-round", "axis"),
                                         ("floor-vibration", "direction")])  # fmt: skip
def test_directions_are_told_with_length_one(id, key):
    """A fit leaves the length free: a sphere's axis was told as (-2.436, 0, -3.253)."""
    rng = drawn_anew(f"length of {id}")
    law, axis = EFFECTS[id], rng.normal(size=3)
    place = {"sphere-out-of-round": "sphere"}.get(id, "platform")
    length = rng.uniform(0.01, 90)
    values = {k: 1e-5 if p.linear else 3.0 for k, p in law.parameters.items()} | {
        key: length * axis
    }
    point = Point(np.zeros(0), (Effect(id, place, values),))
    (effect,) = with_unit_directions(EFFECTS, point).effects
    np.testing.assert_allclose(effect.values.pop(key), axis / np.linalg.norm(axis))
    values.pop(key)
    assert effect.values == values
    offset = {"offset": np.array([3e-6, 0.0, 1e-6])}  # a length, not a direction
    point = Point(np.zeros(0), (Effect("unbalance", "sphere", offset),))
    (effect,) = with_unit_directions(EFFECTS, point).effects
    np.testing.assert_array_equal(effect.values["offset"], offset["offset"])


def test_scores_name_what_the_step_has_taken_up_already():
    taken, open_ = SimpleNamespace(id="creep", place="w1"), SimpleNamespace(id="creep", place="w2")
    score = SimpleNamespace(candidate=SimpleNamespace(id="creep", place="w2", note=""), gain=7.0,
                            columns=1, p=0.1, index=0)  # fmt: skip
    scan = SimpleNamespace(layout=SimpleNamespace(candidates=[open_]), cosine=lambda a, b: 1.0,
                           best_per_name=lambda: [score])  # fmt: skip
    fit = SimpleNamespace(point=SimpleNamespace(effects=[taken, open_]))
    outcome: Any = SimpleNamespace(scans=[scan], fit=fit)
    (row,) = score_table(outcome)
    assert row["beside"] == ["creep at w1"] and row["gain"] == 7.0


def line(identity, rivals=(), place="axis", **evidence):
    sizes = {k: {"value": 1.0, "sigma": 0.1, "unit": "1"} for k in ("amplitude", "order", "phase")}
    others = [{"id": other, "place": place} for other in rivals]
    return Named(identity, place, sizes, {"held_out_chi2": 1.0} | evidence, others)


@pytest.mark.parametrize("seed", range(20))
def test_effects_fall_into_lists_of_which_one_each_is_there(seed):
    rng = np.random.default_rng(seed)
    sizes = rng.integers(1, 4, rng.integers(1, 6))
    lists = [[f"law-{i}-{k}" for k in range(n)] for i, n in enumerate(sizes)]
    effects = [
        line(some[k], [*some[max(0, k - 1) : k], *some[k + 1 : k + 2]])  # a third joins two
        for some in lists
        for k in range(len(some))
    ]
    effects = [effects[k] for k in rng.permutation(len(effects))]
    told = [[e.id for e in some] for some in alternatives(effects)]
    assert {frozenset(some) for some in told} == {frozenset(some) for some in lists}
    assert [len(some) > 1 for some in told] == sorted(len(some) > 1 for some in told)


def test_lines_told_as_one_effect_keep_their_rivals_and_no_rival_of_another_joins_them():
    effects = [
        line("motor-ripple", ["current-ripple"]),
        line("current-ripple", ["motor-ripple"], margin=1.0),
        line("motor-ripple"),
        line("shaft-spring", ["motor-ripple"]),
        line("motor-ripple", ["shaft-spring"], margin=2.0),
    ]
    told = {e.id: e for e in together(effects[:3])}
    assert set(told) == {"cogging", "current-ripple"}
    assert told["cogging"].indistinguishable_from == [{"id": "current-ripple", "place": "axis"}]
    assert told["current-ripple"].indistinguishable_from == [{"id": "cogging", "place": "axis"}]
    own = together(effects[2:])
    told = [[e.id for e in some] for some in alternatives(own)]
    assert told == [["motor-ripple"], ["shaft-spring", "motor-ripple"]]
    whole = together([effects[2], *effects[2:]])
    told = [[e.id for e in some] for some in alternatives(whole)]
    assert told == [["cogging"], ["shaft-spring", "motor-ripple"]]
