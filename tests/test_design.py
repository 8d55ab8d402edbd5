"""The design engine on problems whose optimum is known in closed form."""

import dataclasses
import importlib
import math
import random
import re
import threading
import time

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq
from tiers import tiered

import omnijax
from omnijax._errors import DataWarning, RunError
from omnijax._text import estimate, quantity_text
from omnijax.rig import InputError
from omnijax.study import Design, Front, Limit, Problem, Variable, optimise, parse_study, trade_off
from omnijax.study._constraints import CaseNames, CaseResult, Constraint, all_limits, all_values
from omnijax.study._design._search.engine import Engine
from omnijax.study._design._search.evolve import Rank, evolve, far_apart
from omnijax.study._design._search.in_step import in_step
from omnijax.study._design._search.judge import best_of, check_optimality
from omnijax.study._design._search.search import Adam
from omnijax.study._design._search.sqp import SqpSlopes
from omnijax.study._design.answer import make_design
from omnijax.study._design.cases import RigCases
from omnijax.study._design.design import start_note
from omnijax.study._design.notes import solver_note
from omnijax.study._study_folder import Folder
from omnijax.vibration import peak, smooth_peak

pytestmark = pytest.mark.brief

NO_LIMITS = jnp.zeros(0)


def quadratic(x, _):
    f = (x[0] - 2) ** 2 + 2 * (x[1] + 1) ** 2 + 1
    return f[None], jnp.array([1.5 - x[0] - x[1]])


BOUNDED = Problem(
    (Variable("x", 0.0, 1.0), Variable("y", 0.0, 3.0, unit="N")),
    quadratic,
    (Limit("sum", 0.0, 1.0),),
)


@pytest.fixture(scope="module")
def bounded():
    return optimise(BOUNDED, starts=3, batch=3)


def test_convex_with_active_bound_and_limit(bounded):
    """x = 1 (its bound), y = 1/2 (the limit): f = 6.5, df/dy = 6 is the limit's price."""
    assert bounded.optimal
    assert bounded.agreement == (3, 3)
    assert np.allclose(list(bounded.variables.values()), [1.0, 0.5], atol=1e-5)
    assert math.isclose(bounded.objective, 6.5, rel_tol=1e-5)
    assert bounded.active == ("`x` is at its upper bound 1.", "`sum <= 0` is active.")
    price = re.search(r"relaxing `sum <= 0` by 1 buys ([\d.]+)", "\n".join(bounded.multipliers))
    assert price and math.isclose(float(price[1]), 6.0, rel_tol=1e-3)
    # dL/dx = -2 - 6: raising the bound by 1 % buys 0.08
    assert "raising the upper bound of `x` by 1 % buys 0.08 of objective." in bounded.multipliers


def test_a_design_at_its_bound_lies_within_it():
    """By rounding of a log scale it lay beyond: no start of another search."""
    problem = Problem(
        tuple(Variable(f"x{i}", 3e5, high, log=True) for i, high in enumerate((3e6, 7e6, 1.1e7))),
        lambda x, _: (-jnp.sum(jnp.log(x))[None], NO_LIMITS),
    )
    best = optimise(problem, starts=2, batch=2)
    assert list(best.variables.values()) == pytest.approx([3e6, 7e6, 1.1e7], rel=1e-12)
    begun = (v._replace(start=best.variables[v.name]) for v in problem.variables)
    assert optimise(problem._replace(variables=tuple(begun)), starts=1).optimal


def test_an_optimum_at_a_bound_before_which_all_is_flat():
    """The search stopped at 1e-3 of the range, and no other start agreed with what it left."""
    flat = Problem((Variable("x", 0.0, 2.0),), lambda x, _: (x[:1] ** 4, NO_LIMITS))
    best = optimise(flat, starts=3)
    assert best.variables == {"x": 0.0} and best.objective == 0.0
    assert best.optimal and best.agreement == (3, 3)
    assert best.active == ("`x` is at its lower bound 0.",)


def test_starts_agree_on_an_optimum_of_zero():
    best = optimise(
        Problem((Variable("x", -1.0, 2.5),), lambda x, _: ((x[:1] - 1) ** 2, NO_LIMITS)), starts=4
    )
    assert best.objective < 1e-8 and best.agreement == (4, 4)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (5e-4, 0.0, "That is 100 % less rms than your rig: from 0.5 to 0 mm."),
        (0.0, 5e-6, "That is more rms than your rig: from 0 to 5 µm."),
    ],
)
def test_a_gain_from_or_to_zero(bounded, old, new, told):
    """It said 0 % more than an old 0, and the unit was that of the new 0."""
    was = {"name": "rms", "old": old, "new": new, "cases": {}, "variables": {}}
    best = dataclasses.replace(bounded, objective_name="rms", unit="m", was=was)
    assert best.headline().endswith(told)


def test_searches_are_ranked_best_first(bounded):
    """Whatever meets the limits by its objective, then the others by what they miss."""
    ends = bounded.ends | {
        "objective": [7.0, 1.0, 6.5, 2.0], "violation": [0.0, 0.5, 0.0, 0.2],
        "status": ["not optimal", "infeasible", "optimal", "infeasible"],
    }  # fmt: skip
    ranked = dataclasses.replace(bounded, ends=ends)
    assert list(ranked.ranking) == [2, 0, 3, 1]
    seen = [y for line in ranked.plot_searches().lines[:-1] for y in line.get_ydata()]
    assert sorted(seen) == [1.0, 2.0, 6.5, 7.0]


