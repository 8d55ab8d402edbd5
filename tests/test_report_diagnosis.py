"""The page of a diagnosis: a mechanic's words, readable numbers, and sliders that mix residuals."""

import dataclasses
import html
import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

from omnijax.diagnosis import Diagnosis, Effect, Named, OutputGap, Point, effect_sizes_on_held_out
from omnijax.diagnosis._answer import JUDGES
from omnijax.laws import EFFECTS, WheelRunout
from omnijax.report import Page, diagnosis_page, provenance
from omnijax.report._diagnosis import _answer, _where, _which
from omnijax.report._diagnosis_figures import next_figure, score_figure
from omnijax.report._diagnosis_numbers import closed
from omnijax.report._diagnosis_sizes import sizes_section
from omnijax.report._diagnosis_words import where_sentences

SIGMA = {"dR_x": 2e-6, "dR_y": 2e-6, "a_x": 5e-3}
UNIT = {"dR": "m", "a": "m/s^2"}
FOUND = {"wheel-runout@w2": 4.07e-5, "bearing-coulomb@all": 1.3e-3}


class Plant:
    """Residuals in sigma that fall off in proportion to the effects' sizes, as a model gives them.

    It is the evidence too: `columns` and `series` split a residual into channels.
    """

    laws = EFFECTS

    def __init__(self, seed, fast=False):
        rng = np.random.default_rng(seed)
        self.time = 0.002 * np.arange(3000)
        turn = 2 * np.pi * (180.0 if fast else 0.5) * self.time
        self.noise = rng.standard_normal((3, 3000))
        pull = rng.uniform(1, 8, (2, 3, 1))
        self.waves = pull * np.stack([np.sin(turn), np.sign(np.cos(turn))])[:, None]
        self.model = self
        self.asked = []

    def residuals(self, points, split):
        self.asked += points
        return [self.at(p.effects).ravel() for p in points]

    def at(self, effects):
        out = self.noise + self.waves.sum(axis=0)
        for effect in effects:
            k = list(FOUND).index(effect.name)
            key = "amplitude" if k == 0 else "torque"
            out = out - effect.values[key] / FOUND[effect.name] * self.waves[k]
        return out

    def series(self, residual):
        return "run-3", self.time, dict(zip(SIGMA, residual.reshape(3, -1), strict=True))

    def columns(self, residual, split):
        return [self.series(residual)[2]]

    def assumed(self, channel):
        return {"unit": UNIT[channel.partition("_")[0]]}

    def sigma(self, channel, split, run):
        return SIGMA[channel]

    def unit(self, unit, place, key=""):
        return unit

    def text(self, rig):
        return "[sphere]"


def diagnosis(seed=0, count=2, **more):
    """A named diagnosis of `count` effects with what its page draws from."""
    plant = Plant(seed, **more)
    runout = Effect("wheel-runout", "w2", {"amplitude": 4.07e-5, "phase": 0.7})
    friction = Effect("bearing-coulomb", "all", {"torque": 1.3e-3, "width": 0.05})
    point = Point(np.zeros(0), (runout, friction)[:count])
    sizes = {"amplitude": {"value": 4.07e-5, "sigma": 3.4e-8, "unit": "m"},
             "phase": {"value": 0.7, "sigma": 8e-4, "unit": "rad"}}  # fmt: skip
    gap = {"dR": OutputGap(2e-6, 1.4e-5, 1.99e-6, "m"), "a": OutputGap(5e-3, 6e-3, 5e-3, "m/s^2")}
    found = Diagnosis("named", [Named("wheel-runout", "w2", sizes, {})], [], gap, None, [], {}, [])
    before, after = (r.ravel() for r in (plant.at(()), plant.at(point.effects)))
    found.details = {
        "evidence": plant, "found": SimpleNamespace(fit=SimpleNamespace(point=point)),
        "before": before, "after": after, "where": [], "learned": None,
    }  # fmt: skip
    return found, plant


