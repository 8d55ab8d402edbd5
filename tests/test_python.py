"""Python as one guesses it: names, units, lists, durations; a run as tables and pictures."""

import html
import math
import re

import jax
import jax.numpy as jnp
import numpy as np
import pandas
import pytest

import omnijax
from omnijax import InputError, get_parameter, set_parameter
from omnijax.laws import ContactRelaxation
from omnijax.rig import parameter_paths
from omnijax.simulation import Signal, measured, ramp, table
from omnijax.simulation._drives import as_times
from omnijax.vibration import evaluate, steady_metrics

pytestmark = pytest.mark.brief

RPM = 2 * np.pi / 60
RIG = omnijax.load_rig("atlas")


@pytest.fixture(scope="module")
def run():
    return omnijax.simulate("atlas", ["30 rpm", 0, 1.5], "0.2 s")


def test_names_units_and_a_duration_give_the_same_run(run):
    drive = omnijax.speeds(jnp.array([30 * RPM, 0.0, 1.5]))
    same = omnijax.simulate(RIG, drive, np.arange(101) / 500)
    np.testing.assert_array_equal(run.dR, same.dR)
    np.testing.assert_array_equal(omnijax.simulate(RIG, drive, 0.2).t, same.t)
    named = omnijax.simulate(RIG, drive, duration="200 ms", rate="1 kHz")
    np.testing.assert_array_equal(named.t, np.arange(201) / 1000)


@pytest.mark.parametrize(
    "given", ["30 rpm, 0, 1.5", ["30 rpm", 0, 1.5], ("30rpm", "0", "1.5 rad/s")]
)
def test_a_drive_takes_units(given):
    assert omnijax.speeds(given).speed.values[0] == pytest.approx([30 * RPM, 0, 1.5])
    torques = omnijax.torques("10 mNm, 0, 0.2", force=["1 kN", 0, 0])
    assert torques.torque.values[0] == pytest.approx([0.01, 0, 0.2])
    assert torques.force.values[0] == pytest.approx([1e3, 0, 0])


@pytest.mark.parametrize("kind", [list, tuple, np.array, pandas.Series])
def test_every_list_of_numbers_takes_units(kind):
    """Arrays and Series of text, angles, velocities, forces and times ended in a ValueError."""
    drive = omnijax.torques(
        kind(["10 mNm", "0", "5 mNm"]),
        force=kind(["1 N", "0", "0"]),
        initial_angle=kind(["180 deg", "0", "0"]),
        initial_velocity=kind(["60 rpm", "0", "0"]),
    )
    assert drive.torque.values.tolist() == [[0.01, 0.0, 0.005]]
    assert drive.initial_angle.tolist() == [math.pi, 0, 0]
    assert drive.initial_velocity.tolist() == [pytest.approx(2 * math.pi), 0, 0]
    assert as_times(kind(["0 s", "1 ms"])).tolist() == [0.0, 1e-3]
    with pytest.raises(InputError, match="`initial_angle` must be"):
        omnijax.speeds([1, 2, 3], initial_angle=kind(["1 N", "0", "0"]))


def test_traced_speeds_stay_traced():
    slope = jax.grad(lambda w: omnijax.speeds([w, 0.0, 2 * w]).speed.values.sum())(1.0)
    assert slope == 3


@pytest.mark.parametrize(
    "arguments, match",
    [
        (("atlsa", [1, 0, 0], 1.0), "Did you mean `atlas`"),
        ((RIG, "1 2 3", 1.0), "write commas between the values"),
        ((RIG, "1 m, 0, 2 kg", 1.0), "`speed` must be a number in rad/s.*(?s:.)*2 kg"),
        ((RIG, [1, 0], 1.0), "the drive has 2 wheels, but the rig has 3"),
        ((RIG, [1, np.inf, 0], 1.0), "`speed` must be finite, but is inf"),
        ((RIG, 1.0, 1.0), "the drive has 1 wheel, but the rig has 3"),
        ((RIG, omnijax.torques([1, 0, 0], [0, np.nan, 0]), 1.0), "`force` must be finite"),
        ((RIG, np.array([1, 2j, 0]), 1.0), r"`speed` must be real numbers \(rad/s\), but holds"),
        ((RIG, np.array([True, False, True]), 1.0), "`speed` must be real.* an array of bool"),
        ((RIG, [1, True, 0], 1.0), "`speed` must be real numbers.* but holds True"),
        ((RIG, [1, 0, 0], -1.0), r"`duration` must lie in \(0, inf\) s, but is -1"),
        ((RIG, [1, 0, 0], "2 m"), "`duration` must be a number in s"),
        ((RIG, [1, 0, 0], True), r"`duration` must be one number \(s\), but is True"),
    ],
)
def test_what_cannot_be_simulated_is_said(arguments, match):
    with pytest.raises(InputError, match=match):
        omnijax.simulate(*arguments)


