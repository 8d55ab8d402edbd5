"""What tells rivals of an axis apart: the noise's colour, the input's reading, nested laws; and
what held-out runs may say of numbers that no train run decides."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.signal import lfilter

from benchmarks.axes.plants import Plant, moved, shown
from omnijax.diagnosis._ode import HoldReading, better_reading, build_model
from omnijax.diagnosis._ode._evidence.experiment import next_run
from omnijax.diagnosis._ode._evidence.learned import learn_shaft
from omnijax.diagnosis._ode._rows.rows import FreeRun, OdeRun
from omnijax.diagnosis._ode.build import priors_of
from omnijax.diagnosis._ode.model import OdeModel
from omnijax.diagnosis._search import Effect, Point, Signatures, refit
from omnijax.diagnosis._search.held_out import HeldOut
from omnijax.diagnosis._search.refits import Refits
from omnijax.diagnosis._search.review import Review
from omnijax.laws import AbstractShaft, BearingViscous, Parameter
from omnijax.machine import Axis, Log, MachineCase, load_machine
from omnijax.report._diagnosis import _learned
from tests.seeds import drawn_anew
from tests.tiers import tiered

pytestmark = pytest.mark.long

STEP = 4e-3
MOTOR = """kind = "axis"
[axis]
inertia = {J}
damping = {J}
[motor]
input = "torque"
[compare]
hold = "{hold}"
[uncertainty]
"axis.inertia" = 0.1
"axis.damping" = 0.5
"""
SERVO = """kind = "axis"
[axis]
inertia = 1
damping = {damping}
[motor]
input = "goal"
resistance = 1
back_emf = 0
torque_constant = 1
[servo]
supply = 1
gain = {gain}
limit = {limit}
[compare]
hold = "held"
[uncertainty]
"axis.damping" = 0.5
"servo.gain" = 0.5
"servo.limit" = 0.5
"""


def case(folder, text, *logs):
    (folder / "machine.toml").write_text(text)
    return MachineCase(folder, load_machine(folder / "machine.toml"), list(logs), False, [])


def logged(role, u, q):
    on = np.ones(len(u))
    inputs = {"input": u, "gain": on, "enable": on}
    return Log(role, role, np.arange(len(u)) * STEP, inputs, {"position": q})


def course(rng, count, size):
    t = np.arange(count) * STEP
    f, p = np.array([0.3, 0.6, 1.0, 1.5]) * rng.uniform(0.9, 1.1), rng.uniform(0, 6, 4)
    return size * sum(np.sin(2 * np.pi * a * t + b) for a, b in zip(f, p, strict=True)) / 2


def motor(rng, folder, effect, hold="linear", held=False):
    """A motor's two logs with what is hidden, as a case that is read as `hold`."""
    J, logs = 10 ** rng.uniform(-4, -2), []
    for role in ("train", "held-out"):
        u = course(rng, 2000, 20 * J)
        scaled = {k: 20 * J * x if k in ("offset", "coulomb") else x for k, x in effect.items()}
        q, *_ = moved(Plant("motor", "torque", J, J), scaled, u, STEP, held)
        logs.append(logged(role, u, q + 2e-4 * rng.normal(size=len(q))))
    return case(folder, MOTOR.format(J=J, hold=hold), *logs)


def refitted(model, id, **values):
    return refit(model, Point(np.zeros(len(model.priors)), (Effect(id, "axis", values),)))


@pytest.mark.parametrize("hidden", tiered(["delay", "lag"], "lag".__eq__))
def test_a_delay_is_told_from_a_lag_where_the_noise_is_weighed_by_its_colour(tmp_path, hidden):
    rng = drawn_anew(hidden)
    model, _, _ = build_model(motor(rng, tmp_path, {hidden: rng.uniform(0.012, 0.016)}))
    late = refitted(model, "actuator-delay", delay=0.014)
    slow = refitted(model, "actuator-lag", tau=0.014)
    right, wrong = (late, slow) if hidden == "delay" else (slow, late)
    assert model.margin(right, wrong) > model.settings.equal_margin
    assert model.margin(wrong, right) < -model.settings.equal_margin


@pytest.mark.full  # in the gate a held input's delay, below
def test_a_lag_shows_how_the_input_is_read(tmp_path):
    rng = drawn_anew("reading")
    held = HoldReading(motor(rng, tmp_path, {"lag": rng.uniform(0.012, 0.016)}, "held"), open=True)
    model, _, _ = build_model(held.case)
    fit = refitted(model, "actuator-lag", tau=0.012)
    better = better_reading(held, {}, model, fit, str)
    assert better is not None and better.hold == "linear"
    model, _, _ = build_model(better.case)
    fit = refitted(model, "actuator-lag", tau=0.012)
    assert better_reading(HoldReading(better.case, open=True), {}, model, fit, str) is None


