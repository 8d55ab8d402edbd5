"""The benchmark of axes: equal seeds, equal cases, true plants; and what its cases brought up."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from benchmarks.axes.cases import HIDDEN, IDS, _effect, _plant, drawn
from benchmarks.axes.oracle import untold
from benchmarks.axes.plants import Plant, moved, shown
from omnijax.diagnosis._ode import build_model
from omnijax.diagnosis._ode._candidates.together import lines_together
from omnijax.diagnosis._ode.undecided import undecided
from omnijax.diagnosis._search import Effect, Point
from omnijax.laws import AXIS_EFFECTS
from omnijax.machine import Axis, Log, MachineCase, load_machine, parse_machine
from omnijax.machine._simulate import free_run
from tests.seeds import drawn_anew
from tests.test_strangers_axes import run, sines


def test_equal_seeds_draw_equal_axes():
    seed = int(drawn_anew("axes").integers(0, 10**6))
    first, again = drawn(seed), drawn(seed)
    assert (first.effect, first.machine, first.shows) == (again.effect, again.machine, again.shows)
    for a, b in zip(first.tables, again.tables, strict=True):
        assert all(np.array_equal(a[k], b[k]) for k in a)


@pytest.mark.parametrize("kind", HIDDEN)
def test_every_hidden_effect_moves_its_axis_and_has_an_id(kind):
    rng = drawn_anew(kind)
    plant, size, _ = _plant(rng, kind)
    u, step = size * np.sin(np.arange(60) / 6), 5e-3
    bare = np.stack(moved(plant, {}, u, step, True))
    for hidden in HIDDEN[kind]:
        effect = _effect(rng, hidden, plant, bare, 1 / step)
        q = moved(plant, effect, u, step, True)[0]
        assert not np.array_equal(shown(effect, q, step), bare[0]), hidden
        assert all(names & set(AXIS_EFFECTS) for names in IDS[hidden])


@pytest.mark.parametrize("held", [True, False])
def test_two_masses_of_the_plant_move_as_those_of_the_library(held):
    rng = drawn_anew("two masses")
    plant, size, _ = _plant(rng, "two-mass")
    u, step = size * np.cumsum(rng.normal(size=200)) / 10, 2e-3
    q = moved(plant, {}, u, step, held)[0]
    second = {"second_inertia": plant.J2, "second_stiffness": plant.k, "second_damping": plant.c}
    axis = Axis(
        inertia=plant.J, damping=plant.d, torque_constant=plant.K, drives="command", **second
    )
    hold = "held" if held else "linear"
    out = free_run(axis, (), {"position": (0.0, 0.0)}, {"input": u}, step, hold)
    assert np.max(np.abs(out["position"] - q)) < 1e-5 * np.max(np.abs(q))


@pytest.mark.full  # in the gate: test_axis_windows
def test_windows_of_two_masses_with_play_begin_where_they_were(tmp_path):
    rng = drawn_anew("play")
    J, J2, step = 10 ** rng.uniform(-5, -2), rng.uniform(0.5, 2.0), 0.01
    J2, k = J * J2, J * J2 / (1 + J2) * (2 * np.pi * rng.uniform(7, 12)) ** 2
    c = 0.1 * np.sqrt(k * J * J2 / (J + J2))
    plant = Plant("two-mass", "torque", J, J, J2=J2, k=k, c=c)
    t = np.arange(500) * step
    u = 40 * J * sum(np.sin(2 * np.pi * f * t + 6 * rng.random()) for f in (0.4, 1.3, 3.1))
    gap = 0.4 * float(np.std(u)) * J2 / (J + J2) / k
    q, *_ = moved(plant, {"gap": gap}, u, step, False)
    sigma = 0.05 * gap
    (tmp_path / "machine.toml").write_text(
        f'kind = "axis"\n[axis]\ninertia = {J}\ndamping = {J}\n[motor]\ninput = "torque"\n'
        f"[second]\ninertia = {J2}\nstiffness = {k}\ndamping = {c}\n"
        '[uncertainty]\n"second.damping" = 0.1\n'
    )
    log = Log("log", "train", t, {"input": u}, {"position": q + sigma * rng.normal(size=len(q))})
    case = MachineCase(tmp_path, load_machine(tmp_path / "machine.toml"), [log], False, [])
    model, _, _ = build_model(case)
    tried = model.scales.ladder("mount", "gap", None)
    assert min(tried) < gap < max(tried)
    true = Point(np.zeros(1)).with_effects(Effect("mount-backlash", "axis", {"gap": gap}))
    model.rebase(true)
    (left,) = model.residuals([true], "train")
    squares = model.measured.rows[0].squares(
        left
    )  # a window or two may be caught by the play's corners
    noise = len(left) / len(squares) * (sigma / model.noise) ** 2
    assert np.quantile(squares, 0.7) < 2 * noise


def logged(folder, t, u, q, rng):
    """The model of machine.toml in a folder, with a log of torques and of positions with noise."""
    log = Log("log", "train", t, {"input": u}, {"position": q + 1e-5 * rng.normal(size=len(q))})
    case = MachineCase(folder, load_machine(folder / "machine.toml"), [log], False, [])
    model, _, _ = build_model(case)
    return model


def orders_tried(model, point, law):
    """Orders at which the candidates of a law are tried."""
    return np.array([
        float(c.columns[0].law.order) for c in model.candidates(point) if c.id == law
    ])  # fmt: skip


@pytest.mark.parametrize("zero", [0.0, 1000.0])
def test_a_line_is_looked_for_wherever_a_log_was_zeroed(zero):
    """A thousand rad between two zeros counted as travel: orders above 9 were not looked for."""
    rng = drawn_anew("zeroed")
    J, order, step, logs = 10 ** rng.uniform(-3, -1), rng.uniform(25, 35), 2e-3, []
    t = np.arange(4000) * step
    for from_, role in ((0.0, "train"), (zero, "train"), (0.0, "held-out")):
        w, phase = 2 * np.pi * rng.uniform(0.15, 0.25), 6 * rng.random()
        q = np.sin(w * t + phase)
        u = J * -(w**2) * q + J * w * np.cos(w * t + phase) + J * np.cos(order * q)
        shown = q + from_ + 1e-6 * rng.normal(size=len(t))
        logs.append(Log(role, role, t, {"input": u}, {"position": shown}))
    axis = {"kind": "axis", "axis": {"inertia": J, "damping": J}, "motor": {"input": "torque"}}
    model, *_ = build_model(MachineCase(Path(), parse_machine(axis), logs, False, []))
    assert model.measured.resolution == pytest.approx(2 * np.pi / (4 if zero else 2), rel=0.1)
    tried = orders_tried(model, Point(np.zeros(0)), "motor-ripple")
    assert np.min(np.abs(tried - order)) < 0.2 * model.measured.resolution


def test_a_ripple_of_a_torque_that_changes_its_sign_is_looked_for_at_its_order(tmp_path):
    rng = drawn_anew("ripple")
    J, n, step = 10 ** rng.uniform(-4, -2), float(rng.integers(3, 9)), 4e-3
    t = np.arange(1500) * step
    u = 20 * J * np.sin(2 * np.pi * rng.uniform(0.3, 0.5) * t + rng.uniform(0, 6))
    effect = {"ripple": (0.15, n, rng.uniform(0, 6))}
    q, *_ = moved(Plant("motor", "torque", J, J), effect, u, step, False)
    (tmp_path / "machine.toml").write_text(
        f'kind = "axis"\n[axis]\ninertia = {J}\ndamping = {J}\n[motor]\ninput = "torque"\n'
        '[compare]\nhold = "linear"\n[uncertainty]\n"axis.inertia" = 0.1\n"axis.damping" = 0.5\n'
    )
    model = logged(tmp_path, t, u, q, rng)
    tried = orders_tried(model, Point(np.zeros(2)), "current-ripple")
    resolved = 2 * np.pi / np.ptp(q)  # two orders so far apart differ by a wave over the travel
    assert np.min(np.abs(tried - n)) < 0.25 * resolved  # a refit may move it so far


@pytest.mark.full  # in the gate: test_strangers_axes
def test_lines_of_a_motor_are_found_beside_each_other(tmp_path):
    """Slots, then twice the slots, which only the slow rows show, and once a turn.

    Rows stand every 20 ms.  An axis that passes the quick line too fast in more than three of four
    of them hides it: another is drawn.
    """
    rng = drawn_anew("lines of a motor")
    J, step, slow = 10 ** rng.uniform(-4, -2), 2e-3, 0.0
    while slow < 0.25:
        slots = float(rng.integers(8, 12))
        g, (a, b, c) = sines(rng, 0.2, 1.0), rng.uniform(0, 6, 3)

        def moved_by(q, v, u, slots=slots, a=a, b=b, c=c):
            lines = 60 * np.sin(slots * q + a) + 30 * np.sin(2 * slots * q + b)
            return u / J - 2 * v + lines + 25 * np.sin(q + c)

        t, u, q = run(moved_by, lambda t, g=g: 110 * J * g(t), 1 / step, 12)
        slow = np.mean(2 * slots * np.abs(np.gradient(q, step)) < 0.8 * np.pi / 20e-3)
    (tmp_path / "machine.toml").write_text(
        f'kind = "axis"\n[axis]\ninertia = {J}\ndamping = {2 * J}\n[motor]\ninput = "torque"\n'
        '[compare]\nhold = "linear"\ncriterion = "balance"\n'
    )
    model = logged(tmp_path, t, u, q, rng)
    three = lines_together(model.balanced(), Point(np.zeros(0)))
    lines = sorted((e.values["order"], abs(e.values["amplitude"]) / J) for e in three.effects)
    np.testing.assert_allclose(lines, [(1, 25), (slots, 60), (2 * slots, 30)], rtol=0.02)


def test_a_second_inertia_may_start_apart_from_the_first():
    """What a log may begin with, and so free where the oracle asks what a log can tell."""
    plant, size, _ = _plant(drawn_anew("apart"), "two-mass")
    u = size * np.ones(40)
    both, same, other = (
        moved(plant, {}, u, 5e-3, True, start)[0]
        for start in ((0.3, 0.1), (0.3, 0.1, 0.3, 0.1), (0.3, 0.1, 0.2, 0.1))
    )
    assert np.array_equal(both, same)
    assert other[0] == same[0] and np.ptp(other - same) > 1e-3


def test_what_no_log_tells_apart_is_known_by_the_plants_themselves():
    rng = drawn_anew("oracle")
    plant, size, _ = _plant(rng, "motor")
    t = 2 * np.pi * rng.uniform(0.5, 0.7) * np.arange(300) / 100
    u = size * (np.sin(t) + np.sin(2.7 * t))
    seen = {"inputs": [u], "rate": 100.0, "held": False, "plant": plant, "hidden": "lag"}
    case = drawn(3)
    for lag, told in ((1e-3, False), (3e-2, True)):
        position = moved(plant, {"lag": lag}, u, 1e-2, False)[0]
        some = dataclasses.replace(
            case, **seen, effect={"lag": lag}, sigma=1e-4 * float(np.std(position))
        )
        assert bool(untold(some, {"actuator-delay"})) != told
    assert untold(dataclasses.replace(some, hidden="coulomb"), {"actuator-delay"}) == {}


def test_what_is_undecided_is_known_beside_tangents_of_any_size():
    """Squares of tangents that span decades lost what is small, and no root was left."""
    rng = np.random.default_rng(4)
    train, held = rng.normal(size=(60, 3)), rng.normal(size=(40, 3)) @ np.diag([30.0, 1.0, 0.1])
    ways, less = undecided(train, held)
    whole = held @ np.linalg.inv(train.T @ train + np.eye(3)) @ held.T
    sizes, turns = np.linalg.eigh(whole)
    np.testing.assert_allclose(np.sort(less), 1 - 1 / np.sqrt(1 + sizes[-len(less) :]), rtol=1e-9)
    np.testing.assert_allclose(np.abs(ways.T @ turns[:, -1]).max(), 1.0, rtol=1e-9)
    ways, less = undecided(train @ np.diag([1e40, 1.0, 1.0]), held)
    assert np.all(np.isfinite(ways)) and np.all(less > 0)


@pytest.mark.full
def test_a_handful_of_points_goes_one_by_one_and_gives_the_same_rows(tmp_path):
    rng = drawn_anew("handful")
    t = np.arange(400) * 5e-3
    u = 0.5 * np.sin(5 * t + rng.uniform(0, 6))
    (tmp_path / "machine.toml").write_text(
        'kind = "axis"\n[axis]\ninertia = 0.02\ndamping = 0.05\nstiffness = 0.4\n[motor]\n'
        'input = "torque"\n[compare]\nhold = "linear"\n[uncertainty]\n"axis.inertia" = 0.1\n'
    )
    model = logged(tmp_path, t, u, np.sin(5 * t), rng)
    train = model.measured.splits["train"]
    thetas = np.stack([model.numbers.vector(Point(u * np.ones(1))) for u in (-0.5, 0.1, 0.8)])
    few = model.evaluation.values(thetas, train)
    assert {lanes for _, _, lanes in model.evaluation.asked} == {1}
    many = model.evaluation.values(np.repeat(thetas, 3, axis=0), train)
    np.testing.assert_allclose(many[::3], few, rtol=1e-10, atol=1e-13)
