"""Numbers that a rig file takes for exact: told where one that is off closes the gap."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from seeds import drawn_anew
from test_plant import load_plant, runs_of

from omnijax.diagnosis import Effect, Point, RigModel
from omnijax.diagnosis._answer import Unlisted, Verdict
from omnijax.diagnosis._answer.unlisted import unlisted
from omnijax.diagnosis._answered import _beside_unlisted
from omnijax.diagnosis._search import refit
from omnijax.laws import EFFECTS
from omnijax.rig import load_rig

pytestmark = pytest.mark.long


def calibrated(folder, change):
    """(model, its fit without effects) of a machine of which one number is off by a factor."""
    rng, plant = drawn_anew("a part out of tolerance"), load_plant()
    stated = plant.machine(rng)
    true: dict[str, Any] = plant.perturbed(rng, stated)
    true |= {key: factor * true[key] for key, factor in change(rng).items()}
    torque = np.stack([plant.torques(true, plant.wander(rng, 2.0)) for _ in range(2)])
    tables = plant.record(stated, true, {}, torque, rng)
    plant.write_case(folder, stated, tables)
    rig, runs = load_rig(folder / "rig.toml"), runs_of(tables, ["train", "held-out"])
    model = RigModel(rig, runs, plant.NOISE, dict(EFFECTS))
    fit = refit(model, Point(np.zeros(len(model.priors))))
    model.rebase(fit.point)
    return model, refit(model, fit.point), true, stated


def test_an_inertia_that_is_off_and_not_listed_is_told_with_its_number(tmp_path):
    """It was `unknown` without a hint, or five effects that no machine has."""

    def heavier(rng):
        return {"I": 1 + rng.choice([-1, 1]) * rng.uniform(0.02, 0.05)}

    model, fit, true, stated = calibrated(tmp_path, heavier)
    told = {x.path: x for x in unlisted(model, fit, 0.95)}
    assert "sphere.inertia" in told
    ((value, there, sigma),) = told["sphere.inertia"].numbers.values()
    assert value == pytest.approx(stated["I"]) and abs(there - true["I"]) < 5 * sigma
    assert sigma < 0.01 * value
    assert '"sphere.inertia" under [uncertainty]' in told["sphere.inertia"].said()


def test_of_a_machine_as_its_file_says_no_number_is_told(tmp_path):
    model, fit, *_ = calibrated(tmp_path, lambda rng: {})
    assert unlisted(model, fit, 0.95) == []


@pytest.mark.parametrize("further, says", [(-5.0, "unknown"), (5.0, "unknown"), (50.0, "named")])
def test_several_effects_are_not_named_where_one_number_explains_as_much(further, says):
    effects = tuple(Effect("motor-gain", f"w{i}", {"g": -0.03}) for i in (1, 2, 3))
    number = Unlisted("sphere.inertia", {"sphere.inertia": (12.0, 12.4, 0.01)}, 1.0, 1e4 + further)
    evidence: Any = SimpleNamespace(
        model=SimpleNamespace(tell=str, settings=SimpleNamespace(equal_margin=12.0)),
        unlisted=lambda fit: [number],
    )

    def judged(count):
        point = Point(np.zeros(0), effects[:count])
        fit = SimpleNamespace(point=point, cost=1e4, free=(None,) * count)
        outcome: Any = SimpleNamespace(fit=fit, baseline=None)
        return _beside_unlisted(evidence, outcome, Verdict("named", 1.0, {}, "confirmed"))

    assert judged(3).verdict == says
    assert judged(1).verdict == "named"  # as many numbers: the effect is as likely
    assert says == "named" or "sphere.inertia" in judged(3).reason
