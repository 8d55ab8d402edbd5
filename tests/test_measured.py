"""Measured machines: the missing law is named from the plain baseline, test files untouched."""

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from machines import DATA

pytestmark = [pytest.mark.long, pytest.mark.full]

EXPERIMENTS = Path(__file__).parents[1] / "experiments"


def measured(*parts: str) -> Path:
    """Logs without a licence to pass them on: beside the project, or a skip that says whose."""
    path = Path(__file__).parents[2].joinpath("shared", "realdata", *parts)
    if not path.exists():
        pytest.skip(f"{path} is absent: `{parts[0]}` is on nonlinearbenchmark.org")
    return path


def run(name: str, data: Path, monkeypatch):
    monkeypatch.syspath_prepend(str(EXPERIMENTS))
    return importlib.import_module(name).main(data, tell=lambda text: None)


def of_its_own(name: str, data: Path) -> dict:
    """What `main` answers in a process without the suite's flags, with which long runs are slow."""
    program = (
        f"import json, pathlib, {name}; answer = {name}.main(pathlib.Path({str(data)!r}), print); "
        "answer.pop('found'); print(json.dumps(answer, default=float))"
    )
    env = {k: v for k, v in os.environ.items() if k != "XLA_FLAGS"}
    env["PYTHONPATH"] = os.pathsep.join([str(EXPERIMENTS), env.get("PYTHONPATH", "")])
    line = [sys.executable, "-c", program]
    done = subprocess.run(line, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout.splitlines()[-1])


def test_dry_friction_of_a_motor_axis_is_named_then_its_asymmetry():
    found = of_its_own("emps", measured("emps"))
    assert found["names"][0] == "bearing-coulomb"
    assert {"friction-asymmetry", "viscous-asymmetry"} & set(found["names"])
    assert any(x == pytest.approx(2513.27, rel=5e-3) for x in found["lines"])  # 2.5 mm of screw
    assert found["baseline train"] == pytest.approx(17.4, abs=0.5)
    assert found["train"] <= 3.2
    assert found["cross-test"] <= 5.4
    assert found["free run"] < 0.7 * found["baseline free run"] < 0.014  # m, of the pulses


def test_the_springs_of_a_circuit_are_named_the_cubic_one_first(monkeypatch):
    found, errors = run("silverbox", measured("silverbox", "SNLS80mV.csv"), monkeypatch)
    names = [e.id for e in found.effects]
    assert names[0] == "mount-cubic" and "mount-quadratic" in names
    assert errors["multisine"] <= 0.36  # mV
    assert errors["arrow"] <= 0.52


def test_the_friction_of_a_servo_grows_with_the_load(monkeypatch):
    found, (before, after) = run("servo", DATA / "servo", monkeypatch)
    assert found.effects[0].id == "load-friction-quadratic"
    assert before == pytest.approx(62.5, abs=2)
    assert after <= 40  # mrad