def test_design_survives_saving(bounded, tmp_path):
    bounded.save(tmp_path / "design.nc")
    assert Design.load(tmp_path / "design.nc") == bounded
    assert repr(bounded).startswith("Build it with x 1 and y 0.5 N.")
    assert "objective = 6.5: optimal" in repr(bounded)
    assert "<td>y</td><td>0.5</td><td>N</td>" in bounded._repr_html_()
    assert list(bounded.to_xarray()["variable_unit"].values) == ["1", "N"]
    assert bounded.plot_searches().get_title(loc="left") == "3 searches: optimal"


def absorber(mass_ratio: float) -> Problem:
    """Two masses (Den Hartog): worst amplitude of the main mass over the driving frequency."""
    g = jnp.linspace(0.6, 1.4, 161)

    def figures(x, _):
        f, damping = x
        a = f**2 - g**2
        b = 2 * damping * f * g
        down = 1 - g**2 * (1 + mass_ratio)
        over = mass_ratio * f**2 * g**2 - (g**2 - 1) * (g**2 - f**2)
        return jnp.sqrt((a**2 + b**2) / (over**2 + (b * down) ** 2)), NO_LIMITS

    names = tuple(f"g = {x:.3f}" for x in np.asarray(g))
    variables = (Variable("tuning", 0.6, 1.2), Variable("damping", 0.02, 0.6, log=True))
    return Problem(variables, figures, worst=True, cases=names, name="amplitude")


def test_two_mass_absorber_against_the_closed_form():
    """Den Hartog: tuning 1/(1 + mu), fixed points at sqrt(1 + 2/mu), damping sqrt(3 mu/8/(1 + mu)).

    His damping averages two that are each exact for one of the peaks, so that the true optimum's
    amplitude is within 1 % of sqrt(1 + 2/mu), never below it, and its damping within 5 %.
    """
    mu = 0.2
    found = optimise(absorber(mu), starts=3, batch=3)
    fixed = math.sqrt(1 + 2 / mu)
    assert found.optimal, found.reason
    assert fixed * (1 - 1e-3) < found.objective < 1.01 * fixed
    assert math.isclose(found.variables["tuning"], 1 / (1 + mu), rel_tol=0.01)
    assert math.isclose(
        found.variables["damping"], math.sqrt(3 * mu / (8 * (1 + mu))), rel_tol=0.05
    )
    assert "worst cases that hold the optimum" in found.multipliers[-1]


def stepped(x, _):
    f = (x[0] - 2.3) ** 2 + (x[1] - 3.6 - 0.3 * x[0]) ** 2 + 1
    return f[None], NO_LIMITS


@pytest.mark.parametrize("high", [8, 40])
def test_whole_numbers(high):
    """Enumerated (8 of them) or relaxed and rounded (40): the same optimum, by hand n = 4."""
    variables = (Variable("x", 0.0, 4.0), Variable("n", 1, high, whole=True))
    found = optimise(Problem(variables, stepped), starts=2, batch=16 if high == 8 else 4)
    best = min(
        ((x - 2.3) ** 2 + (n - 3.6 - 0.3 * x) ** 2 + 1, x, n)
        for n in range(1, 9)
        for x in np.linspace(0, 4, 4001)
    )
    assert found.optimal
    assert found.variables["n"] == best[2] == 4
    assert math.isclose(found.objective, best[0], rel_tol=1e-6)


def test_conflicting_constraints_are_named():
    """Least violation in units of the limits' scales 1 and 4: x - 1 = (2 - x)/4 at x = 1.2."""

    def figures(x, _):
        return (x[0] ** 2)[None], jnp.array([x[0] - 1, 2 - x[0], x[0] - 9])

    scales = {"below 1": 1.0, "above 2": 4.0, "below 9": 1.0}
    limits = tuple(Limit(name, 0.0, scale, "N") for name, scale in scales.items())
    found = optimise(Problem((Variable("x", 0.0, 4.0),), figures, limits), starts=2, batch=2)
    assert found.status == "infeasible" and not found.optimal
    both = "`below 1 <= 0 N` is missed by 0.2 N and `above 2 <= 0 N` is missed by 0.8 N"
    assert both in found.reason and "below 9" not in found.reason


def test_an_island_among_ripples():
    """The one feasible island, next to 0.45 in four variables, is a millionth of the space, and
    slopes lead to the nearest of 4096 ripples: no search would find it but for evolved starts, and
    long steps leave it again.  The least sum of the variables is on its diagonal."""

    def ripple(d):
        return 4 * (d**2 + 0.02 * (1 - np.cos(16 * np.pi * d)))

    def figures(x, _):
        d = x - 0.45
        wave = 1 - jnp.cos(16 * jnp.pi * d)
        return jnp.sum(x)[None], jnp.sum(d**2 + 0.02 * wave)[None]

    variables = tuple(Variable(f"x{i}", 0.0, 1.0) for i in range(4))
    problem = Problem(variables, figures, (Limit("ripple", 0.01, 0.01),))
    found = optimise(problem, starts=3, batch=3)
    assert found.ends["status"] == ["optimal"] * 3 and found.agreement == (3, 3)
    edge = brentq(lambda d: ripple(d) - 0.01, 0, 1 / 16)
    assert math.isclose(found.objective, 4 * (0.45 - edge), rel_tol=1e-6)


