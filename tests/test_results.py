"""Results of one kind: arrays with units, a file and back, words, a table, a picture."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from machines import machine

import omnijax
import omnijax.diagnosis
from omnijax import InputError, laws
from omnijax.simulation import propagate, speeds, steady_state
from omnijax.vibration import modes, order_track, rpm_order_map

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
def results():
    """A result of each kind that computes no study, of one rig."""
    rig = machine().add(laws.WheelRunout(jnp.asarray(1e-4), jnp.asarray(0.3)), "w2")
    run = propagate(rig, speeds([3.0, -5.0, 7.0]), np.arange(1201) / 300)
    turning = {"reference": "w2", "channel": "dR_x"}
    return {
        "steady": steady_state(rig, [0.4, 0.0, 1.3], harmonics=8, grid_bits=7),
        "modes": modes(rig),
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


def test_a_steady_state_that_is_none_says_so_from_its_file(tmp_path):
    normal = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    rig = machine((normal, np.cross([[0.0, 0.0, 1.0]] * 3, normal)))
    none = steady_state(rig, [0.4, 0.0, 1.3], harmonics=8, grid_bits=7)
    again = type(none).load(none.save(tmp_path / "none.nc"))
    assert repr(again) == repr(none) and "unheld" in repr(again) and np.isnan(again.rms)