@pytest.mark.parametrize("given", [np.array([1, 2 + 1j, 0]), [1, 2j, 0], jnp.array([True] * 3)])
def test_speeds_that_are_no_real_numbers_are_refused_everywhere(given):
    """The imaginary part was dropped, and true counted as 1 rad/s."""
    times, rows = np.linspace(0, 0.1, 6), np.array([given, given])
    for ask in (
        lambda: omnijax.propagate(RIG, given, times),
        lambda: omnijax.steady_state(RIG, given),
        lambda: steady_metrics(RIG, jnp.asarray(given), ("rms",)),
        lambda: omnijax.sweep(RIG, {"contact.stiffness": [1e5]}, drive=given),
        lambda: jax.jit(lambda w: omnijax.speeds(w).speed.values)(jnp.asarray(given)),
        lambda: omnijax.torques(given),
        lambda: ramp(0, 1, [0, 0, 0], given),
        lambda: table([0, 1], rows),
    ):
        with pytest.raises(InputError, match="must be real numbers"):
            ask()


@pytest.mark.parametrize(
    "given, match",
    [
        ({}, "either sample times `ts` or a `duration`"),
        ({"ts": 1.0, "duration": 1.0}, "either sample times `ts` or a `duration`"),
        ({"ts": [0.0, 0.1], "rate": 100}, "`rate` goes with a duration"),
        ({"ts": []}, r"`ts` must be a row of sample times, but has shape \(0,\)"),
        ({"ts": [[0.0, 0.1]]}, r"`ts` must be a row of sample times, but has shape \(1, 2\)"),
        ({"ts": [0.0, 0.2, 0.1]}, r"increase, but `ts\[2\]` is 0.1 after 0.2 s"),
        ({"ts": [0.0, np.nan]}, r"finite and increase, but `ts\[1\]` is nan after 0 s"),
        ({"duration": [0.0, 0.1]}, "`duration` must be one number"),
        ({"duration": 1.0, "rate": 0}, r"`rate` must lie in \(0, inf\) Hz, but is 0"),
        ({"duration": 1.0, "rate": "3 s"}, "`rate` must be a number in Hz"),
    ],
)
def test_what_are_no_sample_times_is_said(given, match):
    with pytest.raises(InputError, match=match):
        omnijax.simulate(RIG, [1, 0, 0], **given)


@pytest.mark.parametrize(
    "wrong",
    [{"rtol": -1}, {"rtol": 0}, {"rtol": True}, {"max_steps": 0}, {"max_steps": 2.5}],
)
def test_numbers_of_the_solver_are_looked_at(wrong):
    """A tolerance below 0 was taken, others ended in an error of the solver's."""
    with pytest.raises(InputError, match=f"`{next(iter(wrong))}` must"):
        omnijax.simulate(RIG, omnijax.torques([0.1] * 3), 0.1, **wrong)


def test_speeds_are_looked_at_on_both_sides_of_their_knots():
    """A ramp that falls to 0 at its end hid its top, and one that never ends all of it."""
    down = table([0, 1, 1, 2], [[0, 0, 0], [2e6, 0, 0], [0, 0, 0], [0, 0, 0]])
    with pytest.raises(InputError, match=r"`speed` must lie in .* but is 2e\+06"):
        omnijax.simulate(RIG, omnijax.speeds(down), 0.01)
    ever = Signal(jnp.zeros(1), jnp.ones((1, 3)), jnp.array([[1.0, 0.0, 0.0]]))
    for drive, name in (
        (omnijax.speeds(ever), "speed"),
        (omnijax.torques([0, 0, 0], force=ever), "force"),
    ):
        with pytest.raises(InputError, match=f"`{name}` must be held from its last knot on, but"):
            omnijax.simulate(RIG, drive, 0.01)


