"""Runge-Kutta steps of a free run: those that its own motion needs, whichever study runs it."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from seeds import drawn_anew
from tiers import tiered

from omnijax import cli
from omnijax.diagnosis._ode._rows.numbers import Numbers
from omnijax.diagnosis._ode._rows.programs import slopes_along
from omnijax.diagnosis._ode._rows.rows import OdeRun
from omnijax.diagnosis._search import Effect, Point
from omnijax.laws import AXIS_EFFECTS
from omnijax.machine import (
    Axis,
    LogFile,
    free_run,
    machine_text,
    parse_machine,
    read_log,
    steps_for,
    vector_field,
)
from omnijax.machine._steps import EXACT
from omnijax.study import sensitivity_machine, sweep_machine

STEP, COUNT = 1e-2, 300


def drawn(kind: str, seed: int):
    """A random machine with its input (t,): one of two inertias with play, or a stiff cubic."""
    rng = np.random.default_rng(seed)
    J = 10 ** rng.uniform(-4, -2)
    t = np.arange(COUNT) * STEP
    u = rng.uniform(0.8, 1.2) * np.sin(2 * np.pi * rng.uniform(0.4, 1.5) * t)
    data = {"kind": "axis", "motor": {}, "axis": {"inertia": J, "damping": 4 * J}}
    if kind == "cubic":
        data["axis"]["stiffness"] = 20 * J
        data["effect"] = [{"id": "mount-cubic", "parameters": {"k3": 10 ** rng.uniform(0, 1.5)}}]
        return parse_machine(data), u
    data["axis"] |= {"gravity": 1.0, "damping": 1e-2}
    data["second"] = {"inertia": 10 * J, "stiffness": 2e5 * J * rng.uniform(1, 5),
                      "damping": 5 * J * rng.uniform(1, 5)}  # fmt: skip
    if kind == "play":
        data["second"]["play"] = rng.uniform(0.005, 0.02)
    return parse_machine(data), u


def reference(file, u) -> np.ndarray:
    """Positions (t,) of the motion from rest by another integrator, to close tolerances."""
    import jax

    rate, join, _ = vector_field(file.machine, file.placed)
    rate, times = jax.jit(rate), np.arange(COUNT) * STEP
    start = np.asarray(join(np.zeros(2 if file.machine.second_inertia is None else 4)))

    def slope(t, x):
        return np.asarray(rate(x, {"input": np.interp(t, times, u)}))

    return solve_ivp(slope, (0, times[-1]), start, "LSODA", times, rtol=1e-8, atol=1e-10,
                     max_step=STEP / 4).y[0]  # fmt: skip


@pytest.mark.parametrize("kind", tiered(["play", "cubic", "linear"], "play".__ne__))
@pytest.mark.parametrize("seed", tiered(range(2), bool))
def test_a_free_run_follows_what_stiffens_on_its_way(kind, seed):
    file, u = drawn(kind, seed)
    got = free_run(file.machine, file.placed, {"position": (0.0, 0.0)}, {"input": u}, STEP)
    true = reference(file, u)
    assert np.max(np.abs(got["position"] - true)) < 5e-3 * np.ptp(true)


def log_of(folder, u, q):
    """A log of an input and positions, and its file."""
    path = folder / "log.csv"
    table = np.stack([np.arange(COUNT) * STEP, u, q], 1)
    np.savetxt(path, table, delimiter=",", header="t,input,position", comments="")
    return read_log(LogFile(path, path), {"input": "N m"}, {"position": "rad"}), path


@pytest.mark.full  # in the gate figures of single runs: test_machine_studies
def test_studies_agree_and_no_design_hangs_on_those_beside_it(tmp_path):
    file, u = drawn("cubic", 0)
    log, _ = log_of(tmp_path, u, reference(file, u))
    made = free_run(file.machine, file.placed, log.start, log.inputs, log.step)["position"]
    rms = float(np.sqrt(np.mean((log.shown - made) ** 2)))
    k3 = float(file.placed[0].law.k3)
    slopes = sensitivity_machine(file, log, "rms", ["axis.inertia"])
    assert slopes.values[0] == pytest.approx(float(file.machine.inertia))
    assert slopes.figures[0] == pytest.approx(rms, rel=1e-6)
    for others in ([], [100 * k3]):
        vary = {"effect.mount-cubic.k3": [k3, *others]}
        assert sweep_machine(file, log, vary).figures[0, 0] == pytest.approx(rms, rel=2e-2)


def test_what_cannot_be_followed_is_said(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("omnijax.machine._steps.LONGEST", 10**5)
    data = {"kind": "axis", "motor": {}, "axis": {"inertia": 1e-3, "stiffness": 1.0}}
    steep = {"id": "bearing-coulomb", "parameters": {"torque": 0.1, "width": 1e-7}}
    file, t = parse_machine(data | {"effect": [steep]}), np.arange(COUNT) * STEP
    log, path = log_of(tmp_path, np.sin(t), 0.1 * np.sin(t))
    machine = tmp_path / "machine.toml"
    machine.write_text(machine_text(file))
    for command in ("simulate", "sensitivity"):
        assert cli.run([command, str(machine), "--drive", str(path), "--json"]) == 1
        assert "the effect `bearing-coulomb`" in capsys.readouterr().err
    with pytest.warns(UserWarning, match="1 of 2 designs cannot be followed"):
        made = sweep_machine(file, log, {"effect.bearing-coulomb.width": [0.1, 1e-7]})
    assert np.isfinite(made.figures[:, 0]).tolist() == [True, False]
    away = data | {"axis": data["axis"] | {"stiffness": 0.0},
                   "effect": [{"id": "mount-quadratic", "parameters": {"k2": -1e3}}]}  # fmt: skip
    machine.write_text(machine_text(parse_machine(away)))
    assert cli.run(["simulate", str(machine), "--drive", str(path), "--json"]) == 1
    assert "leaves all bounds at" in capsys.readouterr().err


def test_free_runs_of_a_diagnosis_follow_the_ends_of_a_play():
    """Whatever a law does inside of them: numbers that widen the play are still followed."""
    file, u = drawn("play", 0)
    q, time = reference(file, u), np.arange(COUNT) * STEP
    run = OdeRun("log", "train", time, {"input": u}, {"position": q}, 10.0)
    backlash = AXIS_EFFECTS["mount-backlash"]
    numbers = Numbers(file.machine, [], [(backlash, "axis")])
    effect = Effect("mount-backlash", "axis", {"gap": np.array([1.0])})
    slopes, axis = slopes_along(numbers, [run]), file.machine
    both = 1 / float(axis.inertia) + 1 / float(axis.second_inertia)
    for effects in ((), (effect,)):
        theta = numbers.vector(Point(np.zeros(0), effects))
        steps = steps_for(np.concatenate(slopes(theta)), STEP)
        assert steps > 0.9 * STEP * np.sqrt(float(axis.second_stiffness) * both) / EXACT


def test_slopes_where_a_run_passes_are_not_those_at_rest():
    """Of dry friction: half of its slope at rest was taken for the damping of a moving axis."""
    rng = drawn_anew("slopes")
    time, width = np.arange(COUNT) * STEP, float(rng.uniform(0.01, 0.05))
    torque, speed = rng.uniform(0.1, 1), rng.uniform(2, 5)
    law = AXIS_EFFECTS["bearing-coulomb"]
    axis = Axis(1.0, damping=0.3)
    run = OdeRun("log", "train", time, {"input": 0 * time}, {"position": speed * time}, 10.0)
    numbers = Numbers(axis, [], [(law, "axis")])
    effect = Effect("bearing-coulomb", "axis", {"torque": torque, "width": width})
    moving, still = slopes_along(numbers, [run])(numbers.vector(Point(np.zeros(0), (effect,))))
    np.testing.assert_allclose(moving[:, 1, 1], -0.3, rtol=1e-6)
    np.testing.assert_allclose(still[:, 1, 1], -0.3 - torque / width, rtol=1e-6)