def mixed(kept, shares):
    """Weights of the stored residuals at shares of the sizes, as the page's script takes them."""
    c = np.zeros(len(kept.traces[0].values))
    c[kept.as_named] = 1.0
    for effect, share in zip(kept.effects, shares, strict=True):
        nodes = np.interp(share, effect.shares, range(len(effect.shares)))
        k = min(int(nodes), len(effect.shares) - 2)
        c[effect.column[k]] += 1 - (nodes - k)
        c[effect.column[k + 1]] += nodes - k
        c[kept.as_named] -= 1.0
    return c


class Wobble(WheelRunout):
    id, words = "wobble", "a wheel that wobbles"


@pytest.mark.parametrize("words", ["a wheel that wobbles", ""])
def test_a_law_of_ones_own_is_said_in_its_words_or_by_its_id(monkeypatch, words):
    found, plant = diagnosis()
    monkeypatch.setattr(Wobble, "words", words)
    monkeypatch.setattr(plant, "laws", {**EFFECTS, "wobble": Wobble}, raising=False)
    found.effects[0] = dataclasses.replace(found.effects[0], id="wobble")
    text = html.unescape(diagnosis_page(found, "omnijax diagnose").html())
    assert f"It is {words or '`wobble`'} at w2" in text.replace("<code>wobble</code>", "`wobble`")


SAYS = {
    "A": "A missing effect was found and named, and held-out runs confirm it. It is a.",
    "A B": "A missing effect was found and named, and held-out runs confirm it. It is a and b.",
    "AB": "Several effects explain these runs equally well: the next experiment tells. "
    "It is a or b.",
    "AB CDE": "Several effects explain these runs equally well: the next experiment tells of the "
    "first which it is. It is either a or b and either c, d or e.",
    "A BC": "One missing effect is named, and held-out runs confirm it: a. Beside it there is "
    "b or c, which explain these runs equally well: the next experiment tells.",
    "AB C D": "Missing effects are named, and held-out runs confirm it: c and d. Beside them "
    "there is a or b, which explain these runs equally well: the next experiment tells.",
}


@pytest.mark.parametrize("lists", SAYS)
def test_the_answer_joins_effects_by_and_and_rivals_by_or(monkeypatch, lists):
    found, plant = diagnosis()
    names = [name for some in lists.split() for name in some]
    laws = {name: type(name, (Wobble,), {"words": name.lower()}) for name in names}
    monkeypatch.setattr(plant, "laws", laws, raising=False)
    found.effects = [
        Named(name, "axis", {}, {}, [{"id": x, "place": "axis"} for x in some if x != name])
        for some in lists.split() for name in some
    ]  # fmt: skip
    if any(len(some) > 1 for some in lists.split()):
        found.verdict, found.next_experiment = "ambiguous", {"drive": "faster"}
    says = re.sub(r" \(`\w`\)", "", _answer(found))
    assert says.startswith(SAYS[lists] + " What the model misses")
    parts = re.search(r": (.*);", repr(found))[1].replace("@axis", "").split(" and ")
    assert {frozenset(part.split(" or ")) for part in parts} == set(map(frozenset, lists.split()))


