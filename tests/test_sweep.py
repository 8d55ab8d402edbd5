"""Sweeps as numbers: against single runs, methods of evaluation, statuses, gradients, devices."""

import json
import subprocess
import sys
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compilations import counted
from machines import SKEW, machine
from rigs import tables

import omnijax
from omnijax import InputError, load_rig, load_sweep, sensitivity, set_parameter, sweep
from omnijax._errors import DataWarning
from omnijax._status import Status
from omnijax.cli._frame import run
from omnijax.laws import EFFECTS, FloorVibration, LiftOff
from omnijax.rig import parse_rig
from omnijax.simulation import propagate, ramp, simulate, speeds, steady_state, torques
from omnijax.study._axes import read_axis
from omnijax.study._evaluation import Question, drive_of
from omnijax.study._evaluation.evaluation import without_failed
from omnijax.study._evaluation.methods import choose
from omnijax.study._target import read_axes
from omnijax.vibration import evaluate

pytestmark = [pytest.mark.long, pytest.mark.brief]

VARY = {"wheel.roundness": "0.2:0.6:4", "contact.stiffness": "log:5e4:1e6:5"}
SPEEDS = (0.1, 1.2, 0.3)
AXIS = read_axis("sphere.mass", "5,6", "kg")


@pytest.mark.full
def test_steady_sweep_is_the_steady_state_of_each_design():
    result = sweep("atlas", VARY, speeds=SPEEDS, chunk=2)
    assert result.spec.method == "steady-bulk" and result["peak"].shape == (4, 5)
    rig = set_parameter(load_rig("atlas"), "wheel.roundness", 0.6)
    rig = set_parameter(rig, "contact.stiffness", 1e6)
    alone = steady_state(rig, np.array(SPEEDS))
    for name in ("peak", "rms"):
        assert result[name][-1, -1] == pytest.approx(float(getattr(alone, name)), rel=1e-9)
    data = result.to_xarray()
    assert data["rms"].sel({"wheel.roundness": 0.6}).shape == (5,)
    assert data["rms"].attrs["units"] == "m" and "20 ok" in repr(result)
    assert result.best("peak") == int(np.argmin(result["peak"]))


@pytest.mark.full  # in the gate the slopes that it takes: test_steady_bulk
def test_gradient_is_the_slope_between_designs():
    """Central differences over 1e-4 of the parameter: error (1e-4)^2 times the curvature."""
    h = 1e-4
    vary = {"contact.stiffness": [1e5 * (1 - h), 1e5, 1e5 * (1 + h)], "speed.w2": [1.2, 1.3]}
    result = sweep("atlas", vary, "rms", speeds=SPEEDS, chunk=2, gradient=True)
    slope = (result["rms"][2] - result["rms"][0]) / (2e5 * h)
    np.testing.assert_allclose(result["d_rms.contact.stiffness"][1], slope, rtol=1e-5)
    assert result.unit("d_rms.contact.stiffness") == "m/(N/m)"
    assert result.unit("d_rms.speed.w2") == "m/(rad/s)"
    assert (result["d_rms.speed.w2"] != 0).all()


@pytest.mark.full
def test_slopes_of_an_output_that_shows_no_pole():
    """In the paper's model the floor alone moves the platform: in proportion to its amplitude.

    Such a sweep, and a global study of any figure of that output, ended in an `IndexError`.
    """
    floor = FloorVibration(*map(jnp.asarray, (0.3, 12.0, 0.4, [1.0, 2.0, 3.0])))
    rig, path = machine(SKEW).add(floor, "platform"), "effect.floor-vibration.platform.amplitude"
    given = {"speeds": SPEEDS, "duration": 0.2, "rate": 333, "model": "paper"}
    metric = "platform_acceleration_rms"
    result = sweep(rig, {path: [0.3, 0.4]}, metric, gradient=True, **given)
    assert result.spec.method == "bulk" and (result[metric] > 0.1).all()
    slope = result[metric] / [0.3, 0.4]
    np.testing.assert_allclose(result[f"d_{metric}.{path}"], slope, rtol=1e-9)


