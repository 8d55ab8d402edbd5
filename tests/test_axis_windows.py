"""Windows of free runs: what the right machine leaves of an axis without noise is nothing."""

import dataclasses
import gc
import weakref

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiers import tiered

from benchmarks.axes.plants import Plant, moved
from omnijax.diagnosis._ode._rows import free_starts
from omnijax.diagnosis._ode._rows.numbers import Numbers
from omnijax.diagnosis._ode._rows.programs import Programs
from omnijax.diagnosis._ode._rows.rows import FreeRun, OdeRun, windows
from omnijax.diagnosis._ode.build import cutoff_of
from omnijax.diagnosis._ode.model import OdeModel
from omnijax.diagnosis._search import Effect, Point
from omnijax.laws import AXIS_EFFECTS, AbstractLaw, ShaftSignal
from omnijax.machine import Axis, Log, PlacedLaw, Ports, free_run
from omnijax.machine._steps import EXACT
from tests.seeds import drawn_anew

STEP, NOISE = 4e-3, 1e-3


@pytest.mark.parametrize("held", tiered([True, False], (False).__eq__))
def test_two_masses_leave_nothing_in_any_window(held):
    """Whatever is over when a run is cut into windows: a rest of four samples told no start."""
    rng = drawn_anew("windows")
    J, second, w = 10 ** rng.uniform(-4, -1), rng.uniform(0.3, 3.0), rng.uniform(40.0, 120.0)
    both = J * second / (1 + second)
    plant = Plant("two-mass", "torque", J, J, J2=second * J, k=both * w**2, c=0.1 * both * w)
    axis = Axis(plant.J, plant.d, second_inertia=plant.J2, second_stiffness=plant.k,
                second_damping=plant.c)  # fmt: skip
    length, count = 64, 64 * 8 + 4
    u = 20 * J * np.interp(np.arange(count), np.arange(0, count + 9, 9), rng.normal(size=59))
    q, *_ = moved(plant, {}, u, STEP, held)
    time, on = np.arange(count) * STEP, np.ones(count)
    run = OdeRun("log", "train", time, {"input": u, "gain": on, "enable": on}, {"position": q},
                 20.0, "held" if held else "linear")  # fmt: skip
    model = OdeModel(axis, [], [run], {}, [], lambda n, r: FreeRun(n, r, 0, length, 1), NOISE)
    start = Point(np.zeros(0))
    model.rebase(start)
    (left,) = model.residuals([start], "train")
    assert len(left) == count
    assert np.max(np.abs(left)) < 1e-4 * np.std(q) / NOISE


def test_an_axis_that_forgets_leaves_noise_in_its_first_window_too():
    """A log that begins in motion: the smoothed speed at its end is off by far more than noise."""
    rng = drawn_anew("first window")
    J, w, damping = 10 ** rng.uniform(-4, -1), rng.uniform(20.0, 30.0), rng.uniform(0.4, 0.8)
    d, lead, count = 2 * damping * J * w, 150, 1200
    plant = Plant("slide", "torque", J, d, gravity=J * w**2)
    u = J * w**2 * np.sin(rng.uniform(4.0, 8.0) * np.arange(count) * STEP + 1.0)
    q, *_ = moved(plant, {}, u, STEP, False, (rng.uniform(-0.3, 0.3), rng.uniform(3.0, 6.0)))
    noise = 1e-3 * float(np.std(q))
    time, drawn = np.arange(count) * STEP, rng.normal(size=count)
    run = OdeRun("log", "train", time, {"input": u}, {"position": q + noise * drawn}, 25.0)
    axis = Axis(J, d, gravity=plant.gravity)
    model = OdeModel(axis, [], [run], {}, [], lambda n, r: FreeRun(n, r, lead, 600, 1), noise)
    start = Point(np.zeros(0))
    model.rebase(start)
    (left,) = model.residuals([start], "train")
    # but for what a start of two numbers takes up: chi-square of two degrees, 30 once in 3e6
    assert np.sum((left - drawn) ** 2) < 30


@pytest.mark.parametrize("count", [1, 63, 64, 65, 1956, 2935])
def test_windows_share_a_run_evenly(count):
    """All samples, none twice, none in a rest: they differ by one."""
    sizes = np.diff(windows(count, 64), prepend=0)
    assert sizes.sum() == count
    assert sizes.max() <= 64
    assert np.ptp(sizes) <= 1


