"""The noise that a residual shows: level, colour, steps; what hangs on a state is no noise."""

import dataclasses
import functools
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter
from seeds import drawn_anew
from tiers import more

from omnijax import InputError
from omnijax.diagnosis._answer import JUDGES, AbstractEvidence, RigEvidence
from omnijax.diagnosis._answer.evidence import Misshapen
from omnijax.diagnosis._answer.experiment import _run
from omnijax.diagnosis._answer.fitted_runs import shown_by_fitted_runs_alone
from omnijax.diagnosis._answer.gap import gaps
from omnijax.diagnosis._answer.shown import Shown, shown_noise
from omnijax.diagnosis._answer.verdict import _excess, _floor, judge, squares
from omnijax.diagnosis._answered import _judged, explained
from omnijax.diagnosis._machine._noise.data_vector import ELASTIC_CHANNELS, DataRows, _filters
from omnijax.diagnosis._machine._preparation.roles import by_parts, with_roles
from omnijax.diagnosis._machine.rig_model import RigModel
from omnijax.diagnosis._machine.runs import Run, with_noise
from omnijax.diagnosis._noise import Assumed, _one, step_of
from omnijax.diagnosis._ode._evidence.evidence import OdeEvidence
from omnijax.diagnosis._ode.model import OdeModel
from omnijax.diagnosis._search import Effect, Point, Search
from omnijax.diagnosis._search.held_out import HeldOut, Trial
from omnijax.diagnosis._search.levels import Level, levels, white_level
from omnijax.diagnosis._search.spectrum import Spectrum
from omnijax.diagnosis._search.where import questions, shares
from omnijax.diagnosis._settings import SETTINGS
from omnijax.rig import load_rig

N, STEP = 4000, 2e-3


def kinds(rng) -> dict[str, np.ndarray]:
    """Noise of several colours, of unit level at the fastest."""
    white = rng.normal(size=N)
    return {
        "white": white,
        "low-pass": white + 0.8 * lfilter([1], [1, -0.9], rng.normal(size=N)),
        "wandering": white + 0.1 * np.cumsum(rng.normal(size=N)),
    }


@pytest.mark.parametrize("colour", ["white", "low-pass", "wandering"])
def test_the_colour_of_noise_is_named_and_its_level_found(colour):
    rng = np.random.default_rng(3)
    runs = [1.3 * kinds(rng)[colour] for _ in range(2)]
    for found, x in zip(levels(runs, noise_only=True), runs, strict=True):
        assert found.colour == colour
        assert found.ratio == pytest.approx(np.sqrt(np.mean(x**2)), rel=1e-6)
        assert found.floor == pytest.approx(1.3, rel=0.12)


def test_white_noise_is_seldom_called_coloured():
    rng = np.random.default_rng(4)
    named = [levels([rng.normal(size=1500)], True)[0].colour for _ in range(300)]
    assert named.count("white") >= 299


def test_the_level_of_noise_under_slow_motion_is_that_of_the_noise():
    rng, time = np.random.default_rng(5), STEP * np.arange(N)
    found = []
    for _ in range(40):
        moving = 300 * np.sin(2 * np.pi * 3 * time) + 0.7 * rng.normal(size=N)
        found.append(white_level(moving)[0] / 0.7)
    assert np.mean(found) == pytest.approx(1.0, abs=0.03)
    assert np.std(found) < 2 * white_level(moving)[1]


def whitened(columns: np.ndarray, level: Level) -> tuple[DataRows, np.ndarray]:
    """The rows of one run whose a_x has a noise of some level, and its columns (n, k) whitened."""
    n, k = columns.shape
    run = Run("r", "train", STEP * np.arange(n), np.zeros((n, 3)), np.zeros((n, 3)),
              {"a": np.zeros((n, 3))}, np.ones(n, bool))  # fmt: skip
    run = with_noise(run, {"a_x": level}, 3)
    rows = DataRows(
        n, np.ones((n, 6)), np.ones((n, 6)), [], filters=_filters(run, ELASTIC_CHANNELS)
    )
    table = np.zeros((k, n, 6))
    table[:, :, 3] = columns.T / level.ratio
    flat = table.reshape(k, -1)
    rows.bleach(flat)
    return rows, flat.reshape(k, n, 6)[:, :, 3].T


def test_coloured_noise_is_whitened_by_its_own_spectrum():
    x = kinds(np.random.default_rng(6))["wandering"]
    white = whitened(x[:, None], levels([x], True)[0])[1][:, 0]
    assert levels([white], True)[0].colour == "white"
    assert np.sqrt(np.mean(white**2)) == pytest.approx(1.0, rel=0.05)


def test_the_mean_of_a_channel_that_wanders_is_not_lost():
    """What is not weighed at all a refit leaves anywhere: an offset of a drift was 2e6 m/s^2."""
    wandering = Level(1.0, 0.01, 1.0, "wandering", Spectrum(1.0, walk=1e-4))
    rows, white = whitened(np.full((N, 1), 0.3), wandering)
    assert 0 < np.linalg.norm(white) < 1e-3 * np.sqrt(N)
    table = np.zeros((N, 6))
    table[:, 3] = white[:, 0]
    assert rows.unwhitened(np.append(table, np.zeros(6 * N)))[:, 3] == pytest.approx(0.3)