@pytest.mark.parametrize("seed", range(3))
def test_mixed_residuals_are_those_of_the_model(seed):
    found, plant = diagnosis(seed)
    kept = effect_sizes_on_held_out(found)
    rng = np.random.default_rng(seed)
    for shares in [(1.0, 1.0), (0.0, 0.0), *rng.uniform(0, 1.5, (4, 2))]:
        point = found.details["found"].fit.point
        effects = [
            Effect(e.id, e.place, {k: s * v for k, v in e.values.items()})
            for e, s in zip(point.effects, shares, strict=True)
        ]
        truth = plant.at(effects)
        c = mixed(kept, shares)
        for group, rows in (("dR", slice(0, 2)), ("a", slice(2, 3))):
            sigma = np.array(list(SIGMA.values()))[rows]
            rms = np.sqrt(np.mean(sigma**2 * np.mean(truth[rows] ** 2, axis=1)))
            assert np.sqrt(c @ kept.gram[group] @ c) == pytest.approx(rms, rel=1e-9)
        for k, trace in enumerate(kept.traces):  # each of the channel that its effect moves most
            row = list(SIGMA).index(trace.channel)
            power = np.sum(plant.waves[k] ** 2, axis=1)
            assert power[row] == pytest.approx(power.max())
            block = np.mean(truth[row].reshape(len(trace.time), -1), axis=1)
            np.testing.assert_allclose(c @ trace.values, SIGMA[trace.channel] * block, atol=1e-12)


def test_a_fast_effect_is_drawn_sample_by_sample():
    found, plant = diagnosis(1, count=1, fast=True)
    kept = effect_sizes_on_held_out(found)
    assert np.diff(kept.traces[0].time) == pytest.approx(plant.time[1])


@pytest.mark.parametrize("confirmed_on", JUDGES)
def test_sliders_say_whose_residual_they_draw(confirmed_on):
    found, _ = diagnosis()
    found.confirmed_on = confirmed_on
    (section,) = sizes_section(found)
    for said in (section.text, section.tables[0].caption):
        assert f"What {JUDGES[confirmed_on].name} " in said
        assert ("held-out" in said) == (confirmed_on == "held-out")


def test_without_a_name_there_is_nothing_to_size():
    found, _ = diagnosis()
    found.verdict = "unknown"
    assert effect_sizes_on_held_out(found) is None and sizes_section(found) == []


def test_numbers_of_the_page_are_for_engineers(tmp_path):
    found, _ = diagnosis()
    page = diagnosis_page(found)
    facts = {f.label: (f.value, f.unit) for f in page.facts}
    assert facts["amplitude, wheel-runout at w2"] == ("40.70 ± 0.03", "µm")
    assert facts["phase, wheel-runout at w2"] == ("40.11 ± 0.05°", "")
    assert facts["gap of the sphere's displacement closed"] == (100.0, "%")
    titles = [s.title for s in page.sections]
    assert "Parameters" not in titles and "Where" not in titles and "Notes" not in titles
    assert all(s.text or s.figures or s.tables for s in page.sections)


@pytest.mark.parametrize("seed", range(5))
def test_closed_is_never_more_than_all(seed):
    noise, before, after = np.random.default_rng(seed).uniform(1, 2, 3)
    gap = OutputGap(noise, max(noise, before) * 1.1, after, "m")
    assert closed(gap) <= 100.0
    assert closed(OutputGap(1.0, 1.0, 0.9, "m")) is None  # nothing was above the noise


WHERE = {
    ("order", 1.0, "w2"): "comes once a turn of w2.",
    ("order", 3.0, "w2"): "comes 3 times a turn of w2.",
    ("order", 14.0, "w2"): "comes with every roller of w2 (14 a turn).",
    ("order", 28.0, "w2"): "comes 2 times with every roller of w2 (14 a turn).",
    ("order", 2.0, "sphere"): "comes 2 times a turn of the sphere.",
    ("frequency", 13.7, "Hz"): "comes at 13.7 Hz, whatever the speed.",
    ("direction", float("nan"), "w2"): "changes with the direction of the motion of w2.",
    ("load", float("nan"), "axis"): "follows the load of the axis.",
}


