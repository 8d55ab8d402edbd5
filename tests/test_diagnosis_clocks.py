"""Clocks of loggers: a group read a little late is calibrated, a delay beyond that is named."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from seeds import drawn_anew
from test_plant import GROUPS, recorded, runs_of

from benchmarks.hidden_effects import cases, sensors
from omnijax.diagnosis import Point, RigModel, diagnose
from omnijax.diagnosis._machine._elastic.elastic import OUTPUTS, linear_states, outputs_of
from omnijax.diagnosis._machine._elastic.late import late_outputs
from omnijax.diagnosis._machine.clocks import (
    LoggerClock,
    clock_priors,
    late_by,
    offset_of,
    read_late,
    with_clocks,
)
from omnijax.diagnosis._machine.machine import Predicted
from omnijax.diagnosis._search import Effect, tangent_rows, to_project
from omnijax.diagnosis._search.fit import refits_about
from omnijax.diagnosis._settings import SETTINGS
from omnijax.laws import EFFECTS, SensorSignal
from omnijax.rig import load_rig, rig_text

MACHINE = 3  # the benchmark's seed


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """Noise-free short runs of the stated machine, as a model of it."""
    folder = tmp_path_factory.mktemp("clocks")
    plant, _, tables = recorded(folder, 70, 1.5, noise=0.0)
    return RigModel(load_rig(folder / "rig.toml"), runs_of(tables), plant.NOISE, dict(EFFECTS))


def test_a_clock_shifts_a_motion_either_way():
    rng, time = drawn_anew("clock"), 4e-3 * np.arange(800)
    late, f, phase = rng.uniform(-9e-4, 9e-4), rng.uniform(1, 60, 5), rng.uniform(0, 6, 5)

    def wave(t):
        return np.sin(2 * np.pi * np.outer(t, f) + phase)

    law = LoggerClock(jnp.asarray(late))
    values = wave(time) * [1, 2, 1, 1, 1]
    read = values + read_late(law, SensorSignal(jnp.asarray(time), jnp.asarray(values)))
    wanted = wave(time - late) * [1, 2, 1, 1, 1]
    assert read[20:-20] == pytest.approx(wanted[20:-20], abs=0.005)  # at 60 Hz of 125
    slow = np.cos(3 * time)[:, None]
    read = slow + read_late(law, SensorSignal(jnp.asarray(time), jnp.asarray(slow)))
    wanted = np.cos(3 * np.maximum(time - late, 0))
    assert read[:, 0] == pytest.approx(wanted, abs=2e-5)  # the ends too


def test_every_group_but_theta_has_a_clock_unless_the_file_speaks_of_it():
    names = [p.name for p in clock_priors(GROUPS, {"sensor.a.delay"})]
    assert names == ["clock.dR", "clock.Omega"]
    (prior,) = clock_priors(("dR", "theta"), set())
    assert prior.at(prior.hard) == pytest.approx(SETTINGS.prediction.clock_most)
    assert prior.at(-prior.hard) == pytest.approx(-SETTINGS.prediction.clock_most)


def test_a_clocks_tangent_is_the_rate_of_its_group_and_needs_no_run(model, monkeypatch):
    point = Point(np.zeros(len(model.priors)))
    (here,) = model.residuals([point], "train")
    made = []
    monkeypatch.setattr(model.machine, "_linear", lambda *a: made.append(a))
    clocks = [k for k, p in enumerate(model.priors) if p.limited]
    assert [model.priors[k].name for k in clocks] == ["clock.dR", "clock.Omega", "clock.a"]
    moved = [Point(point.u + 1e-3 * np.eye(len(point.u))[k]) for k in clocks]
    changed = [(r - here) / 1e-3 for r in model.residuals(moved, "train")]
    monkeypatch.undo()
    assert made == []  # a reading differs, not the machine
    ((elastic,),) = model.machine.elastic([model.rig_at(point)], [0])
    rows, time = model.machine.rows[0], model.machine.runs[0].time
    rate = CubicSpline(time, elastic, axis=0).derivative()(time)
    rate[:, 3:] = 0.0
    wanted = SETTINGS.prediction.clock_error * rows.project(rows.vector(rate, None))
    assert np.linalg.norm(changed[0] - wanted) < 0.03 * np.linalg.norm(wanted)


def test_a_run_is_known_between_its_samples(model):
    """Exactly in the modes: as a run that is sampled more finely, beside both ends too."""
    machine, run = model.machine, model.machine.runs[0]
    rig = model.rig_at(Point(np.zeros(len(model.priors))))
    ports = machine.ports(rig, 0, machine.rotated(rig, [0])[0])
    modes, fine = machine.modes(rig), 8
    z = linear_states(modes, run, ports, fine)
    wanted = outputs_of(modes, z, ports, OUTPUTS, fine)
    for k in (1, 5, 8, 19, -1, -7, -8, -13):
        late = late_outputs(modes, run, z[::fine], ports.by_name(), k * run.step / fine)
        at = fine * np.arange(run.samples) - k
        known = (at >= 0) & (at < len(wanted))
        error = np.abs(late[known] - wanted[at[known]]).max(axis=0)
        assert np.all(error < 1e-8 * np.abs(wanted).max(axis=0))
        assert np.allclose(late[at < 0], wanted[0], 1e-9, 1e-12)


def test_a_sensor_that_remembers_has_seen_what_rings_between_the_samples(model):
    """A low pass of a tone of 0.37 of the sampling rate is that of the tone, not of its samples."""
    machine, run = model.machine, model.machine.runs[0]
    tone, tau = 2 * np.pi * 0.37 / run.step, 0.8 * run.step
    known = dataclasses.replace(run, outputs={g: 0 * x for g, x in run.outputs.items()})
    machine.replace(0, known)

    def late(seconds):
        return np.cos(tone * (run.time - seconds))[:, None] * np.repeat([0.0, 1.0], 3)

    still = np.zeros((run.samples, 3))
    foretold = Predicted(late(0.0), still, still, still, late)
    rig = model.rig_at(
        Point(np.zeros(len(model.priors)), (Effect("sensor-lag", "a", {"tau": tau}),))
    )
    elastic, _ = machine._left(rig, 0, foretold)
    machine.replace(0, run)
    wanted = np.real(np.exp(1j * tone * run.time) / (1 + 1j * tone * tau))
    assert -elastic[40:, 3] == pytest.approx(wanted[40:], abs=0.03)  # by its samples 0.15 off


def test_a_run_that_runs_away_is_far_and_no_error(model):
    """Friction of any size: where Omega cannot be followed its rows are not finite."""
    law = Effect("load-friction", "w1", {"mu": 1e200, "width": 0.01})
    (left,) = model.residuals([Point(np.zeros(len(model.priors)), (law,))], "train")
    assert not np.any(np.isfinite(left[left != 0])) or not np.isfinite(left @ left)


def test_a_named_delay_stands_alone_and_the_diagnosed_rig_has_no_clock(model):
    u = np.zeros(len(model.priors))
    u[:3] = 1.0
    late = Effect("sensor-delay", "a", {"delay": 4e-3})
    laws = [(p.law.id, p.place) for p in model.rig_at(Point(u, (late,))).at("sensor")]
    assert laws == [("logger-clock", "dR"), ("logger-clock", "Omega"), ("sensor-delay", "a")]
    assert "logger" not in rig_text(model.rig_at(Point(u), clocks=False))
    J = tangent_rows(model, Point(u, (late,)), [], *model.residuals([Point(u, (late,))], "train"))
    size = np.linalg.norm(J[:, :3], axis=0)
    assert size[2] < 1e-5 * size[0]


def test_a_clock_at_its_bound_leaves_what_is_later_to_candidates(model):
    u = np.zeros(len(model.priors))
    u[0], u[5] = model.priors[0].hard, model.priors[5].hard
    J, left = to_project(model, np.ones((4, len(u))), u)
    assert J.shape == (4, len(u) - 1) and len(left) == len(u) - 1
    assert left[4] == model.priors[5].hard  # a part's tolerance is free all the same


def test_rigs_that_are_only_read_otherwise_share_a_prediction(model):
    rig = model.rig_at(Point(np.zeros(len(model.priors))))
    first, second = model.machine.predicted([rig, with_clocks(rig, {"a": 3e-4})], 0)
    assert first is second
    stiffer = model.rig_at(Point(np.eye(len(model.priors))[3]))
    assert model.machine.predicted([stiffer], 0)[0] is not first


@pytest.fixture(scope="module")
def started_anew(model):
    """(model of two fitted runs and one that is not, by run and group how late it was read)."""
    rng, rig, noise = drawn_anew("loggers started anew"), model.rig, model.noise
    first, second = model.machine.runs
    runs = [
        dataclasses.replace(run, name=f"run-{k}", role=role)
        for k, (run, role) in enumerate(((first, "train"), (second, "train"), (first, "held-out")))
    ]
    machine = RigModel(rig, runs, noise, dict(EFFECTS)).machine
    late, read = [], []
    for i, run in enumerate(runs):
        d = {g: rng.uniform(-7e-4, 7e-4) for g in ("dR", "Omega", "a")}
        (known,) = machine.predicted([rig], i)
        out = dict(run.outputs)
        for g in ("dR", "a"):
            out[g] = out[g] + known.read(g, d[g]) - known.read(g, 0.0)
        out["Omega"] = late_by(out["Omega"].T, d["Omega"] / run.step).T
        out = {g: x + noise[g] * rng.normal(size=x.shape) for g, x in out.items()}
        late.append(d)
        read.append(dataclasses.replace(run, outputs=out))
    return RigModel(rig, read, noise, dict(EFFECTS)), late


def test_a_logger_may_be_started_anew_for_every_run(started_anew):
    """One offset for all runs left a gap in a healthy machine, and ends of ranges."""
    model, late = started_anew
    names = [p.name for p in model.priors if p.limited]
    assert names == [f"clock.{g}{x}" for g in ("dR", "Omega", "a") for x in ("", ".run-0")]
    (fit,) = refits_about(model, Point(np.zeros(len(model.priors))), 1)
    model.rebase(fit.point)
    assert fit.chi2 < 1.2 * model.dof("train")
    sigma = SETTINGS.prediction.clock_error * np.sqrt(np.diag(fit.covariance))
    for g in ("dR", "Omega", "a"):
        k = names.index(f"clock.{g}")
        mean, beside = (model.priors[j].at(fit.point.u[j]) for j in (k, k + 1))
        for value, run in ((mean + beside, 0), (mean - beside, 1)):
            assert abs(value - late[run][g]) < 5 * np.hypot(*sigma[k : k + 2]) + 2e-6, (g, run)
        assert abs(model.machine.clocks[2][g] - late[2][g]) < 1e-5 + 5 * sigma[k], g
    (left,) = model.residuals([fit.point], "held-out")
    assert left @ left < 1.2 * model.dof("held-out")


def test_a_held_out_run_without_an_encoder_has_its_own_clock_of_Omega_too(started_anew):
    """Its angles are those of Omega, read as late; it had the mean of the fitted runs."""
    model, late = started_anew
    runs = [
        dataclasses.replace(run, start=run.outputs["theta"][0], outputs={
            **run.outputs, "theta": np.where([True, False, False], np.nan, run.outputs["theta"])
        })
        for run in model.machine.runs
    ]  # fmt: skip
    blind = RigModel(model.rig, runs, model.noise, dict(EFFECTS))
    blind.rebase(Point(np.zeros(len(blind.priors))))
    assert blind.machine.tells_motion("Omega")
    for group, own in late[2].items():
        assert abs(blind.machine.clocks[2][group] - own) < 5e-5, group


def test_what_a_held_out_clock_changes_is_taken_off_its_rows(started_anew):
    model, _ = started_anew
    point = Point(np.zeros(len(model.priors)))
    model.rebase(point)
    rows, rig = model.machine.rows[2], model.rig_at(point)
    assert rows.late is not None and len(rows.late) == 3
    before = model.machine.residuals([rig], [2])[0]
    known = dict(model.machine.clocks[2])
    model.machine.clocks[2] = {g: d + 1e-6 for g, d in known.items()}
    moved = model.machine.residuals([rig], [2])[0] - before
    rows.late, kept = None, rows.late
    there = model.machine.residuals([rig], [2])[0]
    model.machine.clocks[2] = known
    there = there - model.machine.residuals([rig], [2])[0]
    rows.late = kept
    assert np.linalg.norm(moved) < 1e-2 * np.linalg.norm(there)


def test_a_clock_of_a_held_out_run_is_not_taken_off_at_its_bound(started_anew):
    """What is later is a sensor's delay, which held-out runs have to show."""
    model, _ = started_anew
    run = model.machine.runs[2]
    outputs = {**run.outputs, "dR": late_by(run.outputs["dR"].T, 3.0).T}
    runs = [*model.machine.runs[:2], dataclasses.replace(run, outputs=outputs)]
    later = RigModel(model.rig, runs, model.noise, dict(EFFECTS))
    later.rebase(Point(np.zeros(len(later.priors))))
    assert set(later.machine.clocks[2]) == {"Omega", "a"}
    free = later.machine.rows[2].late
    assert free is not None and len(free) == 2
    delayed = Point(np.zeros(len(later.priors)), (Effect("sensor-delay", "dR", {"delay": 5e-3}),))
    later.rebase(delayed)
    assert set(later.machine.clocks[2]) == {"Omega", "a"}
    assert [x.law.id for x in later.machine.at_run(later.rig_at(delayed), 2).at("sensor")] == [
        "logger-clock", "logger-clock", "sensor-delay",
    ]  # fmt: skip


