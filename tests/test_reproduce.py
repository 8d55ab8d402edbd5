"""`omnijax reproduce`: the claims' structure, the verdicts' logic, and every erratum swapped."""

import json
import re

import equinox as eqx
import jax
import numpy as np
import pytest

from omnijax.cli._frame import run
from omnijax.dynamics import Pointwise
from omnijax.paper._case import DAMPING, SPEEDS, baseline, changed
from omnijax.paper._claim import FAILS, HOLDS, PARTLY, Claim, at_least, at_most
from omnijax.paper._cycle import cycle, from_rest, metrics
from omnijax.paper._errata import ROWS, judge, recovered_radius
from omnijax.paper._study import make_study
from omnijax.report import _svg
from omnijax.simulation import simulate, speeds
from omnijax.vibration import norm

pytestmark = [pytest.mark.long, pytest.mark.brief]

HOSTILE = "<script>alert(1)"  # a folder's name that stays text on the page
WANTED = {
    "linear-velocity", "parabolic-path", "sinusoidal-quaternion", "no-coupling", "rigid-size",
    "peak-grows", "peak-frequency", "elastic-smaller", "orders-of-magnitude", "damping-magnitude",
    "damping-ripple", "stiffness-dominant", "stiffness-little", "mount-minor",
    "resistances-negligible",
}  # fmt: skip


COMPILED = []  # programs since the module began


@pytest.fixture(scope="module")
def study():
    jax.monitoring.register_event_duration_secs_listener(
        lambda event, *_, **__: COMPILED.append(event) if "backend_compile" in event else None
    )
    return make_study(count=1, harmonics=48)


@pytest.fixture(scope="module")
def written(study, tmp_path_factory):
    """The reduced page, through the same parts as the command, figures in one width."""
    from omnijax.paper import _reproduce

    folder = tmp_path_factory.mktemp("paper") / HOSTILE
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_reproduce, "make_study", lambda *_: study)
        patch.setattr(_svg, "_narrow", lambda fig, prefix: "")  # figures in one width
        before = len(COMPILED)
        found = _reproduce.reproduce(folder, samples=1)
    COMPILED[:] = COMPILED[before:]
    return folder, found


def test_files(written):
    folder, found = written
    names = {path.name for path in folder.iterdir()}
    assert {f"fig{i:02d}.png" for i in range(7, 15)} <= names
    assert {"index.html", "claims.json"} <= names
    kept = json.loads((folder / "claims.json").read_text("utf-8"))
    assert kept == json.loads(json.dumps(found.to_json()))


def test_errata_are_not_worked_out_operation_by_operation(written):
    """Claims, errata and figures had compiled 305 programs, most of one operation; now 160."""
    assert len(COMPILED) < 200


def test_claims_have_reading_figure_numbers_and_range(written):
    _, found = written
    claims = {claim["id"]: claim for claim in found.to_json()["claims"]}
    assert set(claims) == WANTED
    for claim in claims.values():
        assert claim["verdict"] in (HOLDS, PARTLY, FAILS)
        assert claim["reading"] and claim["decided_by"] and claim["range"]
        for reading in claim["readings"]:
            assert np.isfinite([reading["low"], reading["high"]]).all()
            limit = float(reading["bound"][3:])
            kept = (
                reading["high"] <= limit * (1 + 1e-5)
                if reading["bound"].startswith("<=")
                else reading["low"] >= limit
            )
            assert kept == reading["holds"]


def test_verdicts_that_no_reduction_can_turn(written):
    verdicts = {claim.id: claim.verdict for claim in written[1].claims}
    assert verdicts["linear-velocity"] == verdicts["parabolic-path"] == HOLDS
    assert verdicts["rigid-size"] == HOLDS
    assert verdicts["sinusoidal-quaternion"] == verdicts["peak-frequency"] == PARTLY
    assert verdicts["elastic-smaller"] == PARTLY
    assert verdicts["orders-of-magnitude"] == FAILS


