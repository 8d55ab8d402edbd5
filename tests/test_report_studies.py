"""Pages of studies: what to build and what it brings; sweeps that say where a wheel lets go."""

import dataclasses

import numpy as np
import pytest

from omnijax._status import Status
from omnijax._text import listed, path_words, quantity_text, scaled_together
from omnijax.report import provenance, study_page, sweep_figure, sweep_page
from omnijax.study import Design, SweepResult
from omnijax.study._sweep.evaluator import quantities
from omnijax.study._sweep.spec import SweepSpec
from omnijax.study._sweep.store import create_store

VARY = (
    ("contact.stiffness", "N/m", "log:50000.0:1000000.0:4"),
    ("wheel.roundness", "1", "0.1:0.6:5"),
)


def swept(seed, loose=0.3, vary=VARY, **points):
    """A stored sweep of random figures in which a share of the designs slips or lifts off."""
    rng = np.random.default_rng(seed)
    spec = SweepSpec("[sphere]\n", vary, ("rms", "slip_margin"), {}, "steady", **points)
    about = {"method_reason": "a test", "versions": {}}
    store = create_store(None, spec, quantities(spec), about)
    size = spec.points.size
    status = np.where(
        rng.uniform(size=size) < loose, rng.choice([Status.SLIP, Status.LIFT_OFF], size), Status.OK
    )
    values = spec.points.at(np.arange(size))
    columns = {path: values[:, k] for k, (path, _, _) in enumerate(vary)}
    columns |= {"rms": rng.uniform(1e-5, 3e-4, size), "slip_margin": rng.uniform(-9, 40, size)}
    store.write(0, columns | {"status": status})
    return SweepResult(store)


@pytest.mark.parametrize("seed", range(6))
def test_best_holds_its_wheels_where_any_design_does(seed):
    result = swept(seed, loose=[0.0, 0.3, 0.9, 1.0][seed % 4])
    held = result.held().ravel()
    values = result["rms"].ravel()
    allowed = held if held.any() else np.ones_like(held)
    assert result.best("rms") == int(np.argmin(np.where(allowed, values, np.inf)))
    margin = np.where(allowed, result["slip_margin"].ravel(), -np.inf)
    assert result.best("slip_margin") == int(np.argmax(margin))


@pytest.mark.parametrize("seed", range(4))
def test_the_page_says_what_slips_and_what_lies_at_the_edge(seed):
    result = swept(seed)
    loose = int(np.sum(~result.held()))
    page = sweep_page(result)
    assert f"{loose} of 20 designs slip or lift off" in page.answer
    best = result.best("rms")
    i, j = np.unravel_index(best, result.shape)
    ends = ["lowest"] * ((i == 0) + int(j == 0)) + ["highest"] * ((i == 3) + int(j == 4))
    said = next(line for line in page.answer.split("\n\n") if "best rms" in line)
    assert said.count("the lowest tried") == ends.count("lowest")
    assert said.count("the highest tried") == ends.count("highest")
    assert (
        f"contact stiffness {quantity_text(result.design(best)['contact.stiffness'], 'N/m')}"
        in said
    )
    tables = {t.name: t for s in page.sections for t in s.tables}
    assert {row[-1] for row in tables["best-rms"].rows} == {"ok"}


@pytest.mark.parametrize("seed", range(3))
def test_maps_hatch_and_lines_ring_what_slips(seed):
    result = swept(seed)
    ax = result.plot_heatmap("rms")
    assert len(ax.patches) == np.sum(~result.held())
    assert ax.get_xlabel() == "contact stiffness (kN/m)" and ax.get_ylabel() == "wheel roundness"
    assert ax.get_legend().get_texts()[0].get_text() == "a wheel slips or lifts off"
    rings = result.plot_lines("rms").lines[-1]
    assert rings.get_marker() == "o" and len(rings.get_xdata()) == np.sum(~result.held())
    clean = swept(seed, loose=0.0)
    assert not clean.plot_heatmap("rms").patches
    assert clean.plot_heatmap("rms").get_legend() is None


