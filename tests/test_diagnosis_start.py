"""Runs that begin while the sphere turns: laws feel the elastic state that the data show."""

import dataclasses

import numpy as np
import pytest
from seeds import drawn_anew
from test_diagnosis_null import noisy
from test_plant import load_plant

from omnijax.diagnosis import Effect, Point, RigModel
from omnijax.diagnosis._search.fit import refit
from omnijax.diagnosis._search.refits import Refits
from omnijax.laws import EFFECTS
from omnijax.rig import load_rig

TRUE = 6e13  # N/m^3


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """A machine as it is stated but for one mount that stiffens, recorded from 1 s on."""
    plant, rng = load_plant(), np.random.default_rng(3)
    stated = plant.machine(rng)
    torque = np.stack([plant.torques(stated, plant.wander(rng, 3.0)) for _ in range(2)])
    effects = {"k3": TRUE * np.array([0.0, 1.0, 0.0])}
    tables = plant.record(stated, stated, effects, torque, rng, noise=0.0, cut=1.0)
    folder = tmp_path_factory.mktemp("rolling")
    plant.write_case(folder, stated, tables)
    noise = {g: s if g in ("theta", "Omega") else 0.1 * s for g, s in plant.NOISE.items()}
    found = RigModel(load_rig(folder / "rig.toml"), noisy(tables, noise, rng), noise, dict(EFFECTS))
    assert all(run.rolling_start(noise) for run in found.machine.runs)
    return found


def test_a_law_is_fitted_from_the_state_in_which_a_run_begins(model):
    """Where laws feel a start from rest: chi2 112 a degree of freedom, and a size 176 sigma off."""
    law = Effect("mount-cubic", "w2", {"k3": 0.8 * TRUE})
    fit = refit(model, Point(np.zeros(len(model.priors)), (law,)))
    assert fit.chi2 > 1.05 * model.dof("train")  # the state as the model without the law shows it
    fit = Refits(model).settle(fit)
    (found,) = fit.point.effects
    sigma = np.sqrt(fit.covariance[-1, -1])
    assert fit.chi2 < 1.02 * model.dof("train")
    assert abs(found.values["k3"] - TRUE) < 3 * sigma < 0.1 * TRUE


def test_a_start_is_taken_up_as_the_sensors_read_it(model):
    """Taken up as it is before a rectifier: chi2 450 a degree of freedom, more with each turn."""
    runs = []
    for run in model.machine.runs:
        a = run.outputs["a"] * np.ones(3)
        a[:, 0] = np.abs(a[:, 0])
        runs.append(dataclasses.replace(run, outputs={**run.outputs, "a": a}))
    rectified = RigModel(model.rig, runs, model.noise, model.laws)
    effects = Effect("mount-cubic", "w2", {"k3": TRUE}), Effect("sensor-rectified", "a_x", {})
    truth = Point(np.zeros(len(model.priors)), effects)
    for _ in range(4):
        rectified.rebase(truth)
    (residual,) = rectified.residuals([truth], "train")
    assert residual @ residual < 1.05 * rectified.dof("train")


def test_a_start_is_taken_up_as_late_as_it_is_read(model):
    """Taken up on time, or through splines, where clocks are off: every turn moves it on."""
    u, machine = np.zeros(len(model.priors)), model.machine
    u[:3] = drawn_anew("rolling clocks").uniform(0.3, 0.9, 3) * [1, 1, -1]
    rig = model.rig_at(Point(u))
    machine.rebase(rig)
    once = machine.basis.rolling
    machine.rebase(rig)
    for i, state in machine.basis.rolling.items():
        assert np.linalg.norm(state - once[i]) < 1e-6 * np.linalg.norm(once[i])