def test_programs_go_with_their_model():
    """A process that diagnoses often keeps no program of a diagnosis that has ended."""
    count = 200
    run = OdeRun("log", "train", np.arange(count) * STEP, {"input": np.sin(np.arange(count) / 9)},
                 {"position": np.zeros(count)}, 20.0)  # fmt: skip
    model = OdeModel(Axis(1.0, 0.3), [], [run], {}, [],
                     lambda n, r: FreeRun(n, r, 0, count, 1), NOISE)  # fmt: skip
    start = Point(np.zeros(0))
    model.rebase(start)
    model.residuals([start], "train")
    model.tangents(start, ())
    kept = weakref.ref(model.numbers)
    del model
    gc.collect()
    assert kept() is None


def test_all_splits_share_a_program_and_no_run_hangs_on_its_neighbours():
    """Runs of 3, 5 and 4 windows: a program a split was traced anew, a second or two each."""
    rng = drawn_anew("programs")
    axis, length, runs = Axis(1e-3, 2e-2, stiffness=0.5), 64, []
    for k, (count, role) in enumerate(((150, "train"), (300, "train"), (220, "held-out"))):
        signals = rng.normal(size=(2, count))
        time = np.arange(count) * STEP
        runs.append(OdeRun(f"{k}", role, time, {"input": signals[0]}, {"position": signals[1]},
                           25.0))  # fmt: skip

    def model_of(some):
        return OdeModel(axis, [], some, {}, [], lambda n, r: FreeRun(n, r, 0, length, 1), NOISE)

    model, start = model_of(runs), Point(np.zeros(0))
    rows = np.concatenate([model.residuals([start], s)[0] for s in ("train", "held-out")])
    single = [model_of([dataclasses.replace(r, role="train")]) for r in runs]
    alone = [one.residuals([start], "train")[0] for one in single]
    np.testing.assert_allclose(rows, np.concatenate(alone), rtol=1e-9, atol=1e-9)
    assert [programs[0]._cache_size() for programs in model.evaluation.programs.rows.values()] == [
        1
    ]


def test_the_later_part_of_a_log_has_the_programs_of_its_beginning():
    """Its first step is 3e-13 off by rounding: all programs were traced twice."""
    time, step = np.arange(1000) * 1e-3, []
    for part in (slice(0, 400), slice(400, 1000)):
        run = OdeRun("log", "train", time[part], {}, {"position": time[part]}, 25.0)
        step.append(run.step)
    assert step == [1e-3, 1e-3]


def test_models_of_one_case_share_their_programs():
    """The case with its input read otherwise comes back; each model compiled all anew."""
    rng, count = drawn_anew("shared"), 150
    time, signals = np.arange(count) * STEP, rng.normal(size=(2, count))
    axis, programs, start = Axis(1e-3, 2e-2, stiffness=0.5), Programs(), Point(np.zeros(0))

    def left(hold, some=None):
        run = OdeRun("log", "train", time, {"input": signals[0]}, {"position": signals[1]}, 25.0,
                     hold)  # fmt: skip
        model = OdeModel(axis, [], [run], {}, [], lambda n, r: FreeRun(n, r, 0, 75, 1), NOISE,
                         programs=some)  # fmt: skip
        return model.residuals([start], "train")[0]

    together = [left(hold, programs) for hold in ("linear", "held", "linear", "held")]
    assert [x[0]._cache_size() for x in programs.rows.values()] == [1, 1]
    for rows, hold in zip(together, ("linear", "held") * 2, strict=True):
        np.testing.assert_array_equal(rows, left(hold))
    assert not np.allclose(together[0], together[1])


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_logs_of_several_rates_are_followed_by_the_coarsest(order):
    """The first log alone gave the cutoff and the steps: a slow one after it ran too coarsely."""
    rng, w, logs = drawn_anew("rates"), 60.0, []
    for step in (1e-3, 8e-3):
        time = np.arange(0.0, 4.0, step)
        q, noise = np.sin(3 * time), 1e-4 * rng.normal(size=len(time))
        logs.append(Log("log", "train", time, {"input": q}, {"position": q + noise}))
    logs = [logs[k] for k in order]
    cutoff = cutoff_of(logs, 1e-4)
    assert cutoff == cutoff_of(logs[1:] if order[0] == 0 else logs[:1], 1e-4) < 0.5 / 8e-3
    runs = [OdeRun("log", "train", x.time, x.inputs, x.outputs, cutoff) for x in logs]
    model = OdeModel(Axis(1.0, 0.3, stiffness=w**2), [], runs, {}, [],
                     lambda n, r: FreeRun(n, r, 0, 400, 1), NOISE)  # fmt: skip
    steps = model.evaluation.steps(model.numbers.rest_vector()[None])
    assert steps == [np.ceil(w * 8e-3 / EXACT)]
    assert model.scales.step == 1e-3


