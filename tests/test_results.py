"""Results of one kind: arrays with units, a file and back, words, a table, a picture."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import machine

import omnijax
import omnijax.diagnosis
from omnijax import InputError, laws
from omnijax._errors import DataWarning
from omnijax.simulation import propagate, speeds, steady_state
from omnijax.vibration import modes, order_track, rpm_order_map
from omnijax.view import write_replay

pytestmark = pytest.mark.brief

RESULTS = [
    "Trajectory", "SteadyState", "Modes", "OrderMap", "OrderTrack", "SweepResult", "Sensitivity",
    "SpeedSensitivity", "GlobalSensitivity", "Design", "Front", "Tolerances", "MachineSweep",
    "Diagnosis",
]  # fmt: skip


@pytest.mark.parametrize("name", RESULTS)
def test_every_result_of_the_root_shows_saves_and_loads_itself(name):
    result = next(
        getattr(face, name)
        for face in (omnijax, omnijax.study, omnijax.diagnosis)
        if hasattr(face, name)
    )
    for method in ("to_xarray", "save", "load", "__repr__", "_repr_html_"):
        assert callable(getattr(result, method)), (name, method)
    assert any(method.startswith("plot") for method in dir(result))


@pytest.fixture(scope="module")
def results(batches):
    """A result of each kind that computes no study: the batches' first run, second long one."""
    rig, runs, states = batches
    run, steady = (jax.tree.map(lambda x, i=i: x[i], y) for i, y in enumerate((runs, states)))
    turning = {"reference": "w2", "channel": "dR_x"}
    return {
        "steady": steady,
        "modes": modes(rig.add(laws.WheelRunout(jnp.asarray(1e-4), jnp.asarray(0.3)), "w2")),
        "map": rpm_order_map(run, **turning),
        "track": order_track(run, [1, 14], **turning),
    }


@pytest.mark.parametrize("name", ["steady", "modes", "map", "track"])
def test_a_result_comes_back_from_its_file(results, name, tmp_path):
    result = results[name]
    file = result.save(tmp_path / "result.nc")
    again = type(result).load(file)
    for field in dataclasses.fields(result):
        np.testing.assert_array_equal(getattr(again, field.name), getattr(result, field.name))
    assert repr(again) == repr(result) and again._repr_html_() == result._repr_html_()
    other = "modes" if name != "modes" else "track"
    with pytest.raises(InputError, match=f"holds no {type(results[other]).what}"):
        type(results[other]).load(file)


@pytest.mark.full  # in the gate its words: test_hold
def test_a_steady_state_that_is_none_says_so_from_its_file(tmp_path):
    normal = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    rig = machine((normal, np.cross([[0.0, 0.0, 1.0]] * 3, normal)))
    with pytest.warns(DataWarning, match="no wheel drives the axis|do not fit"):
        none = steady_state(rig, [0.4, 0.0, 1.3], harmonics=8, grid_bits=7)
    again = type(none).load(none.save(tmp_path / "none.nc"))
    assert repr(again) == repr(none) and "unheld" in repr(again) and np.isnan(again.rms)


@pytest.fixture(scope="module")
def batches():
    """Two runs side by side, as `jax.vmap` makes them, two such steady states, and their rig."""
    rig, t = machine(), np.arange(1201) / 300
    turns = jnp.asarray([[3.0, -5.0, 7.0], [0.4, 0.0, 1.3]])
    runs = jax.vmap(lambda x: propagate(rig, speeds(x), t))(turns)
    each = [steady_state(rig, x, harmonics=8, grid_bits=7) for x in turns.tolist()]
    states = jax.tree.map(lambda *x: jnp.stack(x), *each)
    return rig, runs, states


def test_batches_and_traced_results_say_what_they_are(batches):
    _, runs, states = batches
    assert repr(runs) == "Trajectory(1201 samples, 3 wheels; a batch of 2: 2 ok)"
    assert repr(states) == "SteadyState(a batch of 2: 2 ok)"
    assert "a batch of 2" in runs._repr_html_()
    failed = dataclasses.replace(runs, status=jnp.asarray([[0, 1], [1, 6]]))
    assert failed.message() == "a batch of 2x2: 1 ok, 2 non-finite, 1 interrupted"
    said = []
    jax.eval_shape(lambda run: said.append(repr(run)), jax.tree.map(lambda x: x[0], runs))
    assert said == ["Trajectory(1201 samples, 3 wheels; traced)"]


def test_figures_of_a_batch_are_asked_for_one_by_one(batches):
    """They were those of samples and runs in each other's place, without a word."""
    rig, runs, states = batches
    turning: Any = {"reference": "w2", "channel": "dR_x"}
    for ask in (
        lambda: runs.ok, lambda: runs.lift_off, lambda: runs.slip, lambda: runs.time_reached,
        runs.contact_losses, runs.summary, runs.to_xarray, runs.to_dataframe, runs.plot,
        runs.plot_displacement, lambda: runs.plot_channel("dR"), lambda: runs.save("run.nc"),
        lambda: omnijax.measured(runs, rig), lambda: omnijax.evaluate(runs, rig, "peak"),
        lambda: rpm_order_map(runs, **turning), lambda: order_track(runs, [1], **turning),
        lambda: write_replay(runs, rig, "replay.html"),
        lambda: states.ok, states._repr_html_, states.to_xarray, states.plot_orders,
    ):  # fmt: skip
        with pytest.raises(ValueError, match="this is a batch of 2, from"):
            ask()
    peaks = jax.vmap(lambda run: omnijax.evaluate(run, rig, "peak")["peak"])(runs)
    for i in range(2):
        run = jax.tree.map(lambda x, i=i: x[i], runs)
        assert run.ok and float(peaks[i]) == float(omnijax.evaluate(run, rig, "peak")["peak"])
        np.testing.assert_array_equal(runs["dR_x"][i], run["dR_x"])


def test_a_batch_of_rigs_is_no_rig(batches):
    """Its file was written, and could not be read; as many rigs as wheels were simulated as one."""
    rig, runs, _ = batches
    rigs = jax.vmap(lambda x: omnijax.set_parameter(rig, "wheel.roundness", x))(
        jnp.linspace(0.1, 0.3, rig.size)
    )
    run, turns = jax.tree.map(lambda x: x[0], runs), [1.0] * rig.size
    for ask in (
        lambda: omnijax.simulate(rigs, turns, "0.1 s"), lambda: propagate(rigs, turns, "0.1 s"),
        lambda: steady_state(rigs, turns), lambda: modes(rigs), lambda: omnijax.rig_text(rigs),
        lambda: omnijax.sensitivity(rigs, turns), lambda: omnijax.natural_frequencies(rigs),
        lambda: omnijax.sweep(rigs, {"sphere.mass": [1, 2]}, speeds=turns),
        lambda: omnijax.evaluate(run, rigs, "peak"), lambda: omnijax.measured(run, rigs),
        lambda: omnijax.save_rig(rigs, "rigs.toml"),
        lambda: omnijax.get_parameter(rigs, "wheel.w1.roundness"),
        lambda: omnijax.set_parameter(rigs, "wheel.w1.roundness", 0.2),
    ):  # fmt: skip
        with pytest.raises(InputError, match=f"this is a batch of {rig.size} rigs where one"):
            ask()