def test_modes_say_which_laws_they_leave_out():
    rig = RIG.add(ContactRelaxation(jnp.asarray(1e5), jnp.asarray(0.1)), "all")
    told = omnijax.modes(rig)
    assert told.without == ("contact-relaxation",) and omnijax.modes(RIG).without == ()
    assert told.sentences()[-1] == "These are of the machine without contact-relaxation."
    assert type(told).from_xarray(told.to_xarray()).without == told.without


def test_a_rig_may_be_a_name_wherever_one_is_asked(run):
    """They ended in an AttributeError."""
    assert evaluate(run, "atlas", "rms") == evaluate(run, RIG, "rms")
    np.testing.assert_array_equal(measured(run, "atlas")["dR"], measured(run, RIG)["dR"])
    assert get_parameter("atlas", "sphere.mass") == RIG.sphere.mass
    assert set_parameter("atlas", "sphere.mass", "3 kg").sphere.mass == 3
    with pytest.raises(InputError, match="Did you mean `atlas`"):
        get_parameter("atlsa", "sphere.mass")


@pytest.mark.full
def test_long_runs_and_modes_take_names_and_units():
    by_name = omnijax.steady_state("atlas", "1 rpm, 1.2, 0.3")
    same = omnijax.steady_state(RIG, [2 * np.pi / 60, 1.2, 0.3])
    assert float(by_name.rms) == pytest.approx(float(same.rms), rel=1e-14)
    np.testing.assert_array_equal(
        omnijax.natural_frequencies("atlas"), omnijax.natural_frequencies(RIG)
    )
    np.testing.assert_array_equal(omnijax.modes("atlas").frequency, omnijax.modes(RIG).frequency)
    with pytest.raises(InputError, match="`speeds` must be a number in rad/s"):
        omnijax.steady_state("atlas", "1 kg, 1.2, 0.3")


def test_a_star_brings_the_names_that_the_page_lists():
    brought: dict = {}
    exec("from omnijax import *", brought)
    assert {"load_rig", "simulate", "steady_state", "diagnose"} <= set(brought)
    assert not {"importlib", "TYPE_CHECKING"} & set(brought)


def test_a_parameter_takes_units_as_a_file():
    one = set_parameter(RIG, "contact.stiffness", "200 kN/m")
    assert one.wheels.contact.stiffness == pytest.approx([2e5] * 3)
    each = set_parameter(RIG, "contact.stiffness", ["200 kN/m", 1e5, "30 N/mm"])
    assert each.wheels.contact.stiffness == pytest.approx([2e5, 1e5, 3e4])
    moved = set_parameter(RIG, "sphere.centre_of_mass", ["1 mm", 0, "-2 mm"])
    assert moved.sphere.centre_of_mass == pytest.approx([1e-3, 0, -2e-3])


def _impossible(info):
    """A value just outside of what `info` allows, None where everything goes."""
    if np.isfinite(info.high):
        return info.high + 1
    if np.isfinite(info.low):
        return info.low - 1
    return None


def test_every_bounded_parameter_refuses_what_cannot_be():
    bounded = [(info.path, _impossible(info)) for info in parameter_paths(RIG)]
    bounded = [(path, value) for path, value in bounded if value is not None]
    assert len(bounded) > 20
    for path, value in bounded:
        with pytest.raises(InputError, match=f"`{path}` must"):
            set_parameter(RIG, path, value)
        size = np.shape(get_parameter(RIG, path))
        with pytest.raises(InputError, match=f"`{path}` must"):
            set_parameter(RIG, path, np.full(size, value))


@pytest.mark.parametrize(
    "path, value, match",
    [
        ("sphere.mass", float("nan"), "must be finite"),
        ("sphere.mass", "1 m", "must be a number in kg"),
        ("sphere.inertia", -np.eye(3), "must be positive definite"),
        ("wheel.w1.rollers", 2.5, "must be a whole number"),
        ("wheel.w1.normal", [0.0, 0, 2], "must be a unit vector"),
        ("sphere.mas", 1.0, "Did you mean `sphere.mass`"),
    ],
)
def test_impossible_values_are_refused(path, value, match):
    with pytest.raises(InputError, match=match):
        set_parameter(RIG, path, value)


def test_traced_values_pass():
    given = jnp.array([-1.0, 2.0])
    masses = jax.vmap(lambda m: set_parameter(RIG, "sphere.mass", m).sphere.mass)(given)
    np.testing.assert_array_equal(masses, given)