@pytest.mark.parametrize("place", WHERE)
def test_where_is_said_in_a_mechanics_words(place):
    found, _ = diagnosis()
    domain, value, reference = place
    found.rig = SimpleNamespace(names=("w1", "w2"), wheels=SimpleNamespace(rollers=[14.0, 14.0]))
    one = {"channel": "dR_y", "domain": domain, "value": value, "reference": reference,
           "share": 0.983, "p": 0.0, "rms_over_noise": 5.0, "stands": True}  # fmt: skip
    found.where = [one, {**one, "channel": "theta_2", "share": 0.5}]
    said = where_sentences(found)
    lead = "98 % of what the model misses of the sphere's displacement in y (`dR_y`)"
    assert said[0] == f"{lead} (and 50 % of `theta_2`) {WHERE[place]}"
    assert said[1] == "`dR_y` is missed by 5 times its noise."
    small = {**one, "channel": "a_x", "rms_over_noise": 1.2}
    found.where = [{**one, "stands": False}, {**small, "stands": False}]
    said = where_sentences(found)
    assert said[0].startswith("`dR_y` is missed by 5 times its noise, but these runs are too short")
    assert said[1] == f"The likeliest: {lead} {WHERE[place]}"
    found.where = [{**small, "stands": False}]
    assert where_sentences(found) == ["Nothing stands out against chance in any channel."]
    found.where = [{**one, "reference": f"w{k}", "channel": f"a_{k}"} for k in range(9)]
    assert len(where_sentences(found)) == (2 if domain == "frequency" else 5)


@pytest.mark.parametrize("width", [1280, 400])
def test_the_slider_shrinks_the_residual(open_page, tmp_path, width):
    found, plant = diagnosis(4)
    page = Page("Diagnosis", "Why?", "So.", sizes_section(found), provenance("omnijax diagnose"))
    tab, seen = open_page(page.write(tmp_path).as_uri(), width)
    now = tab.locator(".dial .now").first

    def shown():
        number, unit = re.fullmatch(r"([\d.]+) (\S+)", now.inner_text()).groups()
        return float(number) * {"µm": 1e-6, "mm": 1e-3}[unit]

    def rms(share):
        part = plant.noise[:2] + (1 - share) * plant.waves[0, :2]
        return np.sqrt(np.mean((2e-6 * part) ** 2))

    assert shown() == pytest.approx(rms(1.0), rel=0.01)
    path = tab.locator(".dial svg path").get_attribute("d")
    for percent in (0, 37, 80):
        tab.locator(".dial input").first.fill(str(percent))
        assert shown() == pytest.approx(rms(percent / 100), rel=0.01)
        assert tab.locator(".dial .size").first.inner_text() == {
            0: "0 µm", 37: "15.1 µm", 80: "32.6 µm"}[percent]  # fmt: skip
    assert tab.locator(".dial svg path").get_attribute("d") != path
    tab.locator(".dial input").nth(1).fill("0")  # the picture is now that of the other effect
    other = effect_sizes_on_held_out(found).traces[1].channel
    assert other in tab.locator(".dial svg .title").text_content()
    tab.locator(".dial button").click()
    assert shown() == pytest.approx(rms(1.0), rel=0.01)
    assert tab.evaluate("document.documentElement.scrollWidth") <= width
    assert seen["errors"] == [] and all(u.startswith(("file:", "data:")) for u in seen["requests"])


def test_ticks_of_the_residual_are_round(open_page, tmp_path):
    """0.2 four times up from -0.8 is no 0 to the last bit."""
    found, _ = diagnosis(4)
    page = Page("Diagnosis", "Why?", "So.", sizes_section(found), provenance("omnijax diagnose"))
    path = page.write(tmp_path)
    text = path.read_text(encoding="utf-8")
    (stored,) = re.findall(r'data-model="(.*?)"', text, re.S)
    model = json.loads(html.unescape(stored))
    for trace in model["traces"]:
        most = max(abs(y) for row in trace["values"] for y in row)
        trace["values"] = [[0.87 / most * y for y in row] for row in trace["values"]]
    path.write_text(text.replace(stored, html.escape(json.dumps(model))), encoding="utf-8")
    tab, _ = open_page(path.as_uri(), 1280)
    shown = tab.locator('.dial svg text[text-anchor="end"]').all_text_contents()
    assert [x.replace("\u2212", "-") for x in shown] == [f"{k / 5:g}" for k in range(-4, 5)]