def test_evolved_starts_are_feasible_and_apart():
    """cos(6 pi x) >= 0.9 in four variables and the fifth held: none of 64 designs is feasible,
    after evolution enough are; those taken lie apart, and the held variable has not moved."""

    def judged(x):
        over = np.maximum(0.9 - np.cos(6 * np.pi * x[:, :4]), 0.0).sum(axis=1)
        return Rank(over, x.sum(axis=1))

    drawn = np.random.default_rng(3).random((64, 5))
    drawn[:, 4] = 0.3
    assert judged(drawn).feasible == 0
    moved, rank = evolve(drawn, np.array([1, 1, 1, 1, 0]), judged, 8, 100, 0)
    assert rank.feasible >= 8 and np.all(moved[:, 4] == 0.3)
    assert np.array_equal(rank.violation, judged(moved).violation)
    chosen = far_apart(moved, rank, 3)
    assert np.all(rank.violation[chosen] == 0) and len(set(chosen)) == 3
    assert chosen[0] == rank.order()[0]


def test_as_many_searches_start_as_are_asked_for():
    """Of more than 64 starts there were 64, without a word."""
    assert len(Engine(BOUNDED, 100, 0).lanes.share) == 100


@pytest.mark.parametrize("size", [1e-6, 1e3])
def test_a_bound_of_zero_is_held_in_the_size_of_its_quantity(size):
    """It was held to 1e-5 of a unit: `rms <= 0` passed at 10 um, and its price was of a metre."""
    limits = tuple(Constraint("rms", high=0.0).limits(("rms",), "m", ""))
    x = (Variable("x", -1.0, 1.0),)

    def reached(least):
        """x^2 under g = size (x - least): the limit is met from `least` downwards."""

        def figures(x, _):
            return ((x[0] - 1) ** 2)[None], size * (x - least)

        return optimise(Problem(x, figures, limits), starts=2)

    none, best = reached(-1.01), reached(0.5)
    assert none.status == "infeasible"
    assert f"`rms <= 0 m` is missed by {'10 nm' if size < 1 else '10 m'}" in none.reason
    assert best.optimal and math.isclose(best.variables["x"], 0.5, rel_tol=1e-4)
    assert math.isclose(best.prices["rms <= 0 m"], 1 / size, rel_tol=1e-3)


def test_what_the_adaptive_solver_says_of_limits():
    """A design without any was said to meet every one of them."""
    best = optimise(BOUNDED, starts=1)
    f, g = np.array([6.5]), np.array([0.0])
    assert solver_note(BOUNDED, f, g, best).endswith(" %); it meets every limit.")
    assert solver_note(BOUNDED, f, g + 0.25, best).endswith("`sum <= 0` is missed by 0.25.")
    free = BOUNDED._replace(limits=())
    assert solver_note(free, f, g[:0], best).endswith(" %).")


def nowhere_finite(x, _):
    """A limit whose figure is not finite, beside an objective that is."""
    return ((x[0] - 1) ** 2)[None], jnp.array([x[0], jnp.log(-1 - x[0])])


def test_what_is_not_finite_is_named():
    """It was the objective, whatever it was."""
    limits = Limit("share", 2.0, 1.0), Limit("logarithm", 3.0, 3.0)
    problem = Problem((Variable("x", 0.0, 1.0),), nowhere_finite, limits)
    with pytest.raises(InputError, match=r"^`logarithm <= 3` is not finite at any start: widen"):
        optimise(problem, starts=1)

    def no_objective(x, _):
        return jnp.log(-1 - x[:1]), jnp.array([x[0], x[0]])

    with pytest.raises(InputError, match=r"^the objective is not finite at any start"):
        optimise(problem._replace(figures=no_objective), starts=1)
    engine = Engine(problem._replace(figures=lambda x, _: (x[:1] ** 2, jnp.tile(x, 2))), 1, 0)
    share = np.array([[0.5]])
    for parts, said in (
        (SqpSlopes(*map(np.array, ([1.0], [1.0, np.nan], [[1.0]], [[1.0], [np.nan]]))),
         "`logarithm <= 3` is not finite there"),
        (SqpSlopes(*map(np.array, ([np.nan], [1.0, 1.0], [[1.0]], [[1.0], [1.0]]))),
         "the objective is not finite there"),
        (SqpSlopes(*map(np.array, ([np.inf], [np.nan, 1.0], [[1.0]], [[1.0], [1.0]]))),
         "the objective and `share <= 2` are not finite there"),
        (SqpSlopes(*map(np.array, ([np.nan], [np.nan, np.nan], [[1.0]], [[1.0], [1.0]]))),
         "no figure is finite there"),
        (SqpSlopes(*map(np.array, ([1.0], [1.0, 1.0], [[1.0]], [[1.0], [np.inf]]))),
         "the slopes of `logarithm <= 3` are not finite there"),
    ):  # fmt: skip
        engine.figures._known[share[0].tobytes()] = parts
        lanes = engine.lanes._replace(share=jnp.asarray(share))
        (end,) = check_optimality(engine.figures, lanes, share, [1])
        assert (end.status, end.reason) == ("failed", said)
        assert make_design(engine.problem, [end]).headline() == f"Nothing to build: {said}."