def test_channels_by_name(run):
    assert run["dR"] is run.dR
    np.testing.assert_array_equal(run["dR_y"], run.dR[:, 1])
    np.testing.assert_array_equal(run["theta_2"], run.theta[:, 1])
    np.testing.assert_array_equal(run["normal_force_w3"], run.normal_force[:, 2])
    np.testing.assert_array_equal(run["distance"], run.distance)
    for wrong in ("dR_w", "theta_x", "t_x", "nothing", 0):
        with pytest.raises(KeyError, match="no channel"):
            run[wrong]
    with pytest.raises(KeyError, match="Did you mean `dR_rate`"):
        run["dR_rat"]
    with pytest.raises(TypeError, match="a run is no list"):
        list(run)


def test_a_run_as_tables(run):
    table = run.to_dataframe()
    np.testing.assert_array_equal(table.index, run.t)
    for name in table:
        np.testing.assert_array_equal(table[name], run[name])
    rows = {row.channel: row for row in run.summary().channels}
    assert list(rows) == list(table)
    largest, unit = table["omega_1"].max(), "rad/s"
    assert rows["omega_1"][1:] == (unit, largest, largest, pytest.approx(largest))
    assert rows["dR_y"].rms == pytest.approx(float(jnp.sqrt(jnp.mean(run.dR[:, 1] ** 2))))
    assert repr(run.summary()).startswith("ok: 101 samples")
    assert "µm" in repr(run.summary()) and "<td>omega_1</td>" in run.summary()._repr_html_()


def test_a_run_as_a_picture(run):
    figure = run.plot()
    assert [len(ax.lines) for ax in figure.axes] == [4, 3, 3, 3]
    assert len(run.plot("omega").lines) == 3
    with pytest.raises(ValueError, match="but is 'dQ'"):
        run.plot("dQ")


def test_save_and_load_are_a_pair(run, tmp_path):
    kept = omnijax.load_run(run.save(tmp_path / "run.nc"))
    np.testing.assert_array_equal(kept["dR"], run["dR"])


def _cells(page):
    return [re.findall(r"<t[hd]>(.*?)</t[hd]>", row) for row in page.split("</tr>")]


def test_a_rig_shows_its_table(capsys):
    """In a notebook: every number of the wheels that `omnijax check` prints."""
    rig = set_parameter(RIG, "wheel.w2.contact.stiffness", "123.4 kN/m")
    page = rig._repr_html_()
    rows = {html.unescape(row[0]): row[1:] for row in _cells(page) if row}
    assert rows["wheel"] == ["w1", "w2", "w3", "unit"]
    assert rows["contact stiffness K"] == ["188.208", "123.4", "188.208", "kN/m"]
    assert f"mass {float(rig.sphere.mass):.4g} kg" in page
    values = {info.path: get_parameter(rig, info.path) for info in parameter_paths(rig)}
    names = {"preload": "closure.preload", "friction": "contact.friction"}
    for key, fact in omnijax.rig.FACTS.items():
        path = names.get(key, key.replace("_", "."))
        found = values.get(path, values.get(f"wheel.{key}"))
        found = rig.gaps.depth if key == "gap_depth" else found
        assert rows[fact.label] == [*(f"{fact.factor * float(x):.6g}" for x in found), fact.unit]
    jax.eval_shape(lambda m: print(set_parameter(RIG, "sphere.mass", m)._repr_html_()), 1.0)
    assert "a traced rig of 3 wheels" in capsys.readouterr().out


@pytest.mark.parametrize("ask", [
    lambda: omnijax.modes("atlas", "paperr"),
    lambda: omnijax.natural_frequencies("atlas", "paperr"),
    lambda: omnijax.steady_state("atlas", "1, 2, 3", model="paperr"),
    lambda: omnijax.simulate("atlas", "1, 2, 3", "0.1 s", model="paperr"),
    lambda: omnijax.propagate("atlas", omnijax.speeds([1, 2, 3]), [0.0, 1.0], model="paperr"),
])  # fmt: skip
def test_an_unknown_model_is_refused_in_a_sentence(ask):
    """`modes` raised a bare `KeyError`."""
    with pytest.raises(omnijax.InputError, match=r"`model` must be one of .*`paper`"):
        ask()
