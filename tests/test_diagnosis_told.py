"""What an answer tells of its numbers: ends of ranges, clocks beside a gap, bounds of noise."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from seeds import drawn_anew

from omnijax.diagnosis import Diagnosis, OutputGap, Point
from omnijax.diagnosis._answer import RigEvidence, Verdict, gaps, noise_remarks, noise_table, notes
from omnijax.diagnosis._answer.answer import baseline_table
from omnijax.diagnosis._answer.shown import Shown
from omnijax.diagnosis._machine._preparation.roles import that_tell_their_motion
from omnijax.diagnosis._machine.clocks import clock_priors
from omnijax.diagnosis._machine.runs import Run
from omnijax.diagnosis._search import Effect, Level, Prior
from omnijax.report import Page, provenance
from omnijax.report._diagnosis_numbers import notes as noise_section
from omnijax.report._diagnosis_numbers import parameters

STIFFNESS = "wheel.w1.mount.stiffness"
RUNS = [SimpleNamespace(name=f"run-{k}", outputs={"theta": np.zeros((1, 0))}) for k in (1, 3)]


def priors(rng) -> list[Prior]:
    """A clock and two shares."""
    value = rng.uniform(2e5, 9e5, 2)
    return [
        *clock_priors(["Omega"], set()),
        Prior(STIFFNESS, value[0], 0.08, unit="N/m"),
        Prior("wheel.w2.mount.stiffness", value[1], 0.08, unit="N/m"),
    ]


def fit(u, sigma=0.01, effects=()) -> Any:
    """A fit that ended at unit coordinates u, all of them known to `sigma`."""
    return SimpleNamespace(
        point=Point(np.array(u, float), tuple(effects)), cost=np.inf, chi2=100.0,
        scaled_covariance=lambda dof: sigma**2 * np.eye(len(u)),
    )  # fmt: skip


def outcome(priors, first, last) -> Any:
    return SimpleNamespace(
        priors=priors,
        baseline=first,
        fit=last,
        wider={},
        left_open={},
        refused=[],
        scans=[],
        rivals={},
    )


def told(evidence_priors, first, last, verdict, fitted=None, clocks=None) -> list[str]:
    """The notes of a rig's answer."""
    model = SimpleNamespace(
        priors=evidence_priors, dof=lambda split: 1000, spent=False,
        settings=SimpleNamespace(noise_sigmas=0.0), fitted=fitted,
        machine=SimpleNamespace(window=1.0, runs=RUNS, clocks=clocks or {}),
        rig=SimpleNamespace(names=(), size=0),
    )  # fmt: skip
    evidence = RigEvidence(model, {}, [])  # pyright: ignore[reportArgumentType]
    judged = Verdict(verdict, 0.0, {}, "so")
    return notes(evidence, outcome(evidence_priors, first, last), judged, [])


@pytest.mark.parametrize("end", [-1, 1])
def test_a_number_at_an_end_of_its_range_is_said_and_has_no_sigma(end):
    """The page said `459.5 ± 1.9 kN/m, known: yes` of one that its range had stopped."""
    known = priors(drawn_anew("ends"))
    at = fit([0.0, end * known[1].hard, 0.5])
    _, row, other = baseline_table(outcome(known, at, at), at, 1000)
    assert row["at_bound"] and not row["determined"]
    assert row["sigma"] is row["relative_sigma"] is None
    assert other["sigma"] == pytest.approx(0.08 * 0.01 * other["with_effects"])
    assert other["determined"] and not other["at_bound"]
    said = [x for x in told(known, at, at, "unknown") if "At an end of its range" in x]
    assert len(said) == 1 and STIFFNESS in said[0] and "w2" not in said[0]
    free = fit([0.0, 0.3, 0.5])
    assert not [x for x in told(known, free, free, "none") if "end of" in x]


def diagnosis(baseline=(), noise=None) -> Diagnosis:
    gap = {"a": OutputGap(5e-3, 6e-3, 6e-3, "m/s^2")}
    return Diagnosis("unknown", [], [], gap, None, [*baseline], noise or {}, [])