def test_an_infeasible_start_is_said():
    starts = tuple(v._replace(start=0.1) for v in BOUNDED.variables)
    problem = BOUNDED._replace(variables=starts)
    note = "the given start is not feasible: `sum <= 0` is missed by 1.3."
    assert start_note(Engine(problem, 1, 0)) == [note]
    inside = (starts[0], starts[1]._replace(start=2.0))
    assert start_note(Engine(BOUNDED._replace(variables=inside), 1, 0)) == []
    assert start_note(Engine(BOUNDED, 1, 0)) == []


def test_a_maximum_is_not_called_optimal():
    """A start exactly on a hill's top is stationary, but a neighbour is better."""
    problem = Problem((Variable("x", -1.0, 1.0),), lambda x, _: ((2 - x[0] ** 2)[None], NO_LIMITS))
    engine = Engine(problem, 1, 0)
    end = check_optimality(engine.figures, engine.lanes, np.array([[0.5]]), [0])[0]
    assert end.status == "not optimal" and "a neighbouring design is better" in end.reason


def test_a_kink_is_not_called_optimal_without_its_cases():
    """|x - 0.3| has no gradient of 0 at its least value; as a worst case of two lines it does."""
    kink = Problem((Variable("x", -1.0, 1.5),), lambda x, _: (jnp.abs(x - 0.3) + 1, NO_LIMITS))
    found = optimise(kink, starts=1, batch=1)
    assert found.status == "not optimal" and "kink" in found.reason

    def sides(x, _):
        return jnp.concatenate([x - 0.3, 0.3 - x]) + 1, NO_LIMITS

    both = kink._replace(figures=sides, worst=True, cases=("right", "left"))
    found = optimise(both, starts=1, batch=1)
    assert found.optimal and math.isclose(found.variables["x"], 0.3, abs_tol=1e-5)


def test_gradient_of_the_peak_at_a_kink_is_that_of_one_side():
    """Two samples of equal length, one growing and one falling with p: the peak's gradient is +1
    or -1, the derivative to one side; the smooth peak has the mean of both, 0."""
    t = jnp.array([0.0, 1.0])

    def rows(p):
        return jnp.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]) * jnp.stack([p, 2 - p])[:, None]

    slope = float(jax.grad(lambda p: peak(t, rows(p)))(1.0))
    right = (float(peak(t, rows(1 + 1e-6))) - 1) / 1e-6
    left = (1 - float(peak(t, rows(1 - 1e-6)))) / 1e-6
    assert math.isclose(right, 1, rel_tol=1e-6) and math.isclose(left, -1, rel_tol=1e-6)
    assert slope in {1.0, -1.0}
    assert abs(float(jax.grad(lambda p: smooth_peak(t, rows(p)))(1.0))) < 1e-12


def test_stored_searches_are_taken_up(tmp_path):
    first = optimise(BOUNDED, starts=2, batch=1, store=Folder(tmp_path, {"a": 1}, False))
    (tmp_path / "first-1.npz").unlink()
    again = optimise(BOUNDED, starts=2, batch=1, store=Folder(tmp_path, {"a": 1}, True))
    assert again == first
    with pytest.raises(InputError, match="holds a study already: continue with --resume"):
        Folder(tmp_path, {"a": 1}, False)
    with pytest.raises(InputError, match=r"holds another study[^:]*:\n  a: 1 -> 2$"):
        Folder(tmp_path, {"a": 2}, True)


def test_adam_on_fresh_draws_moves_the_starts():
    """mean over draws of (x - 1 - e)^2: the expectation's optimum is x = 1."""

    def draw(key):
        return jax.random.normal(key, (8,))

    def figures(x, e):
        return jnp.mean((x[0] - 1 - e) ** 2)[None], NO_LIMITS

    extra = draw(jax.random.key(3))
    problem = Problem((Variable("x", -3.0, 4.0),), figures, extra=extra, draw=draw)
    engine = Engine(problem, 2, 0)
    moved = engine.search.stochastic(engine.lanes, engine.figures.values, Adam(300, 0.05, 1))
    ends = np.asarray(engine.search.scale.value(moved.share))[:, 0]
    assert np.allclose(ends, 1.0, atol=0.15)
    found = optimise(problem, starts=2, batch=2, stochastic=Adam(20, 0.05, 1))
    assert math.isclose(found.variables["x"], 1 + float(jnp.mean(extra)), abs_tol=1e-5)


def convex_pair(x, _):
    return jnp.stack([jnp.sum((x - 1) ** 2), jnp.sum((x + 1) ** 2)]) + 1, NO_LIMITS


def test_front_against_the_closed_form():
    """|x - 1|^2 and |x + 1|^2 in the plane: sqrt(f1 - 1) + sqrt(f2 - 1) = 2 sqrt(2)."""
    variables = (Variable("a", -2.0, 2.5), Variable("b", -2.0, 2.5))
    front = trade_off(Problem(variables, convex_pair), ("f1", "f2"), ("1", "1"), points=6, starts=2)
    f = np.maximum(front.values - 1, 0.0)
    assert len(f) == 8 and set(front.status) == {"optimal"}
    assert np.allclose(np.sqrt(f).sum(axis=1), 2 * math.sqrt(2), rtol=2e-3)