def walking(rng, size: float) -> np.ndarray:
    """White noise and a random walk that ends `size` sigma off, from an unknown level."""
    return rng.normal(size=1500) + size * np.cumsum(rng.normal(size=1500)) / np.sqrt(1500)


def low_passed(rng, size: float) -> np.ndarray:
    """Noise that is one for about `size` samples."""
    keep = np.exp(-1 / size)
    return lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.normal(size=1500))


@pytest.mark.parametrize(
    "noise, size",
    [(walking, 6), *more((low_passed, 1), (walking, 1), (low_passed, 6))],
)
def test_numbers_beside_noise_of_a_colour_are_as_far_off_as_is_said(noise, size):
    """Drawn noise and signals: a constant, a slope, and motions slow and quick.

    By Fourier lines the slope beside a walk was six times as far off.
    """
    rng, time = np.random.default_rng([27, size]), np.linspace(0, 1, 1500)
    off = []
    for _ in range(80):
        runs = [noise(rng, size) for _ in range(2)]
        right = above = 0.0
        for x, level in zip(runs, levels(runs, True), strict=True):
            slow = np.cumsum(np.cumsum(rng.normal(size=1500)))
            waves = np.sin(2 * np.pi * rng.uniform([1, 20], [4, 60]) * time[:, None])
            signals = np.column_stack([np.ones(1500), time, slow / np.std(slow), waves])
            both = whitened(np.column_stack([x, signals]), level)[1]
            right = right + both[:, 0] @ both[:, 1:]
            above = above + np.sum(both[:, 1:] ** 2, axis=0)
        off.append(right / np.sqrt(above))
    spread = np.sqrt(np.mean(np.square(off), axis=0))
    assert np.all(spread < 1.4)
    known = spread if noise is low_passed else spread[1:]  # a walk's level nobody knows
    assert np.all(known > 0.75)


def test_a_quantised_channel_is_known_by_its_step():
    rng = np.random.default_rng(7)
    slow = np.cumsum(rng.normal(size=N)) * 1e-4
    assert step_of([4e-4 * np.round(slow / 4e-4)]) == pytest.approx(4e-4)
    assert step_of([slow]) == 0.0


def test_an_encoder_that_turns_fast_is_known_by_its_step_too():
    """Each of its readings is a level of its own: 12 bits were taken for white noise."""
    rng = drawn_anew("a fast encoder")
    step = 2 * np.pi / 2.0 ** rng.integers(10, 15)
    speed = step * np.exp(rng.uniform(np.log(0.3), np.log(15))) * (1 + rng.uniform(0, 0.3, N))
    angle = np.cumsum(speed) + 1e-4 * step * rng.normal(size=N)
    read = step * np.round(angle / step)
    printed = np.array([float(f"{x:.9g}") for x in read])
    assert step_of([printed]) == pytest.approx(step, rel=1e-4)
    assert step_of([np.array([float(f"{x:.9g}") for x in angle])]) < 1e-6  # digits of a file


def test_the_digits_of_a_file_are_no_steps_where_the_noise_is_not_known():
    """They were its noise: a healthy machine without dR_z was `unknown`, hundreds of sigma off."""
    rng = drawn_anew("digits")
    digit, noise = 1e-8, 1e-8 * 10.0 ** rng.uniform(1, 3)
    motion = 1e3 * noise * np.sin(2 * np.pi * 3 * STEP * np.arange(N))
    written = np.round((motion + noise * rng.normal(size=N)) / digit) * digit
    unknown = _one("dR_x", [written], np.nan, np.nan, "unknown", None)
    assert (unknown.source, unknown.colour) == ("unknown", "")
    assert unknown.sigma == pytest.approx(noise, rel=0.2)
    steps = np.round(motion / (10 * noise)) * 10 * noise
    coarse = _one("dR_x", [steps], np.nan, np.nan, "unknown", None)
    assert (coarse.source, coarse.colour) == ("steps", "quantised")
    assert coarse.sigma == pytest.approx(10 * noise / np.sqrt(6), rel=1e-6)


def test_noise_that_wanders_hangs_on_no_state_and_an_order_does():
    rng, time = np.random.default_rng(8), STEP * np.arange(N)
    angle = 3 * time + 1.2 * np.sin(1.1 * time)
    asked = questions(time, {"w1": angle}, {"speed w1": np.gradient(angle, STEP), "time s": time})
    wander = 0.1 * np.cumsum(rng.normal(size=N)) + rng.normal(size=N)
    quiet = shares(wander, asked)
    assert min(a["p"] for a in quiet) > 1e-5
    loud = shares(wander + 5 * np.cos(7 * angle), asked)
    best = min(loud, key=lambda a: a["p"])
    assert (best["domain"], best["value"]) == ("order", 7.0) and best["p"] < 1e-6


def answer(ratio: float, structure: float, after: float, effects=(), trials=()) -> str:
    """The verdict of `judged`."""
    return judged(ratio, structure, after, effects, trials).verdict


def judged(ratio, structure, after, effects=(), trials=(), confirmed_on="held-out", left_out=None,
           bent=()):  # fmt: skip
    """Judged where held-out RMS are 5 before and `after`, the noise shown `ratio`, all assumed."""
    fit = SimpleNamespace(point=SimpleNamespace(effects=effects))
    found = SimpleNamespace(
        fit=fit,
        rivals={},
        significant=True,
        trials=[list(trials)],
        alone={},
        left_out=left_out or {},
    )
    level = Level(ratio, 0.01, ratio)
    shown = Shown(({"a_x": level},), ("held-out",), {"a_x": structure}, ([], []))
    first, last = ([{"a_x": np.full(1000, x)}] for x in (5.0 if effects else after, after))
    return judge(found, shown, first, last, confirmed_on=confirmed_on, bent=bent)