def test_a_held_input_needs_no_delay_of_half_a_sample(tmp_path):
    rng = drawn_anew("held")
    linear = HoldReading(motor(rng, tmp_path, {}, held=True), open=True)
    model, _, _ = build_model(linear.case)
    fit = refitted(model, "actuator-delay", delay=STEP / 2)
    better = better_reading(linear, {}, model, fit, str)
    assert better is not None and better.hold == "held"


def test_an_offset_is_no_friction_that_differs_by_direction(tmp_path):
    rng = drawn_anew("offset")
    model, _, _ = build_model(motor(rng, tmp_path, {"offset": rng.uniform(0.05, 0.2)}))
    model.places = [("torque-offset", "axis"), ("friction-asymmetry", "axis")]
    review, start = Review(Refits(model), str), Point(np.zeros(2))
    baseline = refit(model, start)
    candidates = model.candidates(baseline.point)
    signatures = Signatures(candidates, model.columns(baseline.point, candidates))
    plain = refitted(model, "torque-offset", torque=0.0)
    better, rivals = review.challenge(plain, 0, signatures)
    assert better is None and not rivals
    wide = refitted(model, "friction-asymmetry", torque=0.0, width=1.0)
    better, _ = review.challenge(wide, 0, signatures)
    assert better is not None and better.point.effects[0].id == "torque-offset"


def test_the_page_shows_what_was_learned_at_an_axis_with_the_size_of_every_value(tmp_path):
    """A learned term of an axis once had no table of its coefficients: its page was a traceback."""
    rng = drawn_anew("learned at an axis")
    hidden = {"coulomb": rng.uniform(0.1, 0.3), "width": 1.0}
    model, _, _ = build_model(motor(rng, tmp_path, hidden))
    fit = refit(model, Point(np.zeros(len(model.priors))))
    term = learn_shaft(model, fit, [], str)
    assert term is not None and term.closed > 0.5
    (section,) = _learned(
        SimpleNamespace(details={"learned": term}, judges=SimpleNamespace(name="held-out runs"))
    )
    (table,) = section.tables
    values, sigmas = (np.concatenate([c[k] for c in term.curves.values()]) for k in (1, 2))
    shown = {(row[2], row[3]) for row in table.rows}
    assert shown == set(zip(values.tolist(), sigmas.tolist(), strict=True))
    assert term.table()["terms"] == term.terms and "knots" in table.caption


def servo(rng, goals, late):
    """(file, logs) of a servo that is at its limit above goals of 0.5, which its file has low."""
    w, logs = rng.uniform(14, 18), []
    plant = Plant("servo", "goal", 1.0, w - 1, gain=w**2, supply=1.0, clip=w**2 / 2)
    for role, size in goals.items():
        goal = size * np.repeat(rng.choice([-1, 1], 10) * rng.uniform(0.7, 1, 10), 200)
        goal = lfilter([0.2], [1, -0.8], goal)
        q = shown({"late": late}, moved(plant, {}, goal, STEP, True)[0], STEP)
        logs.append(logged(role, goal, q + 1e-4 * size * rng.normal(size=len(q))))
    return SERVO.format(damping=w, gain=w**2, limit=0.45 * w**2), logs


@pytest.mark.full  # in the gate confirming: test_diagnosis_null
def test_held_out_runs_judge_no_number_that_train_runs_leave_open(tmp_path):
    rng = drawn_anew("limit")
    text, logs = servo(rng, {"train": 0.2, "held-out": 0.45}, 0.006)
    model, _, _ = build_model(case(tmp_path, text, *logs))
    fit = refit(model, Point(np.zeros(3)), relative=0.01)
    model.rebase(fit.point)
    (before,) = model.residuals([fit.point], "held-out")
    late = Effect("sensor-delay", "position", {"delay": 0.005})
    found = refit(model, fit.point.with_effects(late))
    (after,) = model.residuals([found.point], "held-out")
    assert HeldOut.of(before, after).confirms(fit.cost - found.cost)