@pytest.mark.parametrize("width", [1280, 400])
def test_the_page_marks_ends_of_ranges_and_bounds_of_noise(open_page, tmp_path, width):
    rng = drawn_anew("marked")
    known = priors(rng)
    first, at = fit([1.0, 0.2, 0.4]), fit([0.5, known[1].hard, 0.6])
    rows = baseline_table(outcome(known, first, at), at, 1000)
    table = {
        c: {"declared": 5e-3, "shown": 5e-3 * rng.uniform(1.2, 2), "sigma": 1e-4, "at_most": most,
            "colour": "white", "unit": "m/s^2", "source": "declared"}
        for c, most in (("a_x", True), ("a_y", False))
    }  # fmt: skip
    answer = diagnosis(rows, table)
    page = Page("Diagnosis", "Why?", "So.", [*parameters(answer), *noise_section(answer)],
                provenance("omnijax diagnose"))  # fmt: skip
    tab, seen = open_page(page.write(tmp_path).as_uri(), width)
    cells = {r.split("\t")[0]: r for r in tab.locator("tr").all_inner_texts()}
    assert "(end)" in cells[STIFFNESS] and "(end)" not in cells["wheel.w2.mount.stiffness"]
    assert "±" not in cells[STIFFNESS] and "±" in cells["wheel.w2.mount.stiffness"]
    assert "at most" in cells["a_x"] and "at most" not in cells["a_y"]
    if width > 1000:  # a telephone leaves these columns out
        assert "no: at an end of its range" in cells[STIFFNESS]
        assert "yes" in cells["wheel.w2.mount.stiffness"]
        assert "\t0.25 ms" in cells["clock.Omega"]  # what it had absorbed
    assert tab.evaluate("document.documentElement.scrollWidth") <= width
    assert seen["errors"] == []


def test_what_an_absolute_number_had_absorbed_is_told_in_its_unit():
    """It was 0 % whatever it was."""
    known = priors(drawn_anew("absorbed"))
    first, last = drawn_anew("absorbed by").uniform(-2, 2, (2, 3))
    clock, share, _ = baseline_table(outcome(known, fit(first), fit(last)), fit(last), 1000)
    assert clock["absorbed"] == pytest.approx(known[0].sigma * (first[0] - last[0]))
    assert share["absorbed"] == pytest.approx(known[1].sigma * (first[1] - last[1]))
    assert share["relative"] and not clock["relative"]


@pytest.mark.parametrize("verdict", ["none", "named", "ambiguous", "unknown"])
def test_a_clock_beside_a_gap_is_no_fact(verdict):
    """One that was right "was read 0.448 ± 0.1 ms early, calibrated", beside a gap of 108 sigma."""
    known = priors(drawn_anew("doubtful"))
    at = fit([drawn_anew("doubtful clock").choice([-1, 1]), 0.0, 0.0])
    (said,) = [x for x in told(known, at, at, verdict) if x.startswith("Omega ")]
    assert ("±" in said) == ("was read" in said) == (verdict != "unknown")
    assert ("or a part of the gap" in said) == (verdict == "unknown")


@pytest.mark.parametrize("anew", [True, False])
def test_clocks_are_told_by_run_where_these_differ(anew):
    rng = drawn_anew("by run")
    runs = {"a": ["run-1", "run-2"]}
    known = clock_priors(["a"], set(), runs)
    mean, beside = rng.uniform(2e-4, 3e-4), anew * rng.uniform(5e-4, 6e-4)
    at = fit(np.array([mean, beside]) / known[0].sigma, sigma=0.001)
    (said,) = [x for x in told(known, at, at, "none", fitted=runs)
               if x.startswith("a was read")]  # fmt: skip
    if anew:
        first, second = f"{1e3 * (mean + beside):.3g} ±", f"{1e3 * (beside - mean):.3g} ±"
        assert first in said and second in said
        assert "ms late in run-1" in said and "ms early in run-2" in said
    else:
        assert f"{1e3 * mean:.3g} ± 0.0005 ms late against" in said and "run-" not in said