def test_the_slider_needs_no_other_file(tmp_path):
    found, _ = diagnosis()
    page = Page("Diagnosis", "Why?", "So.", sizes_section(found), provenance("omnijax diagnose"))
    text = page.html()
    model = re.search(r'data-model="([^"]+)"', text)[1].replace("&#34;", '"')
    traces = json.loads(model)["traces"]
    assert [len(t["values"]) for t in traces] == [13, 13]  # as found, six sizes of two effects
    assert len(text) < 400_000


def test_rivals_that_are_all_alike_are_not_listed_once_more_for_each():
    from types import SimpleNamespace

    from omnijax.report._diagnosis import _rivals

    names = ("bearing-viscous", "air-drag", "stribeck")

    def effects(known):
        others = [{"id": n, "place": "all"} for n in known]
        return [
            SimpleNamespace(
                id=n, place="all", indistinguishable_from=[o for o in others if o["id"] != n]
            )
            for n in names
        ]

    alike, some = effects(names), effects(names[:2])
    assert {_rivals(e, alike) for e in alike} == {"each of the others"}
    assert _rivals(some[0], some) == "air-drag at all"
    assert _rivals(alike[0], alike[:1]) == "air-drag at all, stribeck at all"


def test_scores_beside_what_is_named_say_so():
    """A search that goes on from a found effect scores the others alone."""
    row = {"id": "damaged-roller", "place": "w1", "gain": 7.0}
    alone = score_figure([row])
    beside = score_figure([row | {"beside": ["bearing-coulomb at w2"]}])
    titles = [f.fig.axes[0].get_title("left") for f in (alone, beside)]
    assert titles == [
        "What each candidate would explain", "What each further candidate would explain",
    ]  # fmt: skip
    assert "beside bearing-coulomb at w2" in beside.caption and "beside" not in alone.caption


@pytest.mark.parametrize("confirmed_on, shown", [
    ("held-out", "on a run that was not fitted"),
    ("blocks", "on a part of a run that was kept out of the fit"),
    ("nothing", "on the fitted run itself"),
])  # fmt: skip
def test_where_a_gap_was_asked_for_is_said(confirmed_on, shown):
    """A run that was fitted was called one that was not."""
    found, _ = diagnosis()
    found.confirmed_on = confirmed_on
    found.where = [{"channel": "dR_x", "domain": "order", "value": 1.0, "reference": "w2",
                    "share": 0.9, "p": 0.0, "rms_over_noise": 9.0, "stands": True}]  # fmt: skip
    found.rig = SimpleNamespace(names=("w1", "w2"))
    (section,) = _where(found)
    assert f"Before any effect is added, {shown}." in section.text


def test_no_law_is_said_to_be_refitted_that_was_only_scored():
    found, _ = diagnosis()
    text = _which(found).text
    assert "was scored at every place" in text and "the best few of each step were refitted" in text


@pytest.mark.parametrize("names, unit, label", [
    (("w1", "w2"), "N m", "motor torque (N m)"), ({"input": "axis"}, "V", "input (V)"),
    (None, "A", "input (A)"),
])  # fmt: skip
def test_the_proposed_input_is_in_its_unit(names, unit, label):
    """Volts were drawn as N m of a motor's torque."""
    count = len(names) if isinstance(names, tuple) else 1
    torque = {"unit": unit, "step": 0.02, "values": np.ones((9, count)).tolist()}
    found = SimpleNamespace(next_experiment={"drive": "a sine", "torque": torque},
                            rig=SimpleNamespace(names=names))  # fmt: skip
    drawn = next_figure(found)
    assert drawn.fig.axes[0].get_ylabel() == label
    assert list(drawn.data)[1].endswith(f" / {unit}")
    assert drawn.caption == f"{label.rpartition(' (')[0].capitalize()} of: a sine."
