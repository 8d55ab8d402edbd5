"""What goes into the diagnosis' elastic model: inputs of any fineness, and smoothed angles."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lsim
from seeds import drawn_anew

from omnijax.diagnosis._machine._candidates.candidates import candidates
from omnijax.diagnosis._machine._candidates.unit_laws import Context
from omnijax.diagnosis._machine._elastic.elastic import rig_modes
from omnijax.diagnosis._machine._elastic.modes import forced, propagate
from omnijax.diagnosis._machine._motion.smooth import smooth
from omnijax.diagnosis._machine._preparation import outliers
from omnijax.diagnosis._machine._preparation.outliers import at_limits, spikes
from omnijax.diagnosis._machine.rig_model import RigModel
from omnijax.laws import EFFECTS
from omnijax.rig import load_rig

STEP, SAMPLES = 0.002, 40


@pytest.fixture(scope="module")
def modes():
    """Modes of the bundled rig."""
    return rig_modes(load_rig("atlas"))


def states(modes, values, intervals):
    """Modal states of the drive forces `values`, from zero, with so many intervals of the time."""
    step = STEP * (SAMPLES - 1) / intervals
    push = forced(modes, step, intervals, drive=values)
    return propagate(modes, step, push, np.zeros(len(modes.rates)))


@pytest.mark.parametrize("parts", [1, 4])
def test_forcing_is_exact_for_inputs_that_are_linear_between_points(modes, parts):
    rng = np.random.default_rng(0)
    values = rng.normal(
        size=((SAMPLES - 1) * parts + 1, modes.B[:, modes.inputs["drive"]].shape[1])
    )
    z = states(modes, values, SAMPLES - 1)
    time = np.linspace(0.0, STEP * (SAMPLES - 1), len(values))
    B = modes.B[:, modes.inputs["drive"]]
    _, _, y = lsim((modes.A, B, np.eye(len(modes.A)), 0 * B), values, time)
    found = np.real(z @ modes.shapes.T)
    assert found == pytest.approx(y[::parts], rel=1e-8, abs=1e-10 * np.abs(y).max())


def test_several_intervals_between_two_points_are_those_of_the_input_refined(modes):
    values = np.random.default_rng(1).normal(size=(SAMPLES, 3))
    fine = states(modes, values, 4 * (SAMPLES - 1))
    coarse = states(modes, values, SAMPLES - 1)
    assert np.abs(fine[::4] - coarse).max() < 1e-12 * np.abs(coarse).max()


def test_an_input_that_is_zero_at_some_wheels_is_pushed_like_the_others(modes):
    values = np.random.default_rng(2).normal(size=(SAMPLES, 3))
    alone = [states(modes, values * (np.arange(3) == k), SAMPLES - 1) for k in range(3)]
    both = states(modes, values, SAMPLES - 1)
    assert np.abs(sum(alone) - both).max() < 1e-12 * np.abs(both).max()
    assert not states(modes, 0 * values, SAMPLES - 1).any()


def test_columns_smoothed_together_are_smoothed_as_if_alone():
    values = np.random.default_rng(3).normal(size=(200, 4)).cumsum(axis=0)
    values[50:60, 1] = np.nan  # its own factorisation
    together, score = smooth(values, 1.0, 1e4)
    alone = [smooth(values[:, [k]], 1.0, 1e4) for k in range(4)]
    assert together == pytest.approx(np.hstack([x for x, _ in alone]), rel=1e-12, abs=1e-10)
    assert score == pytest.approx(sum(s for _, s in alone), rel=1e-12)


@pytest.mark.parametrize("frequency", [250.0, 290.0, 350.0])
def test_what_rings_near_half_the_sampling_rate_is_no_outlier(frequency):
    """A mode that one run alone excites, not yet calibrated: 140 samples of a healthy machine's
    held-out run had been left out as shocks."""
    rng, time = np.random.default_rng(10), 1e-3 * np.arange(3000)
    ringing = 25 * np.exp(-(((time - 2.2) / 0.15) ** 2)) * np.sin(2 * np.pi * frequency * time)
    values = np.stack([ringing, 0 * time], axis=1) + rng.normal(size=(3000, 2))
    assert not spikes(values, 1.0).any()
    wild = {(400, 0): 15.0, (900, 1): -12.0, (2200, 1): 30.0, (2600, 0): 30.0}
    for at, size in wild.items():
        values[at] += size
    values[[1500, 1501], 1] -= 20.0  # two beside each other
    values[100:130] = np.nan
    assert {*zip(*np.nonzero(spikes(values, 1.0)), strict=True)} == {*wild, (1500, 1), (1501, 1)}


@pytest.mark.parametrize("seed", range(6))
def test_sharp_peaks_that_a_sensor_cuts_off_are_no_outliers(seed):
    rng = np.random.default_rng([23, seed])
    time = np.linspace(0, 3, 3000)
    frequencies = rng.uniform(60, 90, 4)
    runs = [
        60 * sum(np.sin(2 * np.pi * f * time + rng.uniform(0, 7)) for f in frequencies)[:, None]
        for _ in range(2)
    ]
    limit = 0.93 * max(np.abs(x).max() for x in runs)
    kept, wild = [], []
    for cut in (True, False):
        noise = [rng.normal(size=x.shape) for x in runs]
        readings = [(np.clip(x, -limit, limit) if cut else x) + e
                    for x, e in zip(runs, noise, strict=True)]  # fmt: skip
        glitch = int(np.argmin(np.abs(runs[0][:, 0])))
        readings[0][glitch] += 40.0
        readings[1][1500] = 0.0 if abs(runs[1][1500, 0]) > 30 else 60.0
        left = [y - x for x, y in zip(runs, readings, strict=True)]
        masks = [spikes(r, 1.0) for r in left]
        at = at_limits(readings, left, masks, 1.0)
        kept.append(sum(m.sum() for m in at))
        wild.append(masks[0][glitch, 0] and not at[0][glitch, 0] and not at[1][1500, 0])
        beyond = [np.abs(x) > limit for x in runs]
        assert not any((m & ~b).any() for m, b in zip(at, beyond, strict=True))
    assert all(wild)
    assert kept[1] == 0
    assert kept[0] > 0


def test_outliers_of_a_run_are_said_once_though_parts_of_it_judge(monkeypatch):
    """A run's parts that are fitted and those kept out of the fit are two views of it."""

    @dataclasses.dataclass
    class View:
        name: str
        time: np.ndarray
        outputs: dict[str, np.ndarray]
        aside: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)

    def mask(*rows):
        return {"a": np.isin(np.arange(30).reshape(10, 3), rows)}

    views = [View(name, np.arange(10.0), {"a": np.ones((10, 3))}) for name in "aab"]
    wild = [mask(3, 4), mask(3, 27), mask(8)]
    monkeypatch.setattr(outliers, "outliers", lambda *_: wild)
    machine: Any = SimpleNamespace(runs=views)
    kept, said = outliers.without_outliers(machine, machine, ("a",))
    assert [np.isnan(run.outputs["a"]).sum() for run in kept] == [2, 2, 1]
    assert said == [
        "a: left out of a_x, a_y: 3 isolated samples more than 8 sigma from the neighbours (at "
        "1.000, 9.000 s): they are not used.",
        "b: left out of a_z: 1 isolated sample more than 8 sigma from the neighbours (at 2.000 s): "
        "it is not used.",
    ]