def test_a_gap_that_hangs_on_nothing_is_noise_and_never_unknown():
    assert answer(ratio=1.4, structure=0.0, after=1.4) == "none"
    assert answer(ratio=1.0, structure=0.5, after=1.4) == "unknown"
    assert answer(ratio=1.4, structure=0.0, after=1.4, effects=("x",)) == "named"
    assert answer(ratio=1.0, structure=3.0, after=2.5, effects=("x",)) == "unknown"
    assert answer(ratio=1.0, structure=0.2, after=1.1, effects=("x",)) == "named"


def test_no_law_is_named_beside_which_another_function_of_its_input_is_left():
    bent = [Misshapen("bearing-viscous@w2", "|x| x of w2", 0.09)]
    said = judged(ratio=1.0, structure=0.2, after=1.1, effects=("x",), bent=bent)
    assert said.verdict == "unknown"
    assert "beside bearing-viscous@w2" in said.reason and "9 % of what it explains" in said.reason
    gap = judged(ratio=1.0, structure=3.0, after=2.5, effects=("x",), bent=bent)
    assert "close" in gap.reason and gap.reason.count("|x| x of w2") == 1


def test_of_an_effect_that_was_confirmed_and_left_out_nobody_says_that_none_was_confirmed():
    left_out = {"creep@w1": "it moves no output group's RMS by 1 %"}
    reason = judged(1.4, 0.0, 1.4, left_out=left_out).reason
    assert "creep@w1 (it moves no output group's RMS by 1 %)" in reason
    assert "confirm no effect" not in reason
    assert "confirm no effect" in judged(1.4, 0.0, 1.4).reason


@pytest.mark.parametrize("effects", [(), ("x",)])
def test_no_run_is_said_to_be_held_out_where_none_was(effects):
    who = {"held-out": "held-out runs", "blocks": "kept out of the fit", "nothing": "fitted runs"}
    for on, words in who.items():
        for structure in (0.0, 3.0):
            reason = judged(1.0, structure, 2.5, effects, confirmed_on=on).reason
            assert ("held-out" in reason) == (on == "held-out")
            assert words in reason or "none is left to confirm it" in reason
            assert (on == "nothing") == ("only" in JUDGES[on].fitted)  # there may be several
            assert not (on == "nothing" and "runs confirm" in reason and effects)


def held_out_verdict(columns, structure: float, before=None):
    """The verdict where `columns` by held-out run are left, `a_x` whitened.

    Of an effect that is named without which `before` was left; None where nothing is named.
    """
    evidence = SimpleNamespace(
        model=SimpleNamespace(settings=SETTINGS.search), closing=0.99, alike=0.05,
        confirmed_on="held-out", assumed=lambda c: {"unit": "m/s^2"},
        sigma=lambda c, split, run: 2e-3,
        recorded=lambda: [(f"run {k}", STEP * np.arange(N)) for k in range(len(columns))],
    )  # fmt: skip
    fit = SimpleNamespace(point=SimpleNamespace(effects=() if before is None else ("x",)))
    found = SimpleNamespace(fit=fit, rivals={}, significant=False, trials=[], alone={}, left_out={},
                            baseline=fit)  # fmt: skip
    shown = Shown(tuple({c: Level(1.0, 0.01, 1.0) for c in run} for run in columns),
                  ("held-out",) * len(columns), {"a_x": structure}, ([], []))  # fmt: skip
    before = columns if before is None else before
    return _judged(evidence, found, shown, before, columns, ())  # pyright: ignore


PEAK = np.array([5.0, 6.4, 8.9, 9.7, 7.7, 4.7, 3.9])  # sigma that a sensor at its limit leaves


@pytest.mark.parametrize(
    "added, structure, verdict",
    [(PEAK, 0.06, "unknown"),  # 0.3 sigma RMS at most, as many samples are near nothing
     (-PEAK, 0.06, "unknown"),
     (PEAK, 0.0, "none"),  # it hangs on nothing that was asked: a shock
     (PEAK[2:4], 0.06, "none"),  # two samples are a bad reading
     (PEAK / 3, 0.06, "none"),  # what noise of four thousand samples does
     (0 * PEAK, 0.06, "none")],
)  # fmt: skip
def test_a_stretch_of_a_held_out_run_that_no_noise_explains_is_never_none(
    added, structure, verdict
):
    """Seven samples at a sensor's limit were noise: they move no channel's RMS by 0.3 sigma."""
    rng = np.random.default_rng(209)
    columns = [{"a_x": rng.normal(size=N), "a_y": rng.normal(size=N)} for _ in range(2)]
    columns[1]["a_x"][[5, 6]] = np.nan
    columns[1]["a_x"][1000 : 1000 + len(added)] = added
    judged = held_out_verdict(columns, structure)
    assert judged.verdict == verdict
    if verdict == "unknown":
        assert judged.reason.startswith("held-out runs leave a_x up to ")
        assert "off in run 1, for " in judged.reason and "from 2.002 to 2.008 s" in judged.reason


