"""Signatures against differences of the whole prediction, law by law."""

import numpy as np
import pytest
from test_plant import load_plant

from omnijax.diagnosis import diagnose
from omnijax.diagnosis._search.candidates import UNTRIED
from omnijax.diagnosis._search.model import Effect
from omnijax.laws import EFFECTS

# no strength that could be small, or an axis with fewer numbers than columns: judged at a size
# (a late signal too: its candidates are delays and lags of samples, not multiples of a tangent)
FINITE = {"lift-off", "contact-hertz", "mount-backlash", "sphere-out-of-round"}
FINITE |= {"sensor-delay", "sensor-lag", "actuator-delay", "actuator-lag"}
EXACT = sorted(set(EFFECTS) - FINITE - UNTRIED)


@pytest.fixture(scope="module")
def agreeing(tmp_path_factory):
    """Model, point, residual, and the live candidates with their columns, of agreeing data."""
    plant, rng = load_plant(), np.random.default_rng(4)
    machine = plant.machine(rng)
    drives = [plant.torques(machine, plant.wander(rng, 2.5)) for _ in range(2)]
    tables = plant.record(machine, machine, {}, np.stack(drives), rng)
    folder = tmp_path_factory.mktemp("agreeing") / "case"
    plant.write_case(folder, machine, tables)
    details = diagnose(folder).details
    model, point = details["model"], details["found"].baseline.point
    model.rebase(point)
    candidates = model.candidates(point)
    ends = np.cumsum([len(c.columns) for c in candidates])
    columns = [part.T for part in np.split(model.columns(point, candidates), ends[:-1])]
    return model, point, model.residuals([point], "train")[0], dict(
        (c.id, (c, x)) for c, x in zip(candidates, columns, strict=True) if x.any(axis=0).all()
    )  # fmt: skip


@pytest.mark.parametrize("id", EXACT)
def test_a_signature_is_what_a_weak_law_changes(agreeing, id):
    """A change of one standard deviation in all rows together: within 3 % of it."""
    model, point, residual, live = agreeing
    candidate, columns = live[id]
    strengths = 1 / np.linalg.norm(columns, axis=0)
    effect = Effect(id, candidate.place, candidate.decode(strengths))
    (after,) = model.residuals([point.with_effects(effect)], "train")
    change, foretold = residual - after, columns @ strengths
    assert np.linalg.norm(change - foretold) < 0.03 * np.linalg.norm(foretold)