@pytest.mark.full  # in the gate with a force, below
def test_runs_with_a_duration_agree_with_one_run():
    """In bulk the same 21 samples count, the start among them."""
    vary = {"speed.scale": [0.5, 2.0], "wheel.w2.contact.stiffness": [1e5, 2e5]}
    numerics = {"speeds": SPEEDS, "duration": 0.2, "rate": 100, "chunk": 2}
    result = sweep("atlas", vary, "rms", **numerics)
    assert result.spec.method == "bulk" and "linear" in result.method
    rig = set_parameter(load_rig("atlas"), "wheel.w2.contact.stiffness", 2e5)
    alone = omnijax.propagate(rig, speeds([0.2, 2.4, 0.6]), np.linspace(0, 0.2, 21))
    expected = float(evaluate(alone, rig, ("rms",))["rms"])
    assert result["rms"][1, 1] == pytest.approx(expected, rel=1e-9)


@pytest.mark.full
def test_gradients_of_runs_are_slopes_between_designs():
    """By quantities of the rig, of all wheels and of the drive."""
    h, rig = 1e-5, machine(SKEW)
    base = {"wheel.roundness": 0.45, "contact.damping": 130.0, "speed.scale": 1.1}
    vary = {path: value * (1 + h * np.arange(-1, 2)) for path, value in base.items()}
    given = {"drive": speeds((2.1, 3.4, 5.3)), "duration": 0.3, "rate": 500, "chunk": 27}
    result = sweep(rig, vary, "rms,peak", gradient=True, **given)
    assert result.spec.method == "bulk" and result.counts() == {"ok": 27}
    for metric in ("rms", "peak"):
        for axis, (path, value) in enumerate(base.items()):
            line = np.moveaxis(result[metric], axis, 0)[:, 1, 1]
            slope = (line[2] - line[0]) / (2 * h * value)
            assert result[f"d_{metric}.{path}"][1, 1, 1] == pytest.approx(slope, rel=1e-4)


@pytest.mark.full  # in the gate a force as a quantity: test_one_evaluation
def test_a_force_on_the_platform_counts_in_every_row():
    """Given or varied; in steady states too by the contract of `test_one_evaluation`."""
    at, varied = (0.0, 30.0, 0.0), {"force.x": [0.0, 50.0, 100.0]}
    drive, rig = speeds(SPEEDS, at), load_rig("atlas")
    runs = sweep(rig, varied, "rms,peak", drive=drive, duration=0.2, rate=100, chunk=3)
    assert runs.spec.method == "bulk"
    for i, x in enumerate((0.0, 50.0, 100.0)):
        force = np.array([x, *at[1:]])
        run = omnijax.simulate(rig, speeds(SPEEDS, force), np.linspace(0, 0.2, 21))
        alone = evaluate(run, rig, ("rms", "peak"))
        assert runs["rms"][i] == pytest.approx(float(alone["rms"]), rel=1e-9)
        assert runs["peak"][i] == pytest.approx(float(alone["peak"]), rel=1e-9)
    assert np.ptp(runs["rms"]) > 1e-5


def test_statuses_of_full_runs_and_the_command_that_reruns_one(tmp_path, capsys):
    """Tsit5 at K = 1e11 N/m needs far more than 60 steps, unless no load closes the contact."""
    rig = load_rig("atlas").add(LiftOff(), "all")
    vary = {
        "contact.stiffness": [1.9e5, 1e11],
        "closure.preload": [0.0, 150.0],
        "contact.friction": [1e-6, 0.9],
    }
    numerics = {"solver": "tsit5", "rtol": 1e-5, "max_steps": 60, "duration": 0.02, "rate": 200}
    out, drive = tmp_path / "full.zarr", torques((0.1, 0.2, 0.3))
    result = sweep(rig, vary, "rms", drive=drive, chunk=3, out=out, **numerics)
    assert result.spec.method == "full" and "torques" in result.method
    status = [Status(k).text for k in result.store.read("status")]
    lifted = ["lift-off", "lift-off"]
    assert status == [*lifted, "slip", "ok", *lifted, "step limit", "step limit"]
    assert np.isfinite(result["rms"][0]).all()  # lift-off and slip keep their figures
    assert np.isnan(result["rms"][1, 1]).all() and result.failed() == [6, 7]
    assert result.best("rms") in range(6)
    command = result.command(6).split()
    assert command[0] == "omnijax" and run(command[1:]) == 1
    text = capsys.readouterr().out
    assert "design 6: step limit" in text and "raise `max_steps`" in text