@pytest.mark.parametrize(
    "moves, structure, verdict",
    [(3.0, 0.06, "unknown"),  # what is named moves hardly more than that there
     (30.0, 0.06, "unknown"),  # a third of what it moves; a right one leaves less
     (200.0, 0.06, "named"),  # within what the prediction of a strong effect may be off
     (3.0, 0.0, "named")],  # a shock
)  # fmt: skip
def test_nothing_is_named_beside_a_stretch_that_it_does_not_explain(moves, structure, verdict):
    """A sensor's limit that the held-out run alone reaches, beside an effect that was found."""
    rng = np.random.default_rng(211)
    columns = [{"a_x": rng.normal(size=N), "a_y": rng.normal(size=N)} for _ in range(2)]
    columns[1]["a_x"][[5, 6]] = np.nan
    columns[1]["a_x"][1000 : 1000 + len(PEAK)] = PEAK
    before = [
        {c: x + moves * np.cos(0.01 * np.arange(N)) for c, x in run.items()} for run in columns
    ]
    judged = held_out_verdict(columns, structure, before)
    assert judged.verdict == verdict
    told = "leave a_x up to" in judged.reason and "from 2.002 to 2.008 s" in judged.reason
    assert told == (verdict == "unknown")


@pytest.mark.parametrize("colour", ["white", "low-pass", "wandering", "of a fat tail", "steps"])
def test_noise_of_any_colour_leaves_no_stretch(colour):
    rng = np.random.default_rng(210)
    for _ in range(10):
        noise = kinds(rng) | {"of a fat tail": rng.standard_t(4, size=N),
                              "steps": 0.5 * np.round(2 * rng.normal(size=N))}  # fmt: skip
        assert held_out_verdict([{"a_x": noise[colour]}], 0.06).verdict == "none"


@pytest.mark.parametrize(
    "elsewhere, before, after, verdict",
    [(40.0, 4.8, 1.16, "unknown"),  # another law's like closes 98 % of that channel
     (40.0, 4.8, 1.02, "named"),  # the law itself
     (40.0, 1.02, 1.0, "named"),
     (20.0, 1.2, 1.16, "unknown"),
     (200.0, 1.2, 1.16, "named")],  # less than 1 % of what the effect moves elsewhere
)  # fmt: skip
def test_a_gap_is_closed_in_every_channel(elsewhere, before, after, verdict):
    fit = SimpleNamespace(point=SimpleNamespace(effects=("x",)))
    found = SimpleNamespace(fit=fit, rivals={}, significant=True, trials=[], alone={}, left_out={})
    level = Level(1.0, 0.01, 1.0)
    shown = Shown(
        ({"theta_1": level, "dR_z": level},), ("held-out",), {"theta_1": 0.0, "dR_z": 0.3}, ([], [])
    )
    first = [{"theta_1": np.full(1000, elsewhere), "dR_z": np.full(1000, before)}]
    last = [{"theta_1": np.full(1000, 1.0), "dR_z": np.full(1000, after)}]
    said = judge(found, shown, first, last)  # pyright: ignore[reportArgumentType]
    assert said.verdict == verdict
    assert ("dR_z" in said.reason) == (verdict == "unknown")


@pytest.mark.parametrize(
    "left, structure, verdict",
    [(2.5, 5.0, "unknown"),  # a quarter of the gap, though held-out runs are explained
     (2.5, 0.0, "named"),  # it hangs on nothing that was asked
     (1.0, 0.0, "named"),
     (1.02, 0.04, "named")],  # 0.2 % of the gap
)  # fmt: skip
def test_nothing_is_named_beside_a_gap_of_the_fitted_runs(left, structure, verdict):
    """Parts of a run are too short to show on what a gap hangs, which the fitted ones show."""
    fit = SimpleNamespace(point=SimpleNamespace(effects=("x",)))
    baseline = SimpleNamespace(point=SimpleNamespace(effects=()))

    def columns(point, split):
        size = 5.0 if point is baseline.point else left if split == "train" else 1.0
        return [{"a_x": np.full(1000, size)}]

    model = SimpleNamespace(settings=SETTINGS.search, residuals=lambda points, _: points)
    evidence = SimpleNamespace(
        model=model, closing=0.99, alike=0.05, confirmed_on="blocks", columns=columns,
        assumed=lambda c: {"unit": "m/s^2"}, sigma=lambda c, split, run: 2e-3,
        recorded=lambda: [("run", STEP * np.arange(1000))],
    )  # fmt: skip
    found = SimpleNamespace(fit=fit, rivals={}, significant=True, trials=[], alone={}, left_out={},
                            baseline=baseline)  # fmt: skip
    level = Level(1.0, 0.01, 1.0)
    shown = Shown(({"a_x": level},) * 2, ("train", "held-out"), {"a_x": 0.0}, ([], []),
                  fitted={"a_x": structure})  # fmt: skip
    first, last = (evidence.columns(x.point, "held-out") for x in (baseline, fit))
    said = _judged(evidence, found, shown, first, last, ())  # pyright: ignore
    assert said.verdict == verdict
    if verdict == "unknown":
        assert said.reason == "the best known effects close 78 % of the gap of the fitted runs"


RIG, AXIS = AbstractEvidence.alike, OdeEvidence.alike


