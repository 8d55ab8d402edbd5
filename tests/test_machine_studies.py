"""Sweep, sensitivity and replay of an axis: its free run under a log, against runs one by one."""

import json

import numpy as np
import pytest
from tiers import more, tiered

from omnijax import cli
from omnijax.machine import LogFile, free_run, parse_machine, read_log
from omnijax.rig import InputError
from omnijax.study import MachineSweep, Sensitivity, sensitivity_machine, sweep_machine

STEP, COUNT = 4e-3, 400


def made(folder, seed: int):
    """A random axis with dry friction and a log of it: (file, log, its table's path)."""
    rng = np.random.default_rng(seed)
    J = 10 ** rng.uniform(-3, -1)
    data = {
        "kind": "axis", "motor": {"input": "torque"},
        "axis": {"inertia": J, "damping": 3 * J, "stiffness": rng.uniform(50, 120) * J},
        "effect": [{"id": "bearing-coulomb",
                    "parameters": {"torque": rng.uniform(1, 3) * J, "width": 0.1}}],
    }  # fmt: skip
    file, t = parse_machine(data), np.arange(COUNT) * STEP
    u = 60 * J * np.sin(rng.uniform(5, 9) * t)
    run = free_run(file.machine, file.placed, {"position": (0.0, 0.0)}, {"input": u}, STEP)
    q = run["position"] + 1e-4 * rng.normal(size=COUNT)
    path = folder / "log.csv"
    np.savetxt(path, np.stack([t, u, q], 1), delimiter=",", header="t,input,position", comments="")
    return file, read_log(LogFile(path, path), file.machine.inputs, file.machine.outputs), path


def rms(data, log):
    """The misfit of one machine by itself."""
    file, q = data, log.outputs["position"]
    got = free_run(file.machine, file.placed, log.start, log.inputs, log.step)["position"]
    return float(np.sqrt(np.mean((q - got) ** 2)))


@pytest.mark.parametrize("seed", tiered(range(2), bool))
def test_figures_and_derivatives_are_those_of_single_runs(tmp_path, seed):
    file, log, _ = made(tmp_path, seed)
    J = float(file.machine.inertia)
    vary = {"axis.inertia": [0.9 * J, J, 1.3 * J], "effect.bearing-coulomb.torque": [0.0, J]}
    found = sweep_machine(file, log, vary, "rms,peak")
    assert found.values.shape == (6, 2)
    for (inertia, torque), figures in zip(found.values, found.figures, strict=True):
        text = {
            "inertia": float(inertia),
            "damping": 3 * J,
            "stiffness": float(file.machine.stiffness),
        }
        effect = {"id": "bearing-coulomb", "parameters": {"torque": float(torque), "width": 0.1}}
        one = parse_machine({"kind": "axis", "motor": {"input": "torque"}, "axis": text,
                             "effect": [effect]})  # fmt: skip
        assert figures[0] == pytest.approx(rms(one, log), rel=1e-3)
    again = MachineSweep.from_xarray(found.to_xarray())
    assert repr(again) == repr(found)
    axes = found.plot("peak", "axis.inertia")
    drawn = axes.lines[0].get_xydata()
    given = np.stack([found.values[:, 0], found.figures[:, 1]], axis=1)
    np.testing.assert_allclose(drawn / drawn[0], given / given[0])
    assert "inertia" in axes.get_xlabel() and axes.get_ylabel().startswith("peak")
    with pytest.raises(ValueError, match=r"`axis\.mass` must be one of axis\.inertia"):
        found.plot(path="axis.mass")
    # beside the optimum, where the misfit is smooth
    other = parse_machine({"kind": "axis", "motor": {"input": "torque"},
                           "axis": {"inertia": 1.2 * J, "damping": 3 * J,
                                    "stiffness": float(file.machine.stiffness)}})  # fmt: skip
    slopes = sensitivity_machine(other, log, "rms", ["axis.inertia", "axis.damping"])
    assert isinstance(slopes, Sensitivity)
    for k, path in enumerate(slopes.parameters):
        x, h = slopes.values[k], 1e-4 * slopes.values[k]
        near = sweep_machine(other, log, {path: [x - h, x + h]}, "rms").figures[:, 0]
        assert slopes.raw[0, k] == pytest.approx((near[1] - near[0]) / (2 * h), rel=1e-3)


