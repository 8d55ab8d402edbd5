"""Answers beside none, named and unknown: ambiguous with the next experiment; a user's own law."""

import json

import numpy as np
import pytest
from test_plant import load_plant

from omnijax.cli import run
from omnijax.diagnosis import Effect, Point, diagnose
from omnijax.diagnosis._answer import experiment as _experiment

pytestmark = [pytest.mark.long, pytest.mark.brief]

LAW = '''
from typing import ClassVar

from jaxtyping import Array, Float
from omnijax.laws import AbstractContact, Parameter


class ContactQuadratic(AbstractContact):
    """Contact tension += K2 delta^2."""

    K2: Float[Array, ""]
    id: ClassVar[str] = "contact-quadratic"
    places: ClassVar[tuple[str, ...]] = ("wheel", "all")
    parameters: ClassVar[dict[str, Parameter]] = {"K2": Parameter("N/m^2", linear=True)}

    def __call__(self, signal, state=None):
        return self.K2 * signal.deflection**2
'''


@pytest.fixture(scope="module")
def plant():
    return load_plant()


@pytest.fixture(scope="module")
def turning(plant, tmp_path_factory):
    """Bearing friction hidden in runs that only turn about the vertical at one speed."""
    rng, friction = np.random.default_rng(3), 3e-4
    stated = plant.machine(rng)
    true, effects = plant.perturbed(rng, stated), {"viscous": friction * np.ones(3)}
    torque = plant.torques(true, plant.spin_up(4.0, 0.5), friction)
    tables = plant.record(stated, true, effects, np.stack([torque] * 2), rng, cut=1.5)
    folder = tmp_path_factory.mktemp("turning")
    plant.write_case(folder, stated, tables)
    return folder, stated, true, effects, tables[:1]


@pytest.fixture(scope="module")
def ambiguous(turning):
    """Its diagnosis, with two of the motions that may be proposed, for speed."""
    every = _experiment.feasible_motions

    def two(top, time):
        chosen = ("turn about z", "turn about all axes at once, slowly")
        return {k: v for k, v in every(top, time).items() if k.startswith(chosen)}

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_experiment, "feasible_motions", two)
        return diagnose(turning[0])


@pytest.mark.full  # in the gate an axis: test_machine
def test_what_the_runs_cannot_tell_apart_is_ambiguous_with_every_rival(ambiguous):
    assert ambiguous.verdict == "ambiguous"
    names = {(e.id, e.place) for e in ambiguous.effects}
    assert {("bearing-viscous", "all"), ("bearing-coulomb", "all"), ("air-drag", "sphere")} <= names
    for effect in ambiguous.effects:
        others = {(o["id"], o["place"]) for o in effect.indistinguishable_from}
        assert others == names - {(effect.id, effect.place)}
        assert effect.evidence.get("margin", 0.0) < 25
        assert all(x["sigma"] is None or np.all(np.array(x["sigma"]) > 0)
                   for x in effect.parameters.values())  # fmt: skip
        assert any(x["sigma"] is not None for x in effect.parameters.values())
    evidence = [effect.evidence["delta_bic"] for effect in ambiguous.effects]
    assert len(set(evidence)) > 1  # each has its own
    excluded = {(x["id"], x["place"]) for x in ambiguous.excluded}
    assert excluded and not excluded & names


@pytest.mark.full  # in the gate an axis's: test_axis_rivals
def test_a_motion_in_which_a_rival_runs_away_is_made_slower_or_not_proposed(ambiguous):
    """A contact that softens holds the sphere only as far as the runs have pressed it."""
    model, outcome = ambiguous.details["model"], ambiguous.details["found"]
    rivals = [*outcome.fit.point.effects, outcome.rivals[0][0][0]]
    every = _experiment.feasible_motions

    def next_run(K3):
        soft = Effect("contact-cubic", "w2", {"K3": -K3})
        points = [Point(outcome.fit.point.u, (e, soft)) for e in rivals]
        return _experiment.next_experiment(model, points)

    with pytest.MonkeyPatch.context() as patch:
        last = "turn about all axes at once, fast reversed"
        patch.setattr(_experiment, "feasible_motions", lambda top, t: {last: every(top, t)[last]})
        slower = next_run(1e14)
        assert slower["drive"].startswith(f"{last}, all ") and "times slower" in slower["drive"]
        assert 0 < slower["separation"] < np.inf
        assert np.all(np.isfinite(slower["torque"]["values"]))
        assert next_run(1e18) is None


