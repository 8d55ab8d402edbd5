"""Measured machines: the missing law is named from the plain baseline, test files untouched."""

import importlib
from pathlib import Path

import pytest
from machines import shared

pytestmark = pytest.mark.long

EXPERIMENTS = Path(__file__).parents[1] / "experiments"


def run(name: str, data: Path, monkeypatch) -> dict:
    monkeypatch.syspath_prepend(str(EXPERIMENTS))
    return importlib.import_module(name).main(data, tell=lambda text: None)


def test_dry_friction_of_a_motor_axis_is_named_then_its_asymmetry(monkeypatch):
    found = run("emps", shared("realdata", "emps"), monkeypatch)
    assert found["names"][0] == "bearing-coulomb"
    assert {"friction-asymmetry", "viscous-asymmetry"} & set(found["names"])
    assert any(x == pytest.approx(2513.27, rel=5e-3) for x in found["lines"])  # 2.5 mm of screw
    assert found["baseline train"] == pytest.approx(17.4, abs=0.5)
    assert found["train"] <= 3.2
    assert found["cross-test"] <= 5.4


def test_the_cubic_spring_of_a_circuit_is_named_first(monkeypatch):
    found = run("silverbox", shared("realdata", "silverbox", "SNLS80mV.csv"), monkeypatch)
    assert found["order"][0] == "mount-cubic"
    assert found["linear multisine"] > 6
    assert found["multisine"] <= 0.40
    assert found["arrow"] <= 0.56