@pytest.mark.parametrize(
    "times, noise, alike, other",
    [(1.4, 1.0, RIG, True),  # the fitted runs gave it another size than it has elsewhere
     (0.6, 1.0, RIG, True),
     (1.05, 1.0, RIG, False),  # sure, but within what a prediction may be off
     (1.4, 30.0, RIG, False),  # no more than the noise leaves open
     (1.0, 1.0, RIG, False),
     (0.7, 1.0, AXIS, False),  # grease warms from log to log
     (0.4, 1.0, AXIS, True)],
)  # fmt: skip
def test_what_held_out_runs_show_at_another_size_is_not_named(times, noise, alike, other):
    rng = np.random.default_rng(9)
    change = np.cos(0.01 * np.arange(N))
    before = times * change + noise * rng.normal(size=N)
    fit = SimpleNamespace(cost=0.0, point=SimpleNamespace(effects=(Effect("x", "w1", {}),)))
    less = SimpleNamespace(cost=float(change @ change) / noise**2)
    found = SimpleNamespace(
        fit=fit, alone={0: (less, 0.0)}, rivals={}, significant=True, trials=[],
        shows={0: HeldOut.of(before / noise, (before - change) / noise)},
    )  # fmt: skip
    level = Level(1.0, 0.01, 1.0)
    shown = Shown(({"a_x": level},), ("held-out",), {"a_x": 0.0}, ([], []))
    columns = [{"a_x": before}]
    verdict = judge(found, shown, columns, columns, alike=alike)  # pyright: ignore
    assert verdict.verdict == ("unknown" if other else "named")
    said = "times what x@w1 foretells" in verdict.reason
    assert said == (other or alike == AXIS), "what is named at another size says so"


@pytest.mark.parametrize(
    "times, size, there",
    [(0.65, 1e5, True),  # friction of a warm gear, a third less than in the fitted logs
     (1.8, 1e5, True),
     (0.35, 1e5, False),  # that is another law
     (0.45, 700.0, False),  # whatever the noise leaves open
     (2.5, 1e5, False),
     (0.65, 25.0, False)],  # 3.3 standard deviations from nothing
)  # fmt: skip
def test_an_axis_may_show_an_effect_at_up_to_twice_its_size(times, size, there):
    held = HeldOut((2 * times - 1) * size, size)
    assert held.confirms(1e5, OdeModel.settings) == there
    assert not held.confirms(1e5), "a rig's prediction is no factor of 1.5 off"


@pytest.mark.parametrize(
    "share, size, verdict",
    [(2.5, 100.0, "unknown"),  # surely there, larger than foretold: another law
     (0.3, 1600.0, "unknown"),  # surely there, at a third of its size: that is not nothing
     (0.3, 100.0, "none"),  # three standard deviations: chance
     (2.5, 4.0, "none"),  # sure, but it moves nothing by one per cent
     (-2.5, 100.0, "none")],
)  # fmt: skip
def test_what_held_out_runs_surely_show_is_never_none(share, size, verdict):
    held = HeldOut((2 * share - 1) * size, size)
    trial = Trial(Effect("drag", "w1", {}), None, 300.0, held)  # pyright: ignore
    assert answer(ratio=1.4, structure=0.0, after=1.4, trials=[trial]) == verdict


@pytest.mark.parametrize(
    "channel, noise_only", [("dR_x", False), ("a_x", False), ("Omega_x", True)]
)
def test_a_gap_is_no_noise_in_channels_of_the_same_state(channel, noise_only):
    """A gap of dR that hangs on a speed shows in `a` too, though on nothing that is asked there."""
    rng = np.random.default_rng(9)
    table = {c: 1.5 * kinds(rng)["wandering"] for c in ("dR_x", "a_x", "Omega_x")}
    stands = {"channel": "dR_x", "stands": True, "share": 0.9, "rms_over_noise": 3.0}
    evidence = SimpleNamespace(
        model=SimpleNamespace(residuals=lambda points, split: [None]),
        steps=lambda split: [],
        columns=lambda residual, split: [table], locate=lambda point: ([], [stands]),
        asks_all=False,
        subsystem=lambda c: RigEvidence.subsystem(None, c), beside_starts=lambda point: [],
    )  # fmt: skip
    shown = shown_noise(evidence, None)
    assert shown.structured == ["dR_x"]
    level = shown.levels[0][channel]
    assert level.colour == ("wandering" if noise_only else "white")
    whole = np.sqrt(np.mean(table[channel] ** 2))
    assert level.ratio == pytest.approx(whole if noise_only else level.floor, rel=1e-6)
    assert (channel in shown.changes[0]) == noise_only


@pytest.mark.parametrize("asks_all, shows", [(True, True), (True, False), (False, True)])
def test_what_only_a_fitted_run_shows_is_no_noise_of_it(asks_all, shows):
    """Its held-out run at rest, a gap of thirty sigma was a noise that was wrongly declared."""
    rng = np.random.default_rng(31)
    quiet = {c: rng.normal(size=N) for c in ("dR_x", "a_x", "Omega_x")}
    loud = {c: x + 3 * kinds(rng)["wandering"] * (c == "dR_x") for c, x in quiet.items()}
    stands = {"channel": "dR_x", "stands": shows, "share": 0.9, "rms_over_noise": 3.0}
    runs = {"train": [quiet, loud], "held-out": [quiet]}
    evidence = SimpleNamespace(
        model=SimpleNamespace(residuals=lambda points, split: [split], tell=str),
        steps=lambda split: [],
        columns=lambda split, _: runs[split], asks_all=asks_all,
        locate=lambda point, split="held-out", run=0: ([], [stands] * (split == "train" and run)),
        subsystem=lambda c: RigEvidence.subsystem(None, c), beside_starts=lambda point: [],
    )  # fmt: skip
    shown = shown_noise(evidence, None)
    told = asks_all and shows
    assert shown.structured == []
    assert shown.structured_in_fitted_runs == ["dR_x"] * told
    assert ("dR_x" in shown.changes[1]) == (not told)
    assert shown.levels[1]["dR_x"].colour == ("white" if told else "wandering")
    assert shown.levels[2]["Omega_x"].ratio == pytest.approx(1.0, abs=0.05)