@pytest.mark.parametrize("flat", tiered([0, 1, 2], bool))
def test_a_front_beside_a_metric_that_does_not_conflict(flat):
    """Two metrics conflict over a, and the third has its least at b = 1 whatever a is: the three
    were told not to conflict."""
    others = tuple(m for m in range(3) if m != flat)

    def figures(x, _):
        a, b = x
        f = jnp.array([(a - 1) ** 2, (a + 1) ** 2]) + (b - 1) ** 2 + 1
        return jnp.insert(f, flat, (b - 1) ** 2 + 2), NO_LIMITS

    variables, how = (Variable("a", -2.0, 2.5), Variable("b", -2.0, 2.5)), {"points": 5}
    front = trade_off(Problem(variables, figures), ("f", "g", "h"), ("1",) * 3, starts=2, **how)
    assert len(front.values) >= 7 and set(front.status) == {"optimal"}
    off = np.sqrt(front.values[:, others] - 1).sum(axis=1) - 2
    np.testing.assert_allclose(off, 0, atol=1e-5)
    np.testing.assert_allclose(front.values[:, flat], 2, atol=1e-5)
    assert str(front).count("do not compete here: one design is best in both") == 2

    def alike(x, _):
        return jnp.array([1.0, 2.0, 3.0]) * (1 + (x[0] - 1) ** 2), NO_LIMITS

    with pytest.raises(RunError, match="f, g, h do not conflict: one design is best in all"):
        trade_off(Problem(variables[:1], alike), ("f", "g", "h"), ("1",) * 3, starts=2, **how)


def outside_once(short: bool):
    """`best_of`: at first the second end breaks a limit, and the next is the first if `short`."""
    given = []

    def chosen(ends):
        given.append(best_of(ends))
        if len(given) == 2:
            return given[1]._replace(status="infeasible", g=given[1].g - np.array([0.0, 50.0]))
        return given[0]._replace(status="not optimal") if short and given[2:] else given[-1]

    return chosen


def test_a_front_s_ends_lie_inside_the_limits(monkeypatch):
    """The least of g outside of the limits counted for the span: two designs were left of eight."""
    module = importlib.import_module("omnijax.study._design.pareto")
    variables = (Variable("a", -2.0, 2.5), Variable("b", -2.0, 2.5))
    problem = Problem(variables, convex_pair)
    monkeypatch.setattr(module, "best_of", outside_once(False))
    front = trade_off(problem, ("f1", "f2"), ("1", "1"), points=6, starts=2)
    np.testing.assert_allclose(front.values[[0, -1]], [[1, 9], [9, 1]], rtol=1e-4)
    assert len(front.values) == 8 and set(front.status) == {"optimal"}
    monkeypatch.setattr(module, "best_of", outside_once(True))
    message = "the search for the least f2 ended short of an optimum"
    with pytest.raises(RunError, match=f"f1, f2 span no front that was found: {message}"):
        trade_off(problem, ("f1", "f2"), ("1", "1"), points=6, starts=2)


def test_a_front_without_figures_is_told(monkeypatch):
    """Its metrics were told not to conflict, or nothing was told of what is missing."""
    module = importlib.import_module("omnijax.study._design.pareto")
    monkeypatch.setattr(
        module, "best_of",
        lambda ends: ends[0]._replace(status="failed", reason="no figure is finite there"),
    )  # fmt: skip
    problem = Problem((Variable("a", -2.0, 2.5), Variable("b", -2.0, 2.5)), convex_pair)
    message = r"no search for the least f or g ends in figures: no figure is finite there\."
    with pytest.raises(RunError, match=message):
        trade_off(problem, ("f", "g"), ("1", "1"), starts=1)


def test_a_metric_that_is_zero_has_nothing_to_trade():
    """The error named a weight of the search that no study has."""

    def still(x, _):
        return jnp.stack([jnp.sum(x**2), 0 * x[0]]), NO_LIMITS

    with pytest.raises(InputError, match="`f2` is 0 in every design that was tried") as error:
        trade_off(
            Problem((Variable("a", -2.0, 2.5),), still, floor=(1e-9, 1e-9)),
            ("f1", "f2"),
            ("1", "1"),
        )
    assert len(error.value.problems) == 1


def test_what_rounding_leaves_of_an_objective_is_not_optimised():
    noise = Problem((Variable("a", 1.0, 2.0),), lambda x, _: (1e-18 * x[:1], NO_LIMITS))
    assert optimise(noise, starts=1).optimal
    with pytest.raises(InputError, match="`objective` is 0 in every design that was tried"):
        optimise(noise._replace(floor=1e-15), starts=1)


def test_a_stored_front_is_taken_up(tmp_path):
    variables = (Variable("a", -2.0, 2.5), Variable("b", -2.0, 2.5))
    problem, how = Problem(variables, convex_pair), {"points": 3, "starts": 1, "batch": 3}
    kept = Folder(tmp_path, {"a": 1}, False)
    first = trade_off(problem, ("f1", "f2"), ("1", "m"), store=kept, **how)
    assert (tmp_path / "alone-0.npz").exists()
    (tmp_path / "between-0.npz").unlink()
    kept = Folder(tmp_path, {"a": 1}, True)
    again = trade_off(problem, ("f1", "f2"), ("1", "m"), store=kept, **how)
    assert np.array_equal(again.values, first.values) and np.array_equal(again.x, first.x)