EVERYWHERE = [
    ("contact-hertz", "all", {"exponent": 1.5}),
    ("lift-off", "all", {}),
    ("mount-backlash", "w1", {"gap": 4e-6}),
    ("mount-friction", "w2", {"force": 2.0, "width": 1e-3}),
    ("floor-vibration", "platform",
     {"amplitude": 0.05, "frequency": 11.3, "phase": 0.4, "direction": (0.6, 0.0, 0.8)}),
    ("bearing-coulomb", "all", {"torque": 0.02, "width": 0.05}),
]  # fmt: skip


@pytest.mark.full
def test_torque_driven_sweeps_by_fixed_steps_agree_with_adaptive_runs(tmp_path, monkeypatch):
    """The step is taken so that halving it changes no trial figure by more than 1e-4.

    Whatever acts at the ports: contacts that stiffen and part, play in a mount, friction, a floor.
    """
    rig = load_rig("atlas-tripod")
    for name, place, parameters in EVERYWHERE:
        rig = rig.add(
            EFFECTS[name](**{k: jax.numpy.asarray(v, float) for k, v in parameters.items()}), place
        )
    vary = {"wheel.roundness": [0.3, 0.5], "contact.damping": [120.0, 9e3]}
    given = {"drive": torques((0.1, 0.5, -0.25)), "duration": 0.2, "chunk": 2}
    metrics = ("peak", "rms", "slip_margin")
    whole = sweep(rig, vary, metrics, out=tmp_path / "whole.zarr", **given)
    assert whole.spec.method == "fixed" and "halving the step" in whole.method
    assert "half the step changes those of 4 designs of the answer by" in whole.method
    assert "more than" not in whole.method
    assert load_sweep(tmp_path / "whole.zarr").method == whole.method
    adaptive = sweep(rig, vary, metrics, rtol=1e-8, **given)
    assert adaptive.spec.method == "full" and "tolerance is given" in adaptive.method
    for name in metrics:
        np.testing.assert_allclose(whole[name], adaptive[name], rtol=2e-4)
    assert whole.counts() == adaptive.counts() == {"ok": 4}

    def stop(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match="2 of 4"):
        sweep(rig, vary, metrics, out=tmp_path / "cut.zarr", report=stop, **given)
    resumed = sweep(rig, vary, metrics, out=tmp_path / "cut.zarr", resume=True, **given)
    for name in metrics:
        np.testing.assert_array_equal(resumed[name], whole[name])
    assert resumed.method == whole.method

    def believed(*_):
        return 1, "whoever believes it"

    monkeypatch.setattr("omnijax.study._evaluation.choice.fine_enough", believed)
    for out in (None, tmp_path / "coarse.zarr"):  # steps so coarse are found out afterwards
        with pytest.warns(DataWarning, match=r"more than 0\.0001: give `rtol`"):
            coarse = sweep(rig, vary, metrics, out=out, **given)
        change = float(coarse.method.split("answer by ")[1].split()[0])
        error = max(np.abs(coarse[n] / adaptive[n] - 1).max() for n in metrics)
        assert 1e-4 < change < 2 * error


def dual_rows():
    rows = {"profile": "dual-row", "row_spacing": 0.02, "roundness": 0.4}
    data = tables(*((("wheel", 0, key), value) for key, value in rows.items()))
    return parse_rig(data)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"drive": torques(ramp(0, 1, (0, 0, 0), (0.1, 0.2, 0.3)))}, "constant motor torques"),
        ({"solver": "tsit5"}, "solver or its tolerance"),
        ({"rig": dual_rows()}, "contacts jump between two rows"),
    ],
)
def test_where_torque_driven_sweeps_keep_adaptive_steps(changes, message):
    drive, gradient = changes.get("drive", torques((0.1, 0.2, 0.3))), changes.get("gradient", False)
    spec, why = omnijax.study._sweep.plan.plan(
        changes.get("rig", load_rig("atlas")),
        {"sphere.mass": [5.0, 6.0]},
        "rms",
        drive,
        omnijax.study._sweep.plan.Sampling("grid", None, 0, gradient, None, 1),
        omnijax.study._sweep.plan.Numerics(
            "coupled", changes.get("solver", "auto"), 0.1, None, None, None
        ),
    )
    assert spec.method == "full" and message in why