def test_samples_have_a_panel_for_each_parameter():
    vary = (("contact.stiffness", "N/m", "5e4:1e6"), ("speed.w1", "rad/s", "1:2"))
    result = swept(0, vary=vary, sampler="lhs", samples=12)
    fig = sweep_figure(result, "rms")
    stiffness, speed = fig.axes
    assert stiffness.get_xlabel() == "contact stiffness (kN/m)"
    assert speed.get_xlabel() == "speed of w1 (rad/s)"
    for ax, path, factor in ((stiffness, "contact.stiffness", 1e-3), (speed, "speed.w1", 1.0)):
        np.testing.assert_allclose(ax.lines[0].get_xdata(), factor * result[path])
    page = sweep_page(result)
    assert page.question == (
        "How do rms and slip_margin depend on contact stiffness and speed of w1?"
    )
    assert page.sections[0].figures[0].axis is None  # one switch cannot serve two quantities


def test_designs_that_failed_are_listed_in_the_units_of_their_columns():
    result = swept(1)
    status = result.store.read("status", 0, result.size)
    status[3] = Status.FAILED
    result.store.write(0, {name: result.store.read(name) for name in result.store.names[:-1]}
                       | {"status": status})  # fmt: skip
    failed = next(t for s in sweep_page(result).sections for t in s.tables if t.name == "failed")
    assert [(c.name, c.unit) for c in failed.columns[:2]] == [
        ("design", ""), ("contact.stiffness", "kN/m"),
    ]  # fmt: skip
    (row,) = failed.rows
    assert row[:2] == [3, pytest.approx(1e-3 * result.design(3)["contact.stiffness"])]


def test_sizes_of_one_quantity_share_a_unit():
    assert scaled_together((0.01593, 1e-4, 1e-4), "rad") == (1e3, "mrad")  # 0.913 to 0.00573 deg
    assert scaled_together((2.04e-6, 1.99e-6), "m") == (pytest.approx(1e6), "µm")
    assert scaled_together((5.0, 2e-6), "m") == (1.0, "m")
    assert scaled_together((float("nan"), 3e-3), "m") == (pytest.approx(1e3), "mm")
    assert scaled_together((0.0, float("nan")), "m") == (1.0, "m")


def test_words_in_a_row():
    assert listed(["a"]) == "a"
    assert listed(["a", "b"]) == "a and b"
    assert listed(["a", "b", "c"]) == "a, b and c"


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("contact.stiffness", "contact stiffness"),
        ("wheel.roundness", "wheel roundness"),
        ("wheel.w2.roundness", "roundness of w2"),
        ("wheel.w2.contact.stiffness", "contact stiffness of w2"),
        ("wheel.mount.stiffness", "wheel mount stiffness"),
        ("speed.w1", "speed of w1"),
        ("speed.scale", "scale of the speeds"),
        ("force.x", "force in x"),
        ("effect.wheel-runout.w2.amplitude", "amplitude of wheel-runout at w2"),
        ("sphere.mass", "sphere mass"),
    ],
)
def test_paths_in_words(path, words):
    assert path_words(path) == words


def designed(**change):
    """A design as a search of three starts returns it."""
    ends = {"start": [[1e5, 0.5]] * 3, "x": [[6e4, 0.35]] * 3, "objective": [9.447e-5] * 3,
            "violation": [0.0] * 3, "kkt_residual": [1e-10] * 3, "evaluations": [18] * 3,
            "status": ["optimal"] * 3, "reason": ["no better neighbour"] * 3}  # fmt: skip
    found = Design(
        status="optimal", reason="KKT residual 1e-10", objective=9.447e-5, objective_name="rms",
        variables={"contact.stiffness": 6e4, "wheel.roundness": 0.35}, unit="m",
        cases={"": 9.447e-5}, active=("`wheel.roundness` is at its lower bound 0.35.",),
        multipliers=(), kkt_residual=1e-10, violation=0.0, evaluations=54, ends=ends, prices={},
        units={"contact.stiffness": "N/m", "wheel.roundness": "1"},
        limits={"slip_margin >= 5 N": (7.25, "N")},
        was={"old": 1.053e-4, "new": 9.447e-5, "cases": {"": (1.053e-4, 9.447e-5)},
             "variables": {"contact.stiffness": 1.5e5, "wheel.roundness": 0.45}},
    )  # fmt: skip
    return dataclasses.replace(found, **change)