def test_commands_answer_and_refuse(tmp_path, capsys):
    file, _, log = made(tmp_path, 3)
    J = float(file.machine.inertia)
    path = tmp_path / "machine.toml"
    from omnijax.machine import machine_text

    path.write_text(machine_text(file))
    out = tmp_path / "s.nc"
    line = ["sweep", str(path), "--drive", str(log), "--vary", f"axis.inertia={J / 2}:{1.5 * J}:11",
            "--out", str(out), "--json"]  # fmt: skip
    assert cli.run(line) == 0
    best = json.loads(capsys.readouterr().out)["best"]["rms"]
    assert best["axis.inertia"] == pytest.approx(J, rel=1e-6)
    assert MachineSweep.load(out).best("rms") == best["design"]
    assert cli.run(["sensitivity", str(path), "--drive", str(log), "--json"]) == 0
    assert (
        "effect.bearing-coulomb.torque"
        in json.loads(capsys.readouterr().out)["metrics"]["rms"]["raw"]
    )
    page = tmp_path / "r.html"
    assert cli.run(["replay", str(path), "--drive", str(log), "--out", str(page)]) == 0
    assert "measured less simulated" in page.read_text().lower()
    capsys.readouterr()
    for words, said in (
        (["sweep", str(path), "--vary", "axis.inertia=1:2:3"], "--drive LOG"),
        (["sweep", str(path), "--drive", str(log), "--vary", "axis.inerta=1:2:3"], "axis.inertia"),
        (["sweep", str(path), "--drive", str(log), "--vary", "axis.inertia=1:2:3", "--speed", "1"],
         "--speed belongs to rigs"),
        (["sweep", str(path), "--drive", str(log), "--vary", "axis.inertia=1:2:3",
          "--rtol", "1e-5"], "--rtol belongs to rigs"),
        (["sensitivity", str(path), "--drive", str(log), "--metric", "peek"], "peek"),
    ):  # fmt: skip
        assert cli.run(words) == 2
        assert said in capsys.readouterr().err
    with pytest.raises(InputError, match="among rms, mae, peak"):
        sweep_machine(file, made(tmp_path, 3)[1], {"axis.inertia": [1.0]}, "noise")


def test_what_is_wrong_with_a_log_is_told(tmp_path, capsys):
    from omnijax.machine import machine_text

    file, _, log = made(tmp_path, 5)
    path = tmp_path / "machine.toml"
    path.write_text(machine_text(file))
    table = np.genfromtxt(log, delimiter=",")[1:]
    table[40, 2] = np.nan
    np.savetxt(log, table, delimiter=",", header="t,input,position", comments="")
    for words in (["simulate"], ["sensitivity"], ["sweep", "--vary", "axis.inertia=1,2"]):
        command, *more = words
        assert cli.run([command, str(path), "--drive", str(log), *more]) == 0
        assert "warning: log.csv: 1 rows have no number" in capsys.readouterr().err


def test_a_log_of_inputs_alone_moves_an_axis_from_rest(tmp_path, capsys):
    from omnijax.machine import machine_text

    file, run, log = made(tmp_path, 4)
    path, inputs, out = (tmp_path / name for name in ("machine.toml", "inputs.csv", "run.csv"))
    path.write_text(machine_text(file))
    table = np.genfromtxt(log, delimiter=",", names=True)
    np.savetxt(inputs, np.stack([table["t"], table["input"]], 1), delimiter=",",
               header="t,input", comments="")  # fmt: skip
    line = ["simulate", str(path), "--drive", str(inputs), "--json", "--out", str(out)]
    assert cli.run(line) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["rms"], summary["mae"], summary["samples"]) == (None, None, COUNT)
    expected = free_run(file.machine, file.placed, {"position": (0.0, 0.0)}, run.inputs, STEP)
    written = np.genfromtxt(out, delimiter=",", names=True)
    for name in ("position", "velocity"):
        np.testing.assert_allclose(written[name], expected[name], rtol=1e-9, atol=1e-12)
    out.unlink()
    assert cli.run(line[:4]) == 0
    assert "measured no motion: the machine began at rest at 0" in capsys.readouterr().out
    assert cli.run(["sweep", *line[1:4], "--vary", "axis.inertia=1:2:3"]) == 2
    assert "no column `position` (rad) or `velocity` (rad/s)" in capsys.readouterr().err


@pytest.mark.parametrize("motion, law, keys", [
    ("translation", "bearing-coulomb", {"torque": "N", "width": "m/s"}),
    *more(("rotation", "mount-cubic", {"k3": "N m/rad^3"}),
          ("rotation", "mount-friction", {"force": "N m", "width": "rad/s"})),
])  # fmt: skip
def test_numbers_of_effects_are_in_the_units_of_the_motion(tmp_path, motion, law, keys):
    _, log, _ = made(tmp_path, 6)
    effect = {"id": law, "parameters": dict.fromkeys(keys, 0.1)}
    file = parse_machine({"kind": "axis", "motion": motion, "motor": {}, "effect": [effect],
                          "axis": {"inertia": 1.0, "stiffness": 1.0}})  # fmt: skip
    for key, unit in keys.items():
        path = f"effect.{law}.{key}"
        result = sweep_machine(file, log, {path: f"50 m{unit}:80 m{unit}:2"})
        assert result.units == (unit,) and sensitivity_machine(
            file, log, parameters=[path]
        ).units == (unit,)
        np.testing.assert_allclose(result.values[:, 0], [0.05, 0.08])
        assert result.to_xarray()["parameter_unit"].values.tolist() == [unit]


def test_lists_of_an_effect_are_no_numbers_to_vary(tmp_path):
    _, log, _ = made(tmp_path, 6)
    lists = {"orders": [7, 14], "amplitudes": [0.02, 0.01], "phases": [0.1, 0.2]}
    file = parse_machine({"kind": "axis", "motor": {}, "axis": {"inertia": 1.0, "stiffness": 1.0},
                          "effect": [{"id": "cogging", "parameters": lists}]})  # fmt: skip
    result = sensitivity_machine(file, log)
    assert "axis.inertia" in result.parameters
    assert not [p for p in result.parameters if "cogging" in p]