def test_a_figure_that_is_not_finite_is_said_and_spoils_no_other():
    """Every figure of the design was NaN with it."""
    values, status = without_failed(jax.numpy.array([1.0, jax.numpy.inf]), 4)
    assert int(status) == 1
    np.testing.assert_array_equal(values, [1.0, np.nan])
    values, status = without_failed(jax.numpy.array([1.0, 2.0]), 2)
    assert int(status) == 2 and np.isnan(values).all()


def test_method_follows_from_rig_and_drive():
    rig = load_rig("atlas")

    def method(rig, drive, duration, metrics=("rms",), varied=(), rows=True):
        return choose(Question(rig, (drive,), varied, metrics, "coupled", duration, rows))[0]

    constant, moving = speeds(SPEEDS), speeds(ramp(0, 1, (0, 0, 0), SPEEDS))
    pushed = speeds(SPEEDS, (0.0, 0.0, 9.0))
    assert method(rig, constant, None) == "steady-bulk"
    assert method(rig, constant, None, rows=False) == "steady"
    for drive, varied in ((pushed, ()), (constant, ("force.x",))):
        assert method(rig, drive, None, varied=varied) == "steady-bulk"
    assert method(rig, constant, 2.0) == "bulk"
    assert method(rig, pushed, 2.0) == method(rig, constant, 2.0, varied=("force.x",)) == "bulk"
    assert method(rig, constant, 2.0, rows=False) == "propagation"
    assert method(rig, constant, 2.0, ("slip_margin",)) == "bulk"
    long = Question(rig, (constant,), (), ("rms",), "coupled", 20.0, True, samples=20_001)
    assert choose(long)[0] == "bulk"
    method_of, why = choose(long._replace(metrics=("slip_margin",)))
    assert method_of == "propagation" and "20001 samples are more than 16384" in why
    assert method(load_rig("atlas-tripod"), constant, 2.0) == "bulk"
    assert method(rig, moving, 2.0) == "full"
    assert method(rig.add(LiftOff(), "all"), constant, 2.0) == "full"
    assert method(rig, torques((1, 1, 1)), 2.0) == "fixed"
    assert method(rig, torques(ramp(0, 1, (0, 0, 0), SPEEDS)), 2.0) == "full"
    for case in ((rig, moving), (rig.add(LiftOff(), "all"), constant), (rig, torques((1, 1, 1)))):
        with pytest.raises(InputError, match=r"needs a `duration`: .*, so no closed form gives"):
            method(*case, None)
    with pytest.raises(InputError, match=r"does not give peak_to_peak\.$"):  # there is one
        method(rig, constant, None, ("peak_to_peak",))
    flat = set_parameter(rig, "wheel.w3.normal", rig.wheels.normal[0])
    with pytest.raises(InputError, match=r"do not hold the sphere.*, so there is no steady state"):
        method(flat, constant, None)


def test_another_size_of_sweep_does_not_compile_again():
    asked = {"speeds": SPEEDS, "duration": "0.1 s", "rate": "100 Hz", "chunk": 2}
    sweep("atlas", VARY, **asked)
    compiled = counted()
    larger = {"wheel.roundness": "0.2:0.6:3", "contact.stiffness": "log:5e4:1e6:3"}
    assert sweep("atlas", larger, **asked).counts() == {"ok": 9}
    assert compiled == []
    jax.jit(lambda x: x + len(compiled))(jax.numpy.ones(11))  # what does compile is counted
    assert compiled