def test_verdict_follows_from_the_readings():
    good, bad = at_most("a", "q", [0.1, 0.2], 0.2), at_least("b", "q", [0.1, 0.2], 0.2)
    assert good.holds and not bad.holds

    def verdict(*readings):
        return Claim("x", "c", "fig07", readings, "range").verdict

    assert verdict(good, good) == HOLDS
    assert verdict(good, bad) == PARTLY
    assert verdict(bad) == FAILS
    with pytest.raises(ValueError, match="finite"):
        at_most("a", "q", [0.1, np.nan], 1.0)


@pytest.mark.parametrize("row", ROWS, ids=[f"eq-{row.equation}-{i}" for i, row in enumerate(ROWS)])
def test_erratum_is_borne_out_and_its_check_fails_when_swapped(row, study):
    assert judge(row, study).confirmed
    swapped = row._replace(reading_printed=row.reading_taken, reading_taken=row.reading_printed)
    assert not judge(swapped, study).confirmed


def test_every_row_of_the_errata_is_there(written):
    equations = " ".join(row.equation for row in written[1].errata)
    for name in (
        "8, 11",
        "3, 41",
        "20, 40",
        "25, 29",
        "42",
        "34",
        "45",
        "46",
        "3.1.3",
        "section 5",
    ):
        assert name in equations


def test_page_is_offline_and_says_how_to_make_it_again(written):
    text = (written[0] / "index.html").read_text("utf-8")
    links = re.findall(r'(?:href|src)="([^"]*)"', text)
    assert links and all(link.startswith(("#", "data:")) for link in links)
    assert "omnijax reproduce --out" in text
    assert "Figure 14" in text and "10<sup>" in text


def test_hostile_folder_name_stays_text(written):
    html = (written[0] / "index.html").read_text("utf-8")
    assert "&lt;script&gt;alert(1)" in html
    assert html.count("<script") == 1


def test_cycle_is_the_run_from_rest_after_its_transient():
    """The closed-form run from rest against the solver, at every damping of the paper."""
    ts = np.linspace(0.0, 1.0, 101)
    for damping in DAMPING[::2]:
        rig = changed(baseline(), {"wheel.contact.damping": damping})
        _, rest = from_rest(rig, 6144)
        run = simulate(rig, speeds(SPEEDS), ts, model="paper", solver="exponential")
        expected = np.stack([np.interp(ts, rest.t, rest.dR[:, i]) for i in range(3)], axis=1)
        np.testing.assert_allclose(run.dR, expected, atol=2e-6)


def test_elastic_part_is_what_the_shape_leaves():
    c = eqx.filter_jit(cycle)(baseline(), "paper", 256, 6144)
    np.testing.assert_allclose(c.dR - c.rigid, c.elastic, atol=2e-6)
    assert float(metrics(c).elastic_peak) > 5e-5


def test_pointwise_form_loses_the_impulse():
    """Integrated twice, the printed r_w'' leaves the wheel 2 pi depths too large after a gap."""
    assert recovered_radius(baseline()) == pytest.approx(2 * np.pi, rel=1e-4)


def test_pointwise_elastic_part_is_several_times_too_small(study):
    run = study.elastic[0.0]
    ratio = np.max(norm(run.cycle.elastic)) / np.max(norm(run.printed))
    assert ratio > 4


def test_printed_closure_pushes_the_sphere_away():
    """Above K k/(K + k) the printed sign has a growing motion, the restoring one has none."""
    rig = changed(baseline(), {"wheel.closure.stiffness": 3e5})
    growth = [
        np.max(np.linalg.eigvals(np.asarray(Pointwise(rig, sign).matrices()[0])).real)
        for sign in (1, -1)
    ]
    assert growth[0] < 0 < growth[1]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--samples", "0"], "`--samples` must be at least 1, but is 0."),
        (["--out", __file__], "is a file, but a folder is to be written there"),
    ],
)
def test_wrong_options_are_refused(options, words, tmp_path, capsys):
    given = options if "--out" in options else [*options, "--out", str(tmp_path)]
    assert run(["reproduce", *given]) == 2
    assert words in capsys.readouterr().err