@pytest.mark.parametrize("drawn", [True, False])
def test_a_law_that_no_point_has_is_not_evaluated(drawn):
    """All laws ran at every step of every point: six of seven parts of the time."""

    class Loud(AbstractLaw):
        id, port, parameters = "loud", "shaft", {}

        def __call__(self, signal, memory=None):
            return jnp.asarray(np.nan) * signal.speed

    numbers = Numbers(Axis(1.0), (), [(Loud, "axis")])
    theta = numbers.rest_vector()
    theta[0] = float(drawn)

    @jax.jit
    def torque(theta, on, signal):
        placed = numbers.build(theta, None, on)[1]
        return Ports(placed, (None,))("shaft", "axis", signal)

    signal = ShaftSignal(*[jnp.ones(())] * len(ShaftSignal._fields))
    assert np.isnan(torque(theta, numbers.on(theta[None]), signal)) == drawn


def stick_and_slip(rng, noise):
    """A model of an axis of two masses with dry friction, the friction, and its true point."""
    step, friction = 1e-3, {"torque": jnp.asarray(0.06)}
    axis = Axis(2e-3, 2e-3, second_inertia=3e-3, second_stiffness=7.0, second_damping=0.01)
    time, on = np.arange(2400) * step, np.ones(2400)
    sines = [np.sin(2 * np.pi * f * time + 6 * rng.random()) for f in (1.7, 4.1, 7.3)]
    u = {"input": 0.12 * sum(sines), "gain": on, "enable": on}
    placed = (PlacedLaw(AXIS_EFFECTS["bearing-coulomb"](**friction), "axis"),)
    q = np.asarray(free_run(axis, placed, {"position": (0.0, 0.0)}, u, step)["position"])
    run = OdeRun("log", "train", time, u, {"position": q + noise * rng.normal(size=len(q))}, 50.0)
    laws = {"bearing-coulomb": AXIS_EFFECTS["bearing-coulomb"]}
    model = OdeModel(axis, [], [run], laws, [("bearing-coulomb", "axis")],
                     lambda n, r: FreeRun(n, r, 0, 150, 1), noise)  # fmt: skip
    without = Point(np.zeros(0))
    return model, without, without.with_effects(Effect("bearing-coulomb", "axis", {"torque": 0.06}))


def test_no_window_of_stick_and_slip_stays_caught_at_a_start_that_other_laws_drew_away():
    """One of sixteen was left at 1000 to 8000 times the noise, and led all numbers astray."""
    noise = 1e-4
    model, without, true = stick_and_slip(drawn_anew("caught"), noise)
    model.rebase(without)
    model.rebase(true)
    (left,) = model.residuals([true], "train")
    (rows,) = model.measured.rows
    assert isinstance(rows, FreeRun)
    missed = rows.mean_squares(left * noise)
    assert len(missed) == 16
    assert np.max(missed) < 3 * noise**2


def test_windows_begun_anew_are_followed_from_the_starts_that_they_have(monkeypatch):
    """The step after it was taken by the rows of other starts, and made some windows worse."""
    model, _, true = stick_and_slip(drawn_anew("anew"), 1e-4)
    (rows,), evaluation = model.measured.rows, model.evaluation
    theta = model.numbers.vector(true)

    def squares(starts):
        return rows.squares(evaluation.values(theta[None], [0], {0: starts})[0])

    def anew(runs, known, left, tangents):
        left({0: known[0] + far})  # as when openings are fitted
        given.append(known[0])
        return dict(known)

    far, given = np.zeros_like(evaluation.starts[0]), []
    far[:, 1] = 0.3
    monkeypatch.setattr(free_starts, "reopened", anew)
    monkeypatch.setattr(free_starts, "START_STEPS", 1)  # more would mend it
    model.rebase(true)
    (starts,) = given
    assert np.all(squares(evaluation.starts[0]) <= squares(starts) * (1 + 1e-9))