def test_every_run_that_holds_more_than_white_noise_is_asked_alone():
    rng, asked = np.random.default_rng(32), []
    quiet = {"dR_x": rng.normal(size=N)}
    loud = {"dR_x": kinds(rng)["wandering"]}
    runs = {"train": [quiet, loud], "held-out": [quiet, loud]}

    def locate(point, split="held-out", run=0):
        asked.append((split, run))
        return [], []

    shown_noise(SimpleNamespace(
        model=SimpleNamespace(residuals=lambda points, split: [split], tell=str), asks_all=True,
        steps=lambda split: [],
        columns=lambda split, _: runs[split], locate=locate, subsystem=str,
        beside_starts=lambda point: []), None)  # fmt: skip
    assert asked == [("train", 1), ("held-out", 0)]


@pytest.mark.parametrize(
    "gain, moved, share, left, open_, said",
    [(300.0, 3.0, 1.0, 0.9, [], "moved too little"),  # nine of chi2: three standard deviations
     (300.0, 3.0, 1.0, 0.999, [], ""),  # it matters in no group
     (20.0, 3.0, 1.0, 0.9, [], ""),  # no more than a rival needs
     (300.0, 9.0, 0.0, 0.9, [], ""),  # they tell: it is not there
     (300.0, 9.0, 1.0, 0.9, [], ""),  # they confirm it
     (20.0, 3.0, 1.0, 0.9, ["a_x"], "gap in a_x"),
     (300.0, 3.0, 1.0, 0.9, ["a_x"], "gap in a_x")],
)  # fmt: skip
def test_what_held_out_runs_are_not_moved_by_is_said_of_the_fitted_ones(
    gain, moved, share, left, open_, said
):
    held = HeldOut((2 * share - 1) * moved**2, moved**2)
    trial = Trial(Effect("drag", "w1", {}), SimpleNamespace(residual=left), gain, held)  # pyright: ignore
    model = SimpleNamespace(settings=SETTINGS.search, group_rms=lambda x, split: {"a": x})
    found = SimpleNamespace(trials=[[trial]], fit=SimpleNamespace(residual=1.0))
    evidence = SimpleNamespace(model=model, confirmed_on="held-out")
    shown = SimpleNamespace(structured_in_fitted_runs=open_)
    alone = shown_by_fitted_runs_alone(evidence, found, shown)  # pyright: ignore
    assert (alone is None) == (said == "")
    evidence.confirmed_on = "nothing"  # then no other run was asked
    assert shown_by_fitted_runs_alone(evidence, found, shown) is None  # pyright: ignore
    if alone is not None:
        assert said in alone.said and alone.gap == bool(open_)
        assert ("drag@w1" in alone.said) == (gain > 25)


def of_several_runs(sigmas, samples, gap, rng) -> tuple[RigEvidence, Shown, list]:
    """Evidence of held-out runs of which each has its own noise in dR (None: no dR), in m.

    What they leave is that and `gap` sin(20 t), m.
    """
    runs, left, assumed = [], [], 2e-6
    for sigma, n in zip(sigmas, samples, strict=True):
        time, zero = STEP * np.arange(n), np.zeros((n, 3))
        outputs, level = (
            ({}, {}) if sigma is None else ({"dR": zero}, {"dR": np.full(3, sigma / assumed)})
        )
        runs.append(Run("r", "held-out", time, zero, zero, outputs, np.ones(n, bool), levels=level))
        moved = gap * np.sin(20 * time)
        left.append(
            {}
            if sigma is None
            else {f"dR_{c}": (moved + sigma * rng.normal(size=n)) / sigma for c in "xyz"}
        )
    evidence = RigEvidence.__new__(RigEvidence)
    evidence.noise = {f"dR_{c}": Assumed(assumed, 0.05, "rest", None) for c in "xyz"}
    evidence.model = SimpleNamespace(noise={"dR": assumed}, machine=SimpleNamespace(runs=runs),
                                     splits={"held-out": list(range(len(runs)))})  # fmt: skip
    own = {c: levels([x[c] for x in left if x], gap == 0) for c in left[0]}
    have = [k for k, x in enumerate(left) if x]
    table = tuple(
        {c: x[have.index(k)] for c, x in own.items()} if k in have else {} for k in range(len(runs))
    )
    return evidence, Shown(table, ("held-out",) * len(runs), {}, ([], [])), left