@pytest.mark.full  # in the gate how windows begin: test_axis_windows
def test_a_window_begins_with_what_a_late_sensor_shows_of_before(tmp_path):
    rng = drawn_anew("before")
    text, (log,) = servo(rng, {"train": 0.1}, 0.01)
    u, q = log.inputs["input"][215:], log.outputs["position"][215:]
    model, _, _ = build_model(case(tmp_path, text, logged("train", u, q)))
    true = Point(np.zeros(3), (Effect("sensor-delay", "position", {"delay": 0.01}),))
    model.rebase(true)
    (left,) = model.residuals([true], "train")
    assert np.mean(left**2) < 4  # the first samples alone come to hundreds


@pytest.mark.full
@pytest.mark.parametrize("begin", [0, 215], ids=["at rest", "moving"])
def test_a_late_servo_shows_not_whether_its_sensor_or_its_goal_is_late(tmp_path, begin):
    rng = drawn_anew("late servo")
    text, (log,) = servo(rng, {"train": 0.1}, rng.uniform(0.006, 0.012))
    u, q = log.inputs["input"][begin:], log.outputs["position"][begin:]
    half = len(u) // 2
    logs = logged("train", u[:half], q[:half]), logged("held-out", u[half:], q[half:])
    model, _, _ = build_model(case(tmp_path, text, *logs))
    model.places = [("actuator-delay", "axis"), ("sensor-delay", "position")]
    fit = Refits(model).settle(refitted(model, "actuator-delay", delay=0.008))
    candidates = model.candidates(fit.point)
    signatures = Signatures(candidates, model.columns(fit.point, candidates))
    better, rivals = Review(Refits(model), str).challenge(fit, 0, signatures)
    assert better is None and rivals[0][1] < model.settings.near_margin
    wrong, true = rivals[0][0].values["delay"], fit.point.effects[0].values["delay"]
    assert wrong == pytest.approx(true, rel=0.03)


def test_a_guessed_gravity_may_not_be_there():
    axis = Axis(inertia=1.0, gravity=drawn_anew("gravity").uniform(0.1, 3))
    (gravity,) = priors_of(axis, {"gravity": 1.0})
    assert gravity.at(-1.0) == pytest.approx(0.0) and gravity.at(0.5) > 0 and gravity.hard > 1


class Whirls(AbstractShaft):
    """A torque that grows with the cube of the speed: its axis runs away from a speed on."""

    b: jnp.ndarray
    id, formula = "whirls", "shaft torque += b ω³"
    parameters = {"b": Parameter("N m s^3", linear=True)}  # noqa: RUF012

    def __call__(self, signal, state=None):
        return self.b * signal.speed**3


def proposal(*rivals):
    """The next run by which laws (id, value) of one axis would be told apart."""
    t = STEP * np.arange(250)
    axis, inputs = Axis(0.02, damping=0.1), {"input": 2 * np.sin(9 * t)}
    run = OdeRun("run", "train", t, inputs, {"position": 0 * t}, 20.0)
    laws = {"whirls": Whirls, "bearing-viscous": BearingViscous}
    model = OdeModel(axis, [], [run], laws, [(i, "axis") for i in laws],
                     lambda n, r: FreeRun(n, r, 0, 100, 1), 1e-3)  # fmt: skip
    return next_run(model, [Point(np.zeros(0), (Effect(i, "axis", {"b": b}),)) for i, b in rivals])


@pytest.mark.full
def test_an_input_under_which_a_rival_runs_away_is_made_smaller_or_not_proposed():
    """It counted as 0 apart, or those left were compared without a word."""
    held = proposal(("whirls", -1e-6), ("bearing-viscous", 0.01))
    smaller = proposal(("bearing-viscous", 0.01), ("whirls", 4e-4))
    for proposed in (held, smaller):
        assert proposed is not None
        assert len(proposed["compared"]) == 4 and 0 < proposed["separation"] < np.inf
    assert not any("times smaller" in row["drive"] for row in held["compared"])
    assert all("times smaller" in row["drive"] for row in smaller["compared"][::2])
    assert np.max(smaller["torque"]["values"]) <= 2.0
    assert proposal(("bearing-viscous", 0.01), ("whirls", 1e6)) is None


def test_what_another_size_of_a_rival_makes_tells_nothing():
    """Of an axis they were compared as they stood: two sizes of one law would be told apart."""
    b = drawn_anew("sizes").uniform(0.01, 0.1)
    same = proposal(("bearing-viscous", b), ("bearing-viscous", 1.001 * b))
    other = proposal(("bearing-viscous", b), ("whirls", -1e-3 * b))
    assert same["separation"] < 1e-3 * other["separation"]
    assert all(row["separation"] < 0.1 for row in same["compared"])
