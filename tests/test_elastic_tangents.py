"""Tangents by stiffness and damping of contacts and mounts: exact, of whatever stands beside."""

import dataclasses

import numpy as np
import pytest
from seeds import drawn_anew
from test_plant import recorded, runs_of
from tiers import tiered

from omnijax.diagnosis import Point, RigModel
from omnijax.diagnosis._machine._where.locate import _tangents
from omnijax.diagnosis._machine.runs import Run
from omnijax.diagnosis._search import Effect, tangent_rows
from omnijax.laws import EFFECTS
from omnijax.rig import load_rig

GROUPS = ("dR", "theta", "Omega", "a")
ELASTIC = 12  # numbers of contacts and mounts of three wheels


def _cut(run: Run, first: int) -> Run:
    """The run from a sample on, where it turns already."""
    time = run.time[first:] - run.time[first]
    return dataclasses.replace(
        run, time=time, torque=run.torque[first:], force=run.force[first:], known=run.known[first:],
        outputs={g: x[first:] for g, x in run.outputs.items()},
    )  # fmt: skip


@pytest.fixture(scope="module", params=tiered((0, 100), (0).__eq__))
def model(request, tmp_path_factory):
    """Short runs, from rest (with the whole suite) or rolling, as a model of the stated machine."""
    folder = tmp_path_factory.mktemp("elastic")
    plant, _, tables = recorded(folder, 70, 1.5, noise=0.0)
    runs = [_cut(run, request.param) for run in runs_of(tables)]
    return RigModel(load_rig(folder / "rig.toml"), runs, plant.NOISE, dict(EFFECTS))


def _drawn(model: RigModel, rng: np.random.Generator) -> Point:
    """A point with a few effects, and clocks that are off either way."""
    effects = [
        Effect("wheel-runout", "w1", {"amplitude": 4e-5, "phase": rng.uniform(0, 6)}),
        Effect("floor-vibration", "platform", {"amplitude": 0.2, "frequency": rng.uniform(8, 60),
               "phase": 0.3, "direction": rng.normal(size=3)}),
        Effect("sensor-delay", "a", {"delay": rng.uniform(5e-4, 9e-3)}),
        Effect("bearing-viscous", "all", {"b": 1e-4}),
    ]  # fmt: skip
    some = rng.permutation(len(effects))[: rng.integers(0, len(effects) + 1)]
    u = np.clip(rng.normal(size=len(model.priors)), -2, 2)
    return Point(u, tuple(effects[k] for k in some))


@pytest.mark.parametrize("split", ["train", "held-out"])
def test_they_are_those_of_differences(model, split):
    rng = drawn_anew("elastic tangents")
    point = _drawn(model, rng)
    known = model.prior_tangents(point, split)
    assert [model.priors[k].name.split(".")[2] for k in known] == ["contact"] * 6 + ["mount"] * 6
    for k, column in known.items():
        step = 1e-3 * np.eye(len(point.u))[k]
        ends = [Point(point.u + sign * step, point.effects) for sign in (1, -1)]
        after, before = model.residuals(ends, split)
        wanted = (after - before) / 2e-3
        assert np.linalg.norm(column - wanted) < 1e-5 * np.linalg.norm(wanted)


def test_all_tangents_stand_in_the_order_of_the_numbers(model):
    point = _drawn(model, drawn_anew("order of tangents"))
    (residual,) = model.residuals([point], "train")
    free = model.free(point)
    J = tangent_rows(model, point, free, residual)
    assert J.shape == (len(residual), len(model.priors) + len(free))
    known = model.prior_tangents(point, "train")
    assert len(known) == ELASTIC
    for k, column in known.items():
        assert J[:, k] == pytest.approx(column, abs=1e-9 * np.abs(column).max())
    clock = model.priors[2].name
    assert clock == "clock.a" and 2 not in known and np.any(J[:, 2])


@pytest.mark.parametrize("id, place, values", [
    ("mount-cubic", "all", {"k3": 1e15}),
    ("spin-resistance", "all", {"lever": 1e-4}),
    ("sensor-lag", "a", {"tau": 1e-3}),
])  # fmt: skip
def test_laws_that_feel_the_contacts_or_bend_the_readings_leave_them_to_differences(
    model, id, place, values
):
    point = Point(np.zeros(len(model.priors)), (Effect(id, place, values),))
    assert model.prior_tangents(point, "train") == {}


def test_noise_of_an_angle_is_no_part_of_what_its_radius_changes(model):
    """A radius scales the measured angle: the noise of a healthy wheel was found in the angle."""
    rng, named = drawn_anew("noise of an angle"), ("wheel.w2.radius", "wheel.w1.radius")
    rig = dataclasses.replace(model.rig, uncertainty=tuple((path, 1e-3) for path in named))
    runs = [
        dataclasses.replace(run, outputs=run.outputs | {
            "theta": run.outputs["theta"] + model.noise["theta"] * rng.normal(size=(run.samples, 3))
        })
        for run in model.machine.runs
    ]  # fmt: skip
    noisy = RigModel(rig, runs, model.noise, dict(EFFECTS))
    residual, changes = _tangents(noisy, Point(np.zeros(len(noisy.priors))), 0)
    left = np.concatenate(noisy.machine.rows[0].split(residual), axis=1)
    for column, wheel in zip(changes["radius"], (1, 0), strict=True):
        fast, noise = (np.diff(x[:400, wheel - 3], 6) for x in (column, left))
        assert abs(fast @ noise) < 0.02 * noise @ noise  # the whole of it was there