def test_the_clocks_of_held_out_runs_are_told():
    known = clock_priors(["a"], set())
    at, late = fit([0.0]), drawn_anew("held out").uniform(1e-4, 9e-4)
    (said,) = [x for x in told(known, at, at, "none", clocks={1: {"a": -late}}) if "held-out" in x]
    assert said.endswith(f"run-3 (a {1e3 * late:.3g} ms early).")


def test_an_unknown_answer_says_whose_gap_it_is():
    known = priors(drawn_anew("whose"))
    first = fit([0.0, 0.1, 0.2])
    last = fit([0.0, 0.3, 0.2], effects=[Effect("wheel-radius", "all", {"s": 1e-3})])
    said = [x for x in told(known, first, last, "unknown") if "wheel-radius@all" in x]
    assert len(said) == 1 and "without them" in said[0]
    assert not [x for x in told(known, first, first, "unknown") if "best known" in x]


class Channels:
    """Evidence of two channels: a, in which a gap is left, and dR."""

    def assumed(self, channel):
        return {"declared": self.sigma(channel), "source": "declared", "unit": "m", "colour": ""}

    def sigma(self, channel, split="", run=0):
        return {"a_x": 5e-3, "dR_x": 2e-6}[channel]

    def unit_of(self, group):
        return "m"


@pytest.mark.parametrize("higher", [True, False])
def test_what_is_shown_beside_a_gap_is_an_upper_bound(higher):
    """7.04 was told for a noise of 5.00, "another than was declared", beside a gap in a."""
    evidence, rng = Channels(), drawn_anew("bounded")
    ratio = rng.uniform(1.2, 1.6) if higher else rng.uniform(0.5, 0.8)
    level = {"a_x": Level(ratio, 0.01, ratio), "dR_x": Level(1.3, 0.01, 1.3)}
    shown = Shown((level,), ("held-out",), {"a_x": 2.0, "dR_x": 0.0}, ([], []), frozenset({"a_x"}))
    table = noise_table(evidence, shown)  # pyright: ignore[reportArgumentType]
    assert table["a_x"]["at_most"] and not table["dR_x"]["at_most"]
    (other, *most) = noise_remarks(table)
    assert "dR_x: declared 2e-06 m, shown 2.6e-06 m" in other
    assert higher not in ("a_x" in other, "shown at most" in other)
    assert [x for x in most if "a_x" in x and "upper bound" in x] == most * higher
    assert len(most) == higher
    left = ratio * rng.uniform(0.9, 0.95)  # of less RMS than what is shown of its noise
    runs = [{"a_x": np.full(100, left), "dR_x": np.full(100, 0.9)}]
    found = gaps(evidence, shown, runs, runs)  # pyright: ignore[reportArgumentType]
    assert found["a"].noise_floor == pytest.approx(5e-3 * left)
    assert found["dR"].noise_floor == pytest.approx(2e-6 * 1.3)


@pytest.mark.parametrize(
    "constant, said",
    [
        ((), "neither Omega nor theta_1, theta_2 was measured"),
        (("a_x", "theta_2"), "theta_2 never changes, as of sensors that stand still, and Omega and "
         "theta_1 were not measured"),
        (("Omega_x", "Omega_y", "Omega_z", "theta_1", "theta_2"), "Omega_x, Omega_y, Omega_z, "
         "theta_1 and theta_2 never change, as of sensors that stand still"),
    ],
)  # fmt: skip
def test_sensors_that_stand_still_were_measured(constant, said):
    time, nothing = 2e-3 * np.arange(10), np.zeros((10, 2))
    run = Run("r", "train", time, nothing, np.zeros((10, 3)), {}, np.ones(10, bool))
    kept, text = that_tell_their_motion([run], {"r": constant})
    assert kept == []
    assert text == [f"r: {said}, so its motion is not known; the run is not used."]
