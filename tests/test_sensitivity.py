"""Local sensitivities of the rig: exact, checked, and honest about what has no influence."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from omnijax import load_rig, set_parameter
from omnijax.cli._frame import run
from omnijax.rig import InputError
from omnijax.simulation import propagate, speeds
from omnijax.study import Sensitivity, sensitivity
from omnijax.vibration import evaluate, steady_metrics

SPEED = (3.0, 5.1, 7.3)


@pytest.fixture(scope="module")
def found():
    return sensitivity("atlas", SPEED, ("rms", "peak", "slip_margin"), check=True)


def test_derivatives_agree_with_finite_differences(found):
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


def test_a_run_has_the_derivatives_of_its_own_samples():
    rig = load_rig("atlas")
    paths = ["contact.stiffness", "wheel.roundness"]
    found = sensitivity(rig, SPEED, "rms,peak_x", duration=0.2, parameters=paths)
    assert found.method == "propagation" and len(found.parameters) == 6
    ts = jnp.linspace(0, 0.2, 101)

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


def test_steady_metrics_are_those_of_a_long_run():
    """RMS values and extremes of 20 s after 10 s, against the closed forms.

    The slowest wheel passes N = 134 rollers in that time: its mean square over a record that is no
    whole number of them errs by up to 1/(2 pi N), its RMS by 6e-4, which is what is found (at most
    6.2e-4).  Extremes are met only between samples and where all phases come together: 6.1e-3.
    """
    rig = load_rig("atlas")
    names = ("elastic_rms", "rms_y", "sphere_acceleration_rms", "sphere_weighted_acceleration",
             "slip_margin", "lift_off_margin", "peak_y", "peak_to_peak_z")  # fmt: skip
    steady = jax.jit(lambda r: steady_metrics(r, jnp.array(SPEED), names))(rig)
    ts = jnp.arange(10.0, 30.0, 1 / 250)
    run_ = propagate(rig, speeds(SPEED), jnp.concatenate([jnp.zeros(1), ts]))
    run_ = jax.tree.map(lambda x: x[1:] if jnp.ndim(x) else x, run_)
    long = evaluate(run_, rig, names)
    for name in names:
        close = 1.5e-3 if "rms" in name or "weighted" in name else 1e-2
        assert np.isclose(float(steady[name]), float(long[name]), rtol=close), name
    assert float(steady["slip_margin"]) <= float(long["slip_margin"]) * (1 + 1e-9)
    assert float(steady["peak_y"]) >= float(long["peak_y"]) * (1 - 1e-9)


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
