"""Local sensitivities of the rig: exact, checked, and honest about what has no influence."""

import importlib
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from omnijax import load_rig, set_parameter
from omnijax._errors import RunError
from omnijax.cli._frame import run
from omnijax.rig import InputError
from omnijax.simulation import propagate, speeds
from omnijax.study import Sensitivity, sensitivity, sensitivity_over_speeds
from omnijax.study._batches import percent_per_percent
from omnijax.vibration import evaluate

pytestmark = pytest.mark.brief

SPEED = (3.0, 5.1, 7.3)


COMPILED = []  # programs since the module began


@pytest.fixture(scope="module")
def found():
    jax.monitoring.register_event_duration_secs_listener(
        lambda event, *_, **__: COMPILED.append(event) if "backend_compile" in event else None
    )
    return sensitivity("atlas", SPEED, ("rms", "peak", "slip_margin"), check=True)


def test_derivatives_agree_with_finite_differences(found):
    assert 2 <= len(COMPILED) < 60  # 685 where the base of the differences was no part of theirs
    assert found.check.worst < 1e-4
    assert np.count_nonzero(found.raw) > 60


def test_scaling_laws(found):
    """Lengths scale together (rms ~ r at fixed shape), forces with preload and friction."""
    slip = found.together("slip_margin")
    rms = found.together("rms")
    # the elastic model is linear: scaling masses, stiffnesses and dampings changes nothing
    linear = (
        "sphere.mass",
        "platform.mass",
        "wheel.mass",
        "contact.stiffness",
        "contact.damping",
        "mount.stiffness",
        "mount.damping",
        "closure.stiffness",
        "sphere.inertia",
    )
    assert abs(sum(rms[name] for name in linear)) < 1e-9
    assert slip["closure.preload"] > 1 and slip["contact.friction"] > 0.9
    # rho ~ r_b f(r_b/R): a machine twice as large vibrates twice as much, but for the drive forces
    assert abs(rms["wheel.radius"] + rms["sphere.radius"] - 1) < 0.01


def test_without_influence_is_named(found):
    quiet = found.without_influence("rms")
    assert "wheel.w3.closure.preload" in quiet and "wheel.w1.contact.friction" in quiet
    assert "wheel.w2.contact.stiffness" not in quiet
    assert "wheel.w3.closure.preload" not in found.without_influence()  # it moves the slip margin
    whole, said = found.sentences()
    assert whole.startswith("`wheel.rollers` takes whole numbers")
    assert "`wheel.inertia` (of every wheel)" in said
    assert said.endswith(" do not influence any of rms, peak, slip_margin.")
    assert "wheel.roundness" in repr(found) and "<td>wheel.roundness</td>" in found._repr_html_()


PATHS = ["contact.stiffness", "wheel.roundness"]


@pytest.mark.full  # in the gate the bulk's (below), and those of propagated runs: test_gradients
def test_metrics_that_the_bulk_does_not_give_have_the_derivatives_of_one_run():
    found = sensitivity("atlas", SPEED, "rms,peak,peak_x", duration=0.2, parameters=PATHS)
    assert found.method == "propagation" and len(found.parameters) == 6
    both = sensitivity("atlas", SPEED, duration=0.2, parameters=PATHS)
    size = np.abs(both.raw).max(axis=1, keepdims=True)
    np.testing.assert_allclose(both.raw / size, found.raw[:2] / size, rtol=0, atol=1e-8)
    np.testing.assert_allclose(both.figures, found.figures[:2], rtol=1e-9)
    ts, rig = jnp.linspace(0, 0.2, 101), load_rig("atlas")

    @jax.jit
    def rms(k):
        changed = set_parameter(rig, "contact.stiffness", k)
        run_ = propagate(changed, speeds(SPEED), ts)
        return evaluate(run_, changed, ("rms",))["rms"]

    k, h = 188208.0, 20.0
    slope = (float(rms(k + h)) - float(rms(k - h))) / (2 * h)
    assert np.isclose(
        found.together("rms")["contact.stiffness"], slope * k / float(rms(k)), rtol=1e-4
    )