def test_where_two_rollers_meet_is_an_edge():
    """The contact falls from one roller onto the next, in the middle of a gap: a mistimed impact
    was taken for a shock, eleven times in a healthy run of four seconds."""
    theta = np.linspace(0.0, 0.4, 200)[:, None]

    def slope(angle):
        inside = np.abs(angle - 0.2) < 0.1
        return np.where(inside, np.sign(angle - 0.2) * (1.1 - np.abs(angle - 0.2)), 0.0)

    machine: Any = SimpleNamespace(
        runs=[SimpleNamespace(samples=200)],
        motions=lambda rig, runs: [SimpleNamespace(theta=theta)],
        tables_of=lambda rig: SimpleNamespace(rho_slope=slope),
    )
    edges = outliers.near_edges(machine, machine, 0)
    begins, meet, ends = (int(np.argmax(theta[:, 0] > x)) for x in (0.1, 0.2, 0.3))
    assert edges[[begins, meet, ends]].all() and edges.sum() == 3 * (2 * outliers.EDGE_SAMPLES + 1)


def test_a_friction_that_falls_is_tried_at_shares_of_the_speed_of_the_runs():
    """From 0.1 to 3 rad/s on any machine, a wheel of 30 rad/s was hardly covered."""
    rng, rig = drawn_anew("falling friction"), load_rig("atlas")
    for pace in (*np.exp(rng.uniform(np.log(0.3), np.log(50), 3)), 7.0):
        context = Context(rig, ("theta",), np.ones(3), (), 100, speed=pace)
        made = candidates(context, {"stribeck": EFFECTS["stribeck"]})
        tried = sorted({one.decode([1.0])["speed"] for one in made})
        assert tried[0] == pytest.approx(0.015 * pace) and tried[-1] == pytest.approx(pace / 2)
        for one in made:
            assert {float(p.law.speed) for p in one.columns} == {one.decode([1.0])["speed"]}
    assert tried == pytest.approx([0.1, 0.3, 1.0, 3.0], rel=0.2)
    turning = [SimpleNamespace(speed=rng.normal(size=(50, 3))) for _ in range(2)]
    machine = SimpleNamespace(rig=rig, motions=lambda _: dict(enumerate(turning)))
    pace = RigModel._pace.func(SimpleNamespace(machine=machine))
    assert pace == pytest.approx(np.sqrt(np.mean([m.speed**2 for m in turning])))