@pytest.mark.full
def test_the_next_experiment_tells_them_apart(ambiguous, turning, plant, tmp_path):
    proposed = ambiguous.next_experiment
    separations = [x["separation"] for x in proposed["compared"]]
    assert proposed["separation"] == max(separations) > 25
    assert min(separations) < 1  # turning about the vertical again would not help
    _, stated, true, effects, old = turning
    torque = np.array(proposed["torque"]["values"])
    given = np.arange(len(torque)) * proposed["torque"]["step"]
    time = np.arange(round(given[-1] * plant.RATE) + 1) / plant.RATE
    drive = np.stack([np.interp(time, given, x) for x in torque.T], 1)
    new = plant.record(stated, true, effects, np.stack([drive] * 2), np.random.default_rng(4))
    plant.write_case(tmp_path, stated, [*old, *new])
    found = diagnose(tmp_path)
    assert found.verdict == "named"
    (effect,) = found.effects
    assert (effect.id, effect.place) == ("bearing-viscous", "all")
    assert effect.parameters["b"]["value"] == pytest.approx(3e-4, rel=0.02)


@pytest.fixture(scope="module")
def gentle(plant, tmp_path_factory):
    """By what is hidden the diagnosis of a case whose held-out run is all but still."""

    def found(effects):
        rng, folder = np.random.default_rng(11), tmp_path_factory.mktemp("gentle")
        stated = plant.machine(rng)
        true = plant.perturbed(rng, stated)
        turning = [size * plant.wander(rng, 3.0) for size in (1.0, 0.01)]
        torque = np.stack([plant.torques(true, w) for w in turning])
        plant.write_case(folder, stated, plant.record(stated, true, effects, torque, rng))
        return diagnose(folder)

    return found


@pytest.mark.full
def test_what_held_out_runs_are_not_moved_by_is_confirmed_by_parts_of_the_fitted_ones(gentle):
    found = gentle({"viscous": np.array([0.0, 2e-4, 0.0])})
    assert found.verdict == "named" and found.confirmed_on == "blocks"
    (effect,) = found.effects
    assert (effect.id, effect.place) == ("bearing-viscous", "w2")
    b = effect.parameters["b"]
    assert abs(b["value"] - 2e-4) < 4 * b["sigma"]
    assert "of which held-out runs are moved too little to tell" in found.notes[1]
    assert any("kept out of the fit too" in fault for fault in found.faults)


@pytest.mark.full
@pytest.mark.parametrize("springs", [0.0, 3e8])
def test_what_no_law_explains_in_fitted_runs_alone_is_unknown(gentle, springs):
    found = gentle({"K2": np.array([0.0, springs, 0.0])})
    assert (found.verdict, found.effects) == ("unknown" if springs else "none", [])


def test_a_law_of_the_users_own_file_is_named(plant, tmp_path):
    rng, K2 = np.random.default_rng(5), 1e8
    stated = plant.machine(rng)
    true = plant.perturbed(rng, stated)
    drives = np.stack([plant.torques(true, plant.wander(rng, 2.0)) for _ in range(2)])
    hidden = {"K2": np.array([0.0, K2, 0.0])}
    plant.write_case(tmp_path / "case", stated, plant.record(stated, true, hidden, drives, rng))
    law, out = tmp_path / "my_law.py", tmp_path / "out"
    law.write_text(LAW)
    assert run(["diagnose", str(tmp_path / "case"), "--law", str(law), "--out", str(out)]) == 0
    found = json.loads((out / "diagnosis.json").read_text())
    assert found["verdict"] == "named"
    (effect,) = found["effects"]
    assert (effect["id"], effect["place"]) == ("contact-quadratic", "w2")
    K = effect["parameters"]["K2"]
    assert abs(K["value"] - K2) < 4 * K["sigma"]
    assert 'law = "my_law.py"' in (out / "rig-diagnosed.toml").read_text()