@pytest.mark.full
def test_two_devices_give_the_numbers_of_one(tmp_path):
    code = """
import os, sys
os.environ["XLA_FLAGS"] = "--xla_force_host_platform_device_count=2"
from omnijax import sweep
vary = {"wheel.roundness": "0.2:0.6:4", "contact.stiffness": "log:5e4:1e6:5"}
sweep("atlas", vary, speeds=(0.1, 1.2, 0.3), metrics="rms", chunk=4, devices=2, out=sys.argv[1])
"""
    out = tmp_path / "two.zarr"
    subprocess.run([sys.executable, "-c", code, str(out)], check=True)
    one = sweep("atlas", VARY, speeds=SPEEDS, chunk=2)
    np.testing.assert_allclose(load_sweep(out)["rms"], one["rms"], rtol=1e-12)
    with pytest.raises(InputError, match=r"`devices` must lie in \[1, 1\]"):
        sweep("atlas", VARY, speeds=SPEEDS, devices=2)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--vary", "wheel.roundnes=0.1:0.6:4"], "Did you mean `wheel.roundness`?"),
        (["--vary", "sped.scale=1:2:4"], "Did you mean `speed.scale`?"),
        (["--vary", "wheel.roundness=0.6:0.1:4"], "reversed range"),
        (["--vary", "wheel.roundness=0.1:1.3:4"], "must lie in [0, 1], but is 1.3"),
        (["--vary", "wheel.rollers=10:12:5"], "must be a whole number"),
        (["--vary", "platform.gravity=1:2:3"], "is no single number"),
        (["--vary", "wheel.roundness=0.1,0.2", "--metric", "peek"], "Did you mean `peak`?"),
        (["--vary", "wheel.roundness=0.1,0.2", "--duration", "-1"], "(0, inf) s, but is -1"),
        (["--vary", "wheel.roundness=0.1,0.2", "--model", "paper", "--resume"], "give `out`"),
        (["--vary", "wheel.roundness=0.1:0.2", "--sampler", "lhs"], "needs `samples`"),
        (["--vary", "wheel.w1.radius=0.07,0.08", "--vary", "wheel.radius=0.07,0.08"],
         "`wheel.w1.radius` and `wheel.radius` set the same parameter"),
        (["--vary", "speed.scale=1,2", "--vary", "speed.w2=1,2"],
         "`speed.scale` and `speed.w2` set the same parameter"),
        (["--vary", "force.y=1,2", "--vary", "force.scale=1,2"],
         "`force.y` and `force.scale` set the same parameter"),
    ],
)  # fmt: skip
def test_wrong_input_is_one_message_and_exit_code_2(words, message, capsys):
    assert run(["sweep", "atlas", "--speed", "0.1,1.2,0.3", *words]) == 2
    error = capsys.readouterr().err
    assert message in error and "Traceback" not in error


def test_what_cannot_be_varied_is_not_suggested():
    """The whole list was, for one of its numbers."""
    cogging = EFFECTS["cogging"](*jnp.ones((3, 2)))
    rig = load_rig("atlas").add(cogging, "w1")
    with pytest.raises(InputError) as error:
        sweep(rig, {"effect.cogging.w1.amplitudes.0": [1, 2]}, speeds=SPEEDS)
    assert "amplitudes.0" in str(error.value) and "Did you mean" not in str(error.value)


def test_every_wrong_axis_is_said_at_once():
    with pytest.raises(InputError) as error:
        sweep("atlas", {"a": "1:2:3", "wheel.radius": "2:1:3"}, speeds=SPEEDS)
    assert len(error.value.problems) == 2


def test_number_of_wheels_is_checked():
    with pytest.raises(InputError, match="2 wheels, but the rig has 3"):
        sweep("atlas", VARY, speeds=(1, 2))
    with pytest.raises(InputError, match="2 wheels, but the rig has 3"):
        sweep("atlas", VARY, drive=torques((1, 2)), duration=1)
    with pytest.raises(InputError, match="2 wheels, but the rig has 3"):
        sensitivity("atlas", torques((1, 2)), duration=1)