def test_a_run_that_did_not_measure_a_group_has_no_clock_of_it(started_anew):
    model, _ = started_anew
    first, *others = model.machine.runs
    silent = {g: x for g, x in first.outputs.items() if g != "a"}
    runs = [dataclasses.replace(first, outputs=silent), *others]
    some = RigModel(model.rig, runs, model.noise, dict(EFFECTS))
    names = [p.name for p in some.priors if p.limited]
    assert names == ["clock.dR", "clock.dR.run-0", "clock.Omega", "clock.Omega.run-0", "clock.a"]
    u = np.zeros(len(some.priors))
    u[4] = 1.0
    read = some.machine.at_run(some.rig_at(Point(u)), 1)
    late = {g: offset_of(read, g) for g in ("dR", "Omega", "a")}
    assert late == {"dR": 0.0, "Omega": 0.0, "a": SETTINGS.prediction.clock_error}


def test_parts_of_one_run_have_one_clock(model):
    """Of the only run, or of fitted ones beside those that are not."""
    parted, _ = model.parted()
    names = [p.name for p in parted.priors if p.limited]
    assert names == ["clock.dR", "clock.Omega", "clock.a"]
    assert [parted.machine.runs[i].name for i in parted.unfitted] == ["run-1"]


def test_the_benchmark_starts_loggers_anew_and_its_older_seeds_do_not():
    """From a seed on; what older ones drew is compared with their answers."""
    rng = drawn_anew("loggers of seeds")
    new, old = (
        [x for x in (sensors.drawn_noise(rng, 3, True, runs) for _ in range(400))
         if x["fault"] == "clock"] for runs in (2, 0)
    )  # fmt: skip
    assert {np.shape(x["size"]) for x in new} == {(), (2,)}
    assert {np.shape(x["size"]) for x in old} == {()}
    assert sensors.started_anew(sensors.ANEW)
    assert not sensors.started_anew(sensors.ANEW - 1)
    late = cases.drawn(MACHINE, "none")
    runs = len(late.torque)
    late.noise |= {"fault": "clock", "at": "dR", "size": 1e-3 * np.arange(1, runs + 1)}
    out = np.linspace(0.0, 1.0, 201)[:, None] * np.ones(6 + 4 * late.machine.wheels)
    read = [cases.sensed(late, out, [], out[0], k)[100, 0] for k in range(runs)]
    wanted = 0.5 - late.noise["size"] * sensors.FINE / 200
    assert read == pytest.approx(wanted, abs=1e-9)