def test_a_design_says_first_what_to_build_and_what_it_brings(tmp_path):
    page = study_page(designed(), provenance("omnijax design study.toml"))
    assert page.answer == (
        "Build it with contact stiffness 60 kN/m (now 150 kN/m) and wheel roundness 0.35 (now "
        "0.45). That is 10.3 % less rms than your rig: from 105.3 to 94.47 µm."
    )
    facts = {f.label: (f.value, f.unit) for f in page.facts}
    assert facts["slip_margin at least 5 N"] == ("7.25", "N")
    figures = [f.name for s in page.sections for f in s.figures]
    assert figures == ["gain"]  # three searches that agree need no picture
    page.write(tmp_path)
    assert (tmp_path / "gain.csv").read_text().splitlines()[1] == ",105.3,94.47"


def test_of_many_limits_of_a_kind_a_design_shows_the_tightest_first(tmp_path):
    reached = {f"separation of mode {m} from order {o}n of w{w} >= 0.15": (m / o + w, "")
               for m in (1, 2, 3) for o in (1, 2) for w in (1, 2, 3)}  # fmt: skip
    patches = {f"patch pressure of w{w} <= 3e+06 Pa": (1e6 * w, "Pa") for w in (1, 2)}
    page = study_page(designed(limits=reached | patches), provenance("omnijax design study.toml"))
    assert {fact.label: fact.value for fact in page.facts[1:]} == {
        "separation of mode 1 from order 2n of w1 at least 0.15 (tightest of 18)": "1.5",
        "patch pressure of w2 at most 3e+06 Pa (tightest of 2)": "2",
    }
    page.write(tmp_path)
    assert len((tmp_path / "limits.csv").read_text().splitlines()) == 21


def test_a_design_over_drawn_parts_does_not_call_a_nominal_figure_by_the_objectives_name(tmp_path):
    """A figure with parts at their nominal values was told as `mean + 2 sigma of rms`."""
    name = "worst mean + 2 sigma of rms"
    found = designed(objective_name=name, objective=1.2e-4, cases={"a": 1e-4, "b": 1.2e-4})
    cases = {"a": (1e-4, 9e-5), "b": (1.053e-4, 9.447e-5)}
    found = dataclasses.replace(found, was=found.was | {"name": "worst rms", "cases": cases})
    page = study_page(found, provenance("omnijax design study.toml"))
    assert page.answer.endswith("10.3 % less worst rms than your rig, parts at nominal values: "
                                "from 105.3 to 94.47 µm.")  # fmt: skip
    assert page.facts[0].label == "worst rms"
    page.write(tmp_path)
    assert (tmp_path / "gain.csv").read_text().splitlines()[0].endswith("the design: rms / µm")


def test_a_design_that_is_not_sure_says_so():
    ends = designed().ends | {"objective": [9.447e-5, 1.2e-4, 1.3e-4]}
    page = study_page(designed(status="not optimal", ends=ends), provenance("omnijax design x"))
    assert "A better one may exist: KKT residual 1e-10." in page.answer
    assert [f.name for s in page.sections for f in s.figures] == ["gain", "searches"]
    nothing = study_page(designed(status="infeasible", was={}), provenance("omnijax design x"))
    assert nothing.answer.startswith("Nothing to build")


def test_a_design_survives_saving(tmp_path):
    found = designed()
    found.save(tmp_path / "d.nc")
    assert Design.load(tmp_path / "d.nc").limits == found.limits
    assert study_page(Design.load(tmp_path / "d.nc"), provenance("x")).answer.startswith("Build it")