@pytest.mark.full
def test_a_run_has_the_derivatives_of_its_own_samples():
    rig = load_rig("atlas")
    found = sensitivity(rig, SPEED, duration=0.2, parameters=PATHS)
    assert found.method == "bulk"  # 20 times faster once its program is there
    k, h = 188208.0, 20.0
    beside = (set_parameter(rig, "contact.stiffness", at) for at in (k - h, k + h))
    left, right = (
        sensitivity(one, SPEED, duration=0.2, parameters=PATHS).figures[0] for one in beside
    )
    relative = (right - left) / (2 * h) * k / found.figures[0]
    assert np.isclose(found.together("rms")["contact.stiffness"], relative, rtol=1e-4)


def test_a_metric_that_is_zero_depends_on_nothing_in_either_kind_of_sensitivity():
    """0 at rest, as `Sensitivity` says; over speeds the slope in the metric's unit had stood."""
    changes, figures = np.array([[3.0, -2.0], [0.5, 0.0]]), np.array([0.0, 2.0])
    np.testing.assert_array_equal(percent_per_percent(changes, figures), [[0, 0], [0.25, 0]])
    one = Sensitivity(("a", "b"), ("", ""), np.ones(2), ("rms", "peak"), ("m", "m"), figures,
                      changes, "steady")  # fmt: skip
    np.testing.assert_array_equal(one.relative, [[0, 0], [0.25, 0]])
    rig = load_rig("atlas")
    centred = set_parameter(rig, "wheel.roundness", 0.0)  # RMS 0, its slope is not
    over = sensitivity_over_speeds(centred, SPEED, [1.0], ("rms",), ("wheel.roundness",))
    assert over.figures == 0 and over.relative == 0


def test_saving(found, tmp_path):
    found.save(tmp_path / "s.nc")
    again = Sensitivity.load(tmp_path / "s.nc")
    assert again.parameters == found.parameters and np.array_equal(again.raw, found.raw)
    assert again.check is not None and again.check.worst == found.check.worst
    assert found.to_xarray()["relative"].attrs["units"] == "% per %"


def test_tornado_shows_the_largest_on_top(found):
    ax = found.plot_tornado("rms", together=True)
    assert ax.get_yticklabels()[0].get_text() == next(iter(found.together("rms")))


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--metric", "rmss", "--speed", "1,2,3"], "`rmss` is no metric. Did you mean `rms`?"),
        (["--speed", "1,2"], "`speed` has 2 values, but the rig has 3 wheels."),
        (["--speed", "1,2,fast"], "`speed` must be a number in rad/s"),
        (["--speed", "1,2,3", "--metric", "peak_to_peak"], "this study needs a `duration`"),
        (["--speed", "1,2,3", "--parameter", "sphere.mas"], "Did you mean `sphere.mass`?"),
    ],
)
def test_wrong_input_on_the_command_line(args, message, capsys):
    assert run(["sensitivity", "atlas", *args]) == 2
    assert message in capsys.readouterr().err


def test_unknown_parameters():
    with pytest.raises(InputError, match="no single number"):
        sensitivity("atlas", SPEED, parameters=["platform.gravity"])


def test_derivatives_that_are_not_finite_are_no_result(monkeypatch):
    """The figures alone were looked at."""
    module = importlib.import_module("omnijax.study._sensitivity.sensitivity")
    raw = np.array([[1.0, np.nan]])
    how = SimpleNamespace(method="steady", precision=1e-12)
    monkeypatch.setattr(module, "_asked", lambda *_: (how, (np.ones(1), raw), None))
    paths = ["sphere.mass", "platform.mass"]
    with pytest.raises(RunError, match=r"derivatives of rms by `platform\.mass` are"):
        module.sensitivity("atlas", [1, 2, 3], "rms", parameters=paths)
