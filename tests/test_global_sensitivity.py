"""Global sensitivities against the Ishigami function's closed form and against SALib."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import ndtri

from omnijax.rig import InputError
from omnijax.study import (
    GlobalSensitivity,
    Input,
    analyse,
    global_sensitivity,
    pareto,
    sensitivity_over_speeds,
    tolerances,
)
from omnijax.study._spread.morris import TAIL, morris_design, morris_effects
from omnijax.study._spread.sobol import sobol_design, sobol_indices

A, B = 7.0, 0.1
INPUTS = [Input(f"x{i}", -np.pi, np.pi) for i in (1, 2, 3)]
VARIANCE = A**2 / 8 + B * np.pi**4 / 5 + B**2 * np.pi**8 / 18 + 0.5
FIRST = np.array([0.5 * (1 + B * np.pi**4 / 5) ** 2, A**2 / 8, 0.0]) / VARIANCE
TOTAL = FIRST + np.array([1, 0, 1]) * B**2 * np.pi**8 * (1 / 18 - 1 / 50) / VARIANCE
# E[(df/dx)^2] of Ishigami over the cube, times (2 pi)^2 / (pi^2 V): the bound on the total indices
SLOPES = np.array(
    [0.5 * (1 + 2 * B * np.pi**4 / 5 + B**2 * np.pi**8 / 9), A**2 / 2, 8 * B**2 * np.pi**6 / 7]
)
BOUND = 4 * SLOPES / VARIANCE


def ishigami(x):
    return (jnp.sin(x[0]) + A * jnp.sin(x[1]) ** 2 + B * x[2] ** 4 * jnp.sin(x[0]))[None]


@pytest.fixture(scope="module")
def found():
    return analyse(ishigami, INPUTS, ["y"], ["m"], samples=2048, seed=5)


def test_sobol_indices_of_ishigami(found):
    for value, half, exact in (
        (found.sobol.first, found.sobol.first_half, FIRST),
        (found.sobol.total, found.sobol.total_half, TOTAL),
    ):
        assert np.all(np.abs(value[0] - exact) < 1.5 * half[0])
        assert np.all(half[0] < 0.08)
    assert found.sobol.blocks == 2048 and not found.failed


def test_estimates_converge(found):
    error = np.abs(found.sobol.total_stages[:, 0] - TOTAL).max(axis=1)
    assert len(found.sobol.stages) == 6 and found.sobol.stages[-1] == 2048
    assert error[-1] < 0.5 * error[0]


def test_gradient_bounds_of_ishigami(found):
    assert np.allclose(found.bound[0], BOUND, rtol=0.2)
    assert np.all(found.bound[0] > found.sobol.total[0])


def test_against_salib_on_the_same_runs():
    """SALib with the same points: the same estimators, so the same indices to rounding."""
    sobol = pytest.importorskip("SALib.analyze.sobol")
    unit = sobol_design(3, 512, 1)
    x = jnp.asarray(2 * np.pi * unit - np.pi)
    values = np.asarray(jnp.sin(x[:, 0]) + A * jnp.sin(x[:, 1]) ** 2)
    values = values + np.asarray(B * x[:, 2] ** 4 * jnp.sin(x[:, 0]))
    ours = sobol_indices(values[:, None], np.zeros(len(values), bool), 3, 0)
    problem = {"num_vars": 3, "names": ["a", "b", "c"], "bounds": [[0, 1]] * 3}
    theirs = sobol.analyze(problem, values, calc_second_order=False, num_resamples=200, seed=1)
    assert np.all(np.abs(ours.first[0] - theirs["S1"]) < 0.5 * theirs["S1_conf"] + 1e-3)
    assert np.all(np.abs(ours.total[0] - theirs["ST"]) < 0.5 * theirs["ST_conf"] + 1e-3)
    assert np.allclose(ours.total_half[0], theirs["ST_conf"], rtol=0.35)


def test_morris_of_a_plane():
    """f = 3 x - 2 y + 0 z: every effect is the slope, so mu is it and sigma is 0."""
    unit = morris_design(3, 20, 4)
    assert np.all(np.count_nonzero(np.diff(unit.reshape(20, 4, 3), axis=1), axis=2) == 1)
    effects = morris_effects(unit, (unit @ [3.0, -2.0, 0.0])[:, None], np.zeros(len(unit), bool))
    assert np.allclose(effects.mu, [[3, -2, 0]]) and np.allclose(effects.mu_star, [[3, 2, 0]])
    assert np.allclose(effects.sigma, 0, atol=1e-12) and list(effects.used) == [20, 20, 20]


def test_morris_of_a_plane_by_way_of_the_study():
    """Steps are as long as the runs' points say, at the ends of a range and in a normal's tails."""
    inputs = [Input("a", 2.0, 5.0), Input("b", 1.0, 3.0, normal=True)]
    effects = analyse(lambda x: (4 * x[0])[None], inputs, ["y"], ["m"], samples=16).morris
    np.testing.assert_allclose(effects.mu, [[12.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(effects.sigma, 0.0, atol=1e-9)
    # of a normal input a step is one of two, x = 2 + z/3 at the shares of eight levels
    effects = analyse(lambda x: x[1:], inputs, ["y"], ["m"], samples=16, seed=2).morris
    outer, inner = (
        float(ndtri(high) - ndtri(low)) / 3 / (high - low)
        for low, high in ((TAIL, 4 / 7), (1 / 7, 5 / 7))
    )
    mean, scatter, used = effects.mu_star[0, 1], effects.sigma[0, 1], effects.used[1]
    assert inner < mean < outer
    assert scatter**2 == pytest.approx((outer - mean) * (mean - inner) * used / (used - 1))


def test_failed_runs_are_named_and_left_out(tmp_path):
    """A corner fails; the indices stay near those of the rest, and no figure is NaN."""

    def fragile(x):
        return jnp.where((x[0] > 2.8) & (x[1] > 2.2), jnp.nan, ishigami(x))

    found = analyse(fragile, INPUTS, ["y"], ["m"], samples=512, seed=2)
    assert 0 < found.sobol.dropped < 60 and len(found.failed) > 0
    assert all("x1 = 2.8" in f or "x1 = 2.9" in f or "x1 = 3." in f for f in found.failed)
    assert np.allclose(found.sobol.total[0], TOTAL, atol=0.15)
    arrays = (found.sobol.first, found.morris.mu_star, found.bound)
    assert all(np.isfinite(a).all() for a in arrays)
    assert f"{len(found.failed)} of {found.runs} runs failed" in found.sentences()[-1]
    found.save(tmp_path / "g.nc")
    again = GlobalSensitivity.load(tmp_path / "g.nc")
    assert repr(again) == repr(found) and "<td>x2</td>" in found._repr_html_()
    assert found.to_xarray()["total"].attrs["units"] == "1"
    assert again.failed == found.failed and np.array_equal(again.bound, found.bound)


def test_what_has_no_influence_and_what_is_not_settled_is_said():
    inputs = [Input(n, 0.0, 1.0) for n in ("a", "b", "c")]
    found = analyse(lambda x: (x[0] + 0.9 * x[1])[None], inputs, ["y"], ["m"], samples=64)
    first, settled, silent = found.sentences()
    assert first.startswith("y depends most on `a` (") and ", then `b` (" in first
    assert settled.startswith("which of `a` and `b` matters more for y is not settled by 64 blocks")
    assert silent == "`c` does not influence y."
    clear = analyse(lambda x: (x[0] + 0.1 * x[1])[None], inputs, ["y"], ["m"], samples=64)
    assert "not settled" not in repr(clear)
    flat = analyse(lambda x: jnp.ones(1) + 0 * x[:1], inputs, ["y"], ["m"], samples=64)
    assert flat.sentences() == [f"`{n}` does not influence y." for n in "abc"]


STUDY = {
    "rig": "atlas",
    "drive": [{"speed": [3.0, 5.1, 7.3]}],
    "variable": [
        {"path": "contact.stiffness", "low": 1e5, "high": 3e5},
        {"path": "contact.damping", "low": 60, "high": 300},
        {"path": "wheel.roundness", "low": 0.4, "high": 0.5, "distribution": "normal"},
    ],
    "sampling": {"samples": 64},
}


@pytest.mark.full  # in the gate SALib has the same points: test_against_salib_on_the_same_runs
def test_the_rig_against_salib():
    """The same metric by two samplings: indices agree within the two confidence intervals."""
    sobol = pytest.importorskip("SALib.analyze.sobol")
    found = global_sensitivity({**STUDY, "search": {"seed": 3}})
    from SALib.sample import sobol as sampling

    from omnijax.study._design.cases import RigCases
    from omnijax.study._file.file import parse_study
    from omnijax.study._spread.inputs import UncertainInputs, one_by_one, run_all

    study = parse_study(STUDY)
    cases = RigCases(study, ("rms",))
    box = UncertainInputs(
        [Input(v.name, v.low, v.high, v.log, i == 2) for i, v in enumerate(study.variables)]
    )
    problem = {"num_vars": 3, "names": list(box.names), "bounds": [[0, 1]] * 3}
    unit = sampling.sample(problem, 64, calc_second_order=False, seed=7)

    def rms(x):
        return cases.every(x, jnp.zeros((1, 0)))[0][0, 0]

    values = run_all(one_by_one(rms, box), box.standard(unit)).values[:, 0]
    theirs = sobol.analyze(problem, values, calc_second_order=False, seed=1)
    room = found.sobol.total_half[0] + theirs["ST_conf"] + 0.01
    assert np.all(np.abs(found.sobol.total[0] - theirs["ST"]) < room)
    assert np.argmax(found.sobol.total[0]) == np.argmax(theirs["ST"])
    assert found.sobol.total[0].sum() > 0.9


def test_wrong_input():
    with pytest.raises(InputError, match="`samples` must be at least 16, but is 4"):
        analyse(ishigami, INPUTS, ["y"], ["m"], samples=4)
    with pytest.raises(InputError, match=r"`wheel\.rollers` takes whole numbers"):
        rollers = {"path": "wheel.rollers", "low": 10, "high": 20}
        global_sensitivity({**STUDY, "variable": [rollers]})


def test_a_plain_string_of_names_is_no_list_of_letters():
    for ask, names in (
        (lambda names: global_sensitivity(STUDY, names), "rms, peek"),
        (lambda names: pareto(STUDY, names), "rms, peek"),
        (
            lambda names: tolerances(
                {**STUDY, "limit": {"metric": "rms", "rise": 0.2}}, parts=names
            ),
            "wheel.radius, peek",
        ),
        (lambda names: sensitivity_over_speeds("atlas", "1, 3, 4", [1], "rms", names), "peek"),
    ):
        with pytest.raises(InputError, match="`peek`"):
            ask(names)