def test_a_front_says_that_tolerances_do_not_count(monkeypatch):
    """Its parts are nominal, in limits too, without a word until now."""
    module = importlib.import_module("omnijax.study._design.pareto")
    monkeypatch.setattr(module, "trade_off", lambda *_, **__: "front")
    asked = {**STUDY, "tolerance": {"wheel.roundness": 0.1}}
    with pytest.warns(DataWarning, match=r"nominal values: \[tolerance\] counts for nothing\."):
        assert omnijax.pareto(asked, ("rms", "sphere_acceleration_rms")) == "front"


def test_a_front_of_three_metrics_leads_with_the_pair_that_conflicts_most():
    """From best in a to best in c: a + 100 %, c - 50 %; a and b hardly conflict."""
    values = np.array([[1.0, 1.01, 4.0], [1.01, 1.0, 4.0], [2.0, 1.2, 2.0]])
    front = Front(
        ("a", "b", "c"), ("m", "m", "1"), ("x",), ("1",), values, np.zeros((3, 1)),
        ("optimal",) * 3, 9,
    )  # fmt: skip
    assert front.pairs() == [(0, 2), (1, 2), (0, 1)]
    head = "from the design best in a to the one best in c, a rises by 100.0 % and c falls by 50.0 "
    assert repr(front).startswith(head)
    ax = front.plot_front()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("a (m)", "c")


def test_a_front_prints_and_survives_saving(tmp_path):
    x = np.array([[1.0, 2.0], [3.0, 4.0]])
    front = Front(
        ("rms", "peak"), ("m", "m"), ("contact.stiffness", "contact.damping"),
        ("N/m", "N s/m"), 1e-3 * x, x, ("optimal", "optimal"), 7,
    )  # fmt: skip
    front.save(tmp_path / "f.nc")
    again = Front.load(tmp_path / "f.nc")
    assert np.array_equal(again.values, front.values) and again.variable_units == ("N/m", "N s/m")
    assert (
        "rms and peak do not compete here" in repr(front)
        and "contact.stiffness / N/m" in front._repr_html_()
    )
    assert front.plot_front().get_xlabel() == "rms (mm)"