def test_a_drive_is_read_as_simulate_reads_it():
    """Sweeps and sensitivities took no text, and numbers that are not finite."""
    asked = (
        lambda drive: simulate("atlas", drive, "0.1 s"),
        lambda drive: propagate("atlas", drive, "0.1 s"),
        lambda drive: sweep("atlas", VARY, drive=drive, duration="0.1 s", rate="100 Hz"),
        lambda drive: sensitivity("atlas", drive, duration="0.1 s", rate="0.1 kHz"),
    )
    wrong: list[tuple[Any, str]] = [
        ("fast", "`speed` must be a number in rad/s"),
        ((1, 2, np.nan), "`speed` must be finite, but is nan"),
        (frozenset("a"), "a drive is one of omnijax, or wheel speeds, but not"),
        (speeds((1, 2, 3), force=(np.inf, 0, 0)), "`force` must be finite, but is inf"),
        (speeds((1, 2, 3), initial_angle=(1, 2)), "`initial_angle` must have 3 entries, but"),
        (speeds((1, 2, 3), initial_angle=(1, 2, np.nan)), "`initial_angle` must be finite"),
    ]
    for drive, says in wrong:
        for ask in asked:
            with pytest.raises(InputError, match=says):
                ask(drive)
    for wanted in ((1, 2), (1, np.inf, 3)):
        with pytest.raises(InputError, match="`initial_velocity` must"):
            simulate("atlas", torques((1, 2, 3), initial_velocity=wanted), "0.1 s")
    turns, text = (1.2 * np.pi, 0.5, 0.1), "36 rpm, 0.5, 0.1"
    for ask in (
        lambda drive: sweep("atlas", VARY, speeds=drive, duration="0.1 s", rate="100 Hz")["rms"],
        lambda drive: sweep("atlas", VARY, drive=drive, duration="0.1 s", rate="100 Hz")["rms"],
        lambda drive: sensitivity("atlas", drive, parameters="sphere.mass, wheel.radius").raw,
    ):
        np.testing.assert_allclose(ask(text), ask(turns), rtol=1e-12)


def test_command_prints_what_a_machine_reads(capsys, tmp_path):
    picture = tmp_path / "map.svg"
    words = ["sweep", "atlas", "--speed", "0.1,1.2,0.3", "--chunk", "2", "--plot", str(picture)]
    words += ["--duration", "0.1s", "--rate", "100Hz"]  # a program of the tests above
    for path, text in VARY.items():
        words += ["--vary", f"{path}={text}"]
    assert run([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["designs"] == 20 and found["method"] == "bulk"
    assert found["status"] == {"ok": 20}
    assert found["best"]["peak"]["unit"] == "m" and picture.stat().st_size > 1000
    assert run(words) == 2  # the picture is there
    assert "map.svg" in capsys.readouterr().err
    assert run([*words, "--overwrite"]) == 0
    assert "20 designs by" in capsys.readouterr().out


def test_axes_of_unlike_wheels_go_together():
    vary = {"wheel.w1.radius": [0.07, 0.08], "wheel.w2.radius": [0.07, 0.08], "speed.w1": [1, 2],
            "speed.w2": [1, 2], "force.x": [1, 2], "force.y": [1, 2]}  # fmt: skip
    rig = load_rig("atlas")
    assert [axis.path for axis in read_axes(rig, drive_of(SPEEDS, rig), vary)] == list(vary)


@pytest.mark.parametrize("made", [speeds, torques])
@pytest.mark.parametrize("force", [None, 0.0, (1.0, 2.0)])
def test_a_force_of_other_than_three_components_is_refused(made, force):
    """None had become a force of NaN, and a steady sweep took a single number."""
    with pytest.raises(InputError, match="`force` must have 3 components, but "):
        made((1.0, 2.0, 3.0), force)


@pytest.mark.full
def test_a_solver_that_is_asked_for_by_name_is_taken():
    """A linear rig at constant speeds had gone by exact propagation whichever was asked for."""
    given = {"duration": 0.2, "rate": 200}
    ranges = {"contact.stiffness": [1e5, 2e5]}
    exact, stepped = (
        sweep("atlas", ranges, ("rms",), speeds=(1.0, 2.0, 3.0), solver=solver, **given)
        for solver in ("exact", "tsit5")
    )
    assert exact.spec.method == "bulk" and stepped.spec.method == "full"
    np.testing.assert_allclose(stepped["rms"], exact["rms"], rtol=1e-3)