@pytest.mark.parametrize("lacks", [False, True])
def test_a_gap_is_the_rms_of_all_samples_in_its_unit(lacks):
    """The runs' mean noise times their mean misfit in it was another; a run without dR counted."""
    rng = drawn_anew(f"gap of runs, {lacks}")
    sigmas = [*(2e-6 * 10 ** rng.uniform(0, 1.5, 2)), None][: 3 if lacks else 2]
    samples = rng.integers(2000, 9000, len(sigmas))
    evidence, shown, left = of_several_runs(sigmas, samples, 10 ** rng.uniform(-6, -4), rng)
    (gap,) = gaps(evidence, shown, left, left).values()
    sums = [(s**2 * np.sum(np.square([*x.values()])), s**2 * n, n)
            for s, x, n in zip(sigmas, left, samples, strict=True) if s is not None]  # fmt: skip
    missed, noise, count = np.sum(sums, axis=0)
    assert gap.before == gap.after == pytest.approx(np.sqrt(missed / 3 / count), rel=1e-9)
    assert gap.noise_floor == pytest.approx(np.sqrt(noise / count), rel=0.05)


def test_noise_of_a_long_run_weighs_as_much_as_what_is_left_of_it():
    """Pure noise stood out: levels were averaged by run, what is left by sample."""
    rng = drawn_anew("runs of other length")
    long = int(rng.integers(8000, 12_000))
    columns = [1.5 * rng.normal(size=long), rng.normal(size=1000)]
    table = tuple({"dR_x": x} for x in levels(columns, True))
    shown = Shown(table, ("held-out", "held-out"), {"dR_x": 1.0}, ([], []))
    left = squares([{"dR_x": x} for x in columns])
    assert _excess(left, _floor(shown, "held-out", left), "dR_x") == pytest.approx(0.0, abs=1e-6)


def test_a_proposed_run_measures_what_the_runs_did_with_their_noise():
    """Every column of a group was weighed, with one noise: `dR_z` too, of a machine without it."""
    rng, rig = drawn_anew("proposed"), load_rig("atlas")
    lost, low, high = rng.permutation(3)
    level = np.ones(3)
    level[[low, high]] = rng.uniform(0.2, 1), rng.uniform(2, 5)
    angles = np.zeros((9, rig.size))
    angles[:, lost] = np.nan
    done = Run("r", "train", np.arange(9.0), angles, angles, {"dR": angles[:, :3], "theta": angles},
               np.ones(9, bool), levels={"dR": level})  # fmt: skip
    model = SimpleNamespace(noise={"dR": 2e-6, "theta": 1e-4}, groups=("dR", "theta"),
                            machine=SimpleNamespace(runs=[done]))  # fmt: skip
    time = STEP * np.arange(N)
    new = _run(model, rig, "a turn", time, np.outer(np.sin(time), [1.0, 0, 0]))
    for values in new.outputs.values():
        assert np.isfinite(values).all(axis=0).tolist() == [k != lost for k in range(3)]
    shown = np.std(new.outputs["dR"][:, [low, high]], axis=0)
    assert shown == pytest.approx(2e-6 * level[[low, high]], rel=0.1)
    assert new.levels["dR"][[low, high]] == pytest.approx(level[[low, high]])


def run(name: str, role: str, samples: int) -> Run:
    return Run(name, role, STEP * np.arange(samples), np.zeros((samples, 3)),
               np.zeros((samples, 3)), {}, np.ones(samples, bool))  # fmt: skip


def test_roles_are_what_is_said_of_them():
    three = [run("a", "train", 100), run("b", "train", 100), run("c", "held-out", 100)]
    assert with_roles(three) == (three, "held-out", [])
    runs, confirmed, (said,) = with_roles(three[:2])
    assert [r.role for r in runs] == ["train", "held-out"] and confirmed == "held-out"
    assert "no run has the role held-out" in said
    with pytest.raises(InputError, match="every run has the role `held-out`"):
        with_roles([dataclasses.replace(r, role="held-out") for r in three])


def test_one_run_teaches_and_confirms_by_parts_or_not_at_all():
    (teaches, confirms), confirmed, _ = with_roles([run("a", "train", N)])
    assert confirmed == "blocks"
    assert (teaches.role, confirms.role) == ("train", "held-out")
    assert np.all(teaches.counts ^ confirms.counts)
    assert np.mean(confirms.counts) == pytest.approx(1 / 3, abs=0.1)
    (teaches, confirms), confirmed, (said,) = with_roles([run("a", "train", 1200)])
    assert confirmed == "blocks" and "part of 0.4 s" in said  # a sixth of a short run
    assert np.mean(confirms.counts) == pytest.approx(1 / 3, abs=0.01)
    (only,), confirmed, (said,) = with_roles([run("a", "train", 700)])
    assert confirmed == "nothing" and only.counts is None and "nothing is kept out" in said


def test_fitted_runs_play_both_roles_by_parts_beside_held_out_ones():
    long, short, held = run("a", "train", N), run("b", "train", 700), run("c", "held-out", N)
    (teaches, confirms, whole, last), (said,) = by_parts([long, short, held])
    assert [r.role for r in (teaches, confirms)] == ["train", "held-out"]
    assert np.all(teaches.counts ^ confirms.counts) and "a: every third part" in said
    assert whole == short and last == held
    assert by_parts([short, held]) == ([short, held], [])


@pytest.mark.parametrize(
    "before, left, noise_only",
    [
        (9.0, 1.0, True),
        (9.0, 1.5, False),
        (900.0, 1.05, True),
        (900.0, 9.0, False),
        (1.1, 1.2, False),
    ],
)
def test_next_to_nothing_of_a_strong_gap_is_noise(before, left, noise_only):
    """Noise assumed two per cent too small is no reason to search again from a runner-up."""
    rows = 20_000
    search = Search(SimpleNamespace(dof=lambda split: rows, settings=SETTINGS.search))
    search.begun = before * rows, before * rows
    assert search.floor_reached(SimpleNamespace(chi2=left * rows), left * rows) == noise_only
    assert not search.floor_reached(SimpleNamespace(chi2=left * rows), 50.0 * before * rows)