def test_front_agrees_with_a_population_method():
    """NSGA-II finds the same front; with as many evaluations it comes no nearer to it."""
    pytest.importorskip("pymoo")
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.core.problem import Problem as Population
    from pymoo.optimize import minimize

    class Pair(Population):
        def __init__(self):
            super().__init__(n_var=2, n_obj=2, xl=-2.0, xu=2.5)

        def _evaluate(self, x, out, *args, **kwargs):
            out["F"] = np.stack([((x - 1) ** 2).sum(1), ((x + 1) ** 2).sum(1)], axis=1) + 1

    def population(generations):
        return minimize(Pair(), NSGA2(pop_size=40), ("n_gen", generations), seed=1, verbose=False).F

    def off_the_front(values):  # which is sqrt(f1 - 1) + sqrt(f2 - 1) = 2 sqrt(2)
        return np.abs(np.sqrt(values - 1).sum(axis=1) - 2 * math.sqrt(2))

    variables = (Variable("a", -2.0, 2.5), Variable("b", -2.0, 2.5))
    front = trade_off(Problem(variables, convex_pair), ("f1", "f2"), ("1", "1"), points=6, starts=2)
    ours, long, equal = front.values, population(60), population(front.evaluations // 40)
    assert off_the_front(ours).max() < 1e-6 < np.median(off_the_front(equal))
    beaten = (equal[:, None] < ours - 1e-6).all(axis=2)
    assert not beaten.any() and (ours[:, None] < equal).all(axis=2).any()
    np.testing.assert_allclose(np.sort(ours, axis=0)[[0, -1]], [[1, 1], [9, 9]], atol=1e-6)
    nearest = np.linalg.norm(ours[:, None] - long, axis=2).min(axis=1)
    assert nearest.max() < 0.3 and np.median(off_the_front(long)) < 0.05  # theirs cover it all


@pytest.mark.parametrize(
    ("variables", "message"),
    [
        ((Variable("k", 2.0, 1.0),), "`k` has crossed bounds: low 2 is not below high 1."),
        ((Variable("k", -1.0, 1.0, log=True),), "`k` on log scale needs low above 0, but it is"),
        ((Variable("k", 0.0, 1.0, start=3.0),), "`k` starts outside its bounds: 3 is not in"),
        ((Variable("k", 0.2, 0.7, whole=True),), "`k` has no whole number in [0.2, 0.7]."),
        ((), "a design needs at least one variable."),
    ],
)  # fmt: skip
def test_wrong_variables(variables, message):
    with pytest.raises(InputError, match=re.escape(message)):
        optimise(Problem(variables, quadratic))


def test_a_variable_without_influence_is_refused():
    variables = (*BOUNDED.variables, Variable("colour", 0.0, 1.0))
    message = "`colour` influences neither the objective nor a constraint"
    with pytest.raises(InputError, match=message):
        optimise(BOUNDED._replace(variables=variables))


STUDY = {
    "rig": "atlas",
    "drive": [{"speed": [3.0, 5.1, 7.3]}],
    "variable": [{"path": "contact.stiffness", "low": 5e4, "high": "1 MN/m"}],
}


def test_study_file_reads_units_and_defaults():
    study = parse_study(STUDY)
    assert study.variables[0] == Variable("contact.stiffness", 5e4, 1e6, True, False, "N/m")
    assert study.weights == (("rms", 1.0),) and study.loads[0].name == "as built"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"drivee": []}, "`drivee` is not a key of a study file. Did you mean `drive`?"),
        ({"objective": {"metric": "rmss"}}, "`rmss` is no metric. Did you mean `rms`?"),
        ({"drive": [{"speed": [1.0]}]}, "must have one value a wheel (3), but has 1."),
        ({"drive": []}, "a study needs at least one [[drive]]"),
        ({"variable": [{"path": "contact.stiffnes", "low": 1, "high": 2}]},
         "the rig has no parameter `contact.stiffnes`. Did you mean `contact.stiffness`?"),
        ({"variable": [{"path": "contact.stiffness", "low": 2e5, "high": 1e5}]},
         "`contact.stiffness` has crossed bounds"),
        ({"constraint": [{"quantity": "slip_margin"}]},
         "`constraint.slip_margin` needs `min` or `max`."),
        ({"constraint": [{"quantity": "slip"}]}, "`constraint.slip` is no quantity."),
        ({"constraint": [{"quantity": "preload", "min": 9.0, "max": 1.0}]},
         "conflicts with itself"),
        ({"tolerance": {"wheel.roundness": 2.0}},
         "`tolerance.wheel.roundness` must lie in (0, 0.9]"),
        ({"load": [{"name": "x", "set": {"sphere.mass": -1}}]},
         "`load.x.set.sphere.mass` must lie"),
        ({"load": [{"name": "x", "set": 5}]}, "`load.x.set` must be a table, but is 5."),
        ({"load": [{"name": "x"}, {"name": "x"}]}, "two [[load]] tables are named `x`"),
        ({"load": [{"name": "x", "set": {"contact.stiffness": 1e5}}]},
         "`contact.stiffness` is a variable, but load `x` sets it as well."),
        ({"variable": [{"low": 1, "high": 2}]}, "a [[variable]] needs `path`"),
        ({"variable": [*STUDY["variable"],
                       {"path": "wheel.w1.contact.stiffness", "low": 1e5, "high": 2e5}]},
         "`contact.stiffness` and `wheel.w1.contact.stiffness` set the same parameter"),
        ({"variable": [{"path": "speed.w1", "low": 1, "high": 2},
                       {"path": "speed.scale", "low": 1, "high": 2}]},
         "`speed.w1` and `speed.scale` set the same parameter"),
        ({"load": [{"name": "x", "set": {"wheel.mass": 0.2, "wheel.w2.mass": 0.3}}]},
         "load `x`: `wheel.mass` and `wheel.w2.mass` set the same parameter"),
        ({"tolerance": {"wheel.rollers": 0.1}},
         "`tolerance.wheel.rollers` draws any numbers, but `wheel.rollers` takes whole ones only."),
        ({"tolerance": {"wheel.roundness": 0.9},
          "load": [{"set": {"wheel.roundness": 0.6}}]},
         "`tolerance.wheel.roundness` draws 1.14 at its widest, but `wheel.roundness` must lie in "
         "[0, 1]."),
        ({"tolerance": {"wheel.w1.roundness": 0.2},
          "variable": [{"path": "wheel.roundness", "low": 0.1, "high": 0.9}]},
         "`tolerance.wheel.w1.roundness` draws 1.08 at its widest"),
        ({"tolerance": {"wheel.mass": 0.1, "wheel.w2.mass": 0.1}}, "are of the same part."),
        ({"objective": {"weights": {"rms": -1.0}}}, "`objective.weights.rms` must lie in (0, inf)"),
    ],
)  # fmt: skip
def test_wrong_study_files(change, message):
    with pytest.raises(InputError, match=re.escape(message)):
        parse_study({**STUDY, **change})


def test_a_wrong_weight_is_told_once():
    """`objective.weights` was said to name no metric as well."""
    for weights, said in (({"rms": 0}, "`objective.weights.rms` must lie in (0, inf), but is 0."),
                          ({}, "`objective.weights` names no metric.")):  # fmt: skip
        with pytest.raises(InputError) as told:
            parse_study({**STUDY, "objective": {"weights": weights}})
        assert list(told.value.problems) == [said]


def test_what_is_missing_is_told_beside_what_is_wrong():
    """A load of the name `overdrive` that was wrong hid that the study has no drive."""
    wrong = {"rig": "atlas", "load": [{"name": "overdrive", "set": {"sphere.mass": -1}}]}
    with pytest.raises(InputError) as told:
        parse_study(wrong)
    first, second = told.value.problems
    assert first.startswith("`load.overdrive.set.sphere.mass` must lie")
    assert second.startswith("a study needs at least one [[drive]]")
    with pytest.raises(InputError) as told:  # its block was there, and is told of
        parse_study({"rig": "atlas", "drive": 5})
    assert len(told.value.problems) == 1


def test_all_problems_of_a_study_at_once():
    with pytest.raises(InputError) as caught:
        objective, search = {"metric": "rmss"}, {"starts": 0}
        parse_study({"rig": "atlas", "model": "x", "objective": objective, "search": search})
    assert len(caught.value.problems) == 4


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (4e-7, "m", "0.4 µm"),
        (188208.0, "N/m", "188.2 kN/m"),
        (0.05, "1", "0.05"),
        (0, "m", "0 m"),
        (0.69813, "rad", "40°"),
        (1.2e-4, "rad", "0.12 mrad"),
        (0.02, "m/s^2", "20 mm/s²"),
    ],
)
def test_amounts_read_well(value, unit, text):
    assert quantity_text(value, unit) == text