def diagnosed(folder, late: dict[str, float]):
    """A healthy machine whose groups are read that many s late."""
    case = cases.drawn(MACHINE, "none")
    case.noise |= {"how": "right", "fault": "clock"}

    def read(case, out, *_):
        for group, seconds in late.items():
            out = sensors.shifted(out, sensors.columns_of(group, case.machine.wheels), seconds)
        return out

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cases, "sensed", read)
        tables, _ = cases.recorded(case, [])
    cases.written(folder, case, [], tables)
    return diagnose(folder)


def assert_told(answer, group: str, late: float):
    """The clock of `group` is calibrated, and a note says so."""
    clock = next(b for b in answer.baseline if b["parameter"] == f"clock.{group}")
    assert abs(clock["with_effects"] - late) < 5 * clock["sigma"] + 1e-5
    assert any(n.startswith(f"{group} was read") for n in answer.notes)


def drawn_lateness(group: str) -> float:
    """Seconds that a clock may be off, of either sign."""
    rng = drawn_anew(f"clock of {group}")
    return rng.uniform(2e-4, 7e-4) * rng.choice([-1, 1])


@pytest.mark.full
@pytest.mark.long
@pytest.mark.parametrize("group", ["dR", "Omega", "a"])
def test_a_clock_that_is_off_is_no_effect_and_is_told(group, tmp_path):
    """Alone; beside what is an effect it is in every run of the suite, below."""
    late = drawn_lateness(group)
    answer = diagnosed(tmp_path, {group: late})
    assert answer.verdict == "none", late
    assert_told(answer, group, late)


@pytest.mark.long
@pytest.mark.full
def test_a_delay_beyond_what_clocks_may_be_off_is_named_and_no_clock_is(tmp_path):
    late, off = drawn_anew("late").uniform(3e-3, 6e-3), drawn_lateness("a")
    answer = diagnosed(tmp_path, {"dR": late, "a": off})
    assert [(e.id, e.place) for e in answer.effects] == [("sensor-delay", "dR")], (late, off)
    delay = answer.effects[0].parameters["delay"]
    assert abs(delay["value"] - late) < 5 * delay["sigma"] + 2e-5
    assert_told(answer, "a", off)