@pytest.mark.parametrize("everywhere", [True, False])
def test_noise_is_explained_by_what_held_out_runs_show_too(everywhere):
    """What wanders leaves a drift in every run, but in each another one: that explains nothing."""
    rng = np.random.default_rng(7)
    change, white = 0.5 * np.linspace(-1, 1, N), rng.normal(size=N)
    before = white + (change if everywhere else -0.3 * change)
    trial = SimpleNamespace(gain=300.0, held=HeldOut.of(before, before - change))
    model = SimpleNamespace(settings=SETTINGS.search, dof=lambda split: N)
    way = SimpleNamespace(trials=[[trial]])
    assert explained(model, way) == everywhere  # pyright: ignore[reportArgumentType]


def drifting(
    walks: bool, seed: int, runs: int, gain: float, corner: float, n: int = 1500
) -> list[np.ndarray]:
    """Columns of noise with a straight drift, the same in all runs, or with random walks.

    The noise is white, or falls above a `corner` in cycles a sample; its sigma is 1.
    """
    rng, t = np.random.default_rng([11, seed]), np.linspace(-1, 1, n)
    noise = rng.normal(size=(runs, n))
    if corner:
        kept = np.exp(-2 * np.pi * corner)
        noise = lfilter([1 - kept], [1, -kept], rng.normal(size=(runs, 2 * n)), axis=1)[:, n:]
        noise /= noise.std()
    if not walks:
        return [x + t * np.sqrt(gain / runs / (t @ t)) for x in noise]
    steps = np.cumsum(rng.normal(size=(runs, n)), axis=1) * np.sqrt(6 * gain / runs) / n
    return [*(noise + steps - steps.mean(axis=1, keepdims=True))]


def taken_for_noise(refitted: list[np.ndarray], columns: list[np.ndarray]) -> bool:
    """`RigModel.as_noise` of a drift beside another effect, by what is left of its channel.

    `refitted` without the drift, `columns` less it with the other effect's numbers as with it.
    """
    t = np.linspace(-1, 1, len(columns[0]))
    b = sum(t @ x for x in columns) / (len(columns) * t @ t)
    drift, other = Effect("sensor-drift", "a_y", {}), Effect("sensor-lag", "a", {"tau": 0.01})
    less = Point(np.zeros(1), (dataclasses.replace(other, values={"tau": 0.02}),))
    fit = Point(np.zeros(1), (other, drift))
    straight = [x - b * t for x in columns]
    left = ((less, refitted), (fit, straight), (fit.with_effects(other), columns))
    whole = SimpleNamespace(
        _steps=[],
        _whole=lambda p, c: next(x for q, x in left if q.effects == p.effects),
        settings=SETTINGS.search,
    )
    points = (SimpleNamespace(point=p) for p in (less, fit))
    return RigModel.as_noise(whole, *points, drift)  # pyright: ignore[reportArgumentType]


def test_what_other_numbers_leave_is_no_sign_of_a_drift():
    """The refit without it moved them by noise of another colour: it leaves twice as much."""
    rng = np.random.default_rng(13)
    noise, walks = rng.normal(size=(2, 1500)), np.cumsum(rng.normal(size=(2, 1500)), axis=1) / 20
    assert taken_for_noise([*(noise + 2 * walks)], [*(noise + walks)])


@pytest.mark.parametrize(
    "runs, gain, corner",
    [(1, 1000.0, 0.0), (3, 1e5, 0.02), *more((3, 300.0, 0.0), (1, 1e5, 0.02), (2, 1e8, 0.005))],
)
def test_a_channel_that_wanders_is_no_drift_and_a_drift_is_one(runs, gain, corner):
    """Whatever the colour of the noise beside it, which is strong at low frequencies itself."""
    kept = {}
    for walks in (False, True):
        each = []
        for seed in range(20):
            columns = drifting(walks, seed, runs, gain, corner)
            each.append(not taken_for_noise(columns, columns))
        kept[walks] = np.mean(each)
    assert kept[True] == 0.0
    assert kept[False] >= 0.9


def test_the_parts_of_the_only_run_make_one_column_again():
    run = Run("run", "train", np.arange(9.0), *[np.zeros((9, 3))] * 2, {}, np.ones(9, bool))
    parts = [dataclasses.replace(run, counts=np.arange(9) % 3 < 2),
             dataclasses.replace(run, counts=np.arange(9) % 3 == 2)]  # fmt: skip
    column = np.arange(54.0).reshape(9, 6)
    rows = [
        DataRows(9, np.ones((9, 6)) * p.counts[:, None], np.zeros((9, 0)), []) for p in parts
    ]  # fmt: skip
    machine = SimpleNamespace(rows=rows, runs=parts, residuals=lambda rigs, which: [column.ravel()])
    model = SimpleNamespace(
        machine=machine, splits={"train": [0], "held-out": [1]}, rig_at=lambda point: None
    )
    model._by_run = functools.partial(RigModel._by_run, model)  # pyright: ignore
    (whole,) = RigModel._whole(model, None, 4)  # pyright: ignore
    assert whole == pytest.approx(column[:, 4])