@pytest.mark.parametrize(
    ("value", "sigma", "unit", "text"),
    [
        (5.65974e-6, 1.68e-9, "m", "5.660 ± 0.002 µm"),
        (0.000999869, 5e-8, "N m", "0.9999 ± 0.0001 mN m"),
        (0.69819, 0.00052, "rad", "40.00 ± 0.03°"),
        (-0.0123, 0.0004, "1", "-0.01230 ± 0.00040"),
        (12.0, None, "1", "12"),
        (3.0, 12.0, "N/m", "3 ± 12 N/m"),
        (2.5e9, 3e7, "N/m^3", "2.500 ± 0.030 GN/m³"),
    ],
)
def test_estimates_show_as_many_places_as_their_sigma(value, sigma, unit, text):
    assert estimate(value, sigma, unit) == text


def test_searches_in_step_are_evaluated_together():
    """Whichever thread is first: each round holds one point of every search that still goes."""
    rounds, ends = [], []

    def search(steps):
        def run(ask):
            for k in range(steps):
                time.sleep(random.random() / 500)
                assert ask(np.array([steps, k])) == steps + k
            return steps

        return run

    def figures(points):
        rounds.append(points.tolist())
        return points.sum(axis=1)

    counts = [3, 0, 1, 3]
    assert (
        in_step([search(n) for n in counts], figures, lambda i, end: ends.append((i, end)))
        == counts
    )
    assert rounds == [[[3, 0], [1, 0], [3, 0]], [[3, 1], [3, 1]], [[3, 2], [3, 2]]]
    assert sorted(ends) == list(enumerate(counts))


@pytest.mark.parametrize("where", ["search", "figures", "ended"])
def test_what_is_raised_stops_all_searches_in_step(where):
    before = threading.active_count()

    def fail(*_):
        raise KeyboardInterrupt

    def searched(ask):
        ask(np.zeros(1))
        if where == "search":
            fail()
        return ask(np.ones(1))

    figures = fail if where == "figures" else np.ravel
    with pytest.raises(KeyboardInterrupt):
        in_step([lambda ask: ask(np.zeros(1)), searched], figures, *[fail] * (where == "ended"))
    assert threading.active_count() == before


def test_each_bound_of_a_preload_holds_the_wheel_that_is_nearest_to_it():
    """With both, the lower bound was held against the greatest preload of all wheels."""
    rng, rig = np.random.default_rng(11), omnijax.load_rig("atlas")
    preload = rng.uniform(30, 120, 3)
    for name, value in zip(rig.names, preload, strict=True):
        rig = omnijax.set_parameter(rig, f"wheel.{name}.closure.preload", value)
    wanted = (Constraint("preload", low=60.0, high=100.0), Constraint("rms", 1e-6, 1e-3))
    limits, index = all_limits(wanted, rig, CaseNames(("a", "b")))
    values = all_values(wanted, CaseResult(rig, None, None, "coupled"), {"rms": jnp.asarray(2e-4)})
    np.testing.assert_allclose(values, [-preload.min(), preload.max(), -2e-4, 2e-4])
    assert [x.bound for x in limits] == [-60, 100, *[-1e-6, 1e-3] * 2]
    assert index.tolist() == [0, 1, 2, 3, 6, 7]


@pytest.mark.parametrize("loads", [("strong", "weak"), ("weak", "strong")])
def test_a_preload_that_loads_change_is_held_under_each_load_and_not_under_each_drive(loads):
    """It was held under the first load alone, so the order of the loads decided the verdict."""
    rig = omnijax.load_rig("atlas")
    cases = tuple(f"{drive}, {load}" for drive in ("slow", "fast") for load in loads)
    wanted = (Constraint("preload", low=100.0), Constraint("rms", high=1e-3))
    names = CaseNames(cases, loads, ("wheel.w1.closure.preload",))
    limits, index = all_limits(wanted, rig, names)
    assert [x.text for x in limits if "preload" in x.text] == [
        f"preload ({load}) >= 100 N" for load in loads
    ]
    assert index.tolist() == [0, 1, 2, 3, 5, 7]


@pytest.mark.parametrize("order", [1, -1])
def test_a_load_of_too_little_preload_makes_a_design_infeasible_in_any_order(order):
    loads = [
        {"name": "strong", "set": {"closure.preload": 150.0}},
        {"name": "weak", "set": {"closure.preload": 20.0}},
    ]
    study = parse_study({
        "rig": "atlas",
        "drive": [{"speed": [1, 3, 4]}],
        "variable": [{"path": "wheel.roundness", "low": 0.2, "high": 0.6}],
        "objective": {"metric": "rms"},
        "load": loads[::order],
        "constraint": [{"quantity": "preload", "min": 100.0}],
    })  # fmt: skip
    cases = RigCases(study)
    _, held = cases.limits()
    values = cases.constraints(
        jnp.array([0.4]), jnp.zeros((1, 0)), jnp.zeros((2, 1, len(cases.metrics)))
    )
    assert sorted(np.asarray(values).reshape(-1)[held].tolist()) == [-150.0, -20.0]
