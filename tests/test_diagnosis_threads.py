"""Side by side on several cores: the same answers, errors and context as one after the other."""

import threading

import numpy as np
import pytest
from test_diagnosis_null import noisy
from test_plant import load_plant

from omnijax.diagnosis import Effect, Point, RigModel
from omnijax.diagnosis import _threads as threads
from omnijax.diagnosis._machine.stage_cache import StageCache
from omnijax.diagnosis._search import tangent_rows
from omnijax.diagnosis._threads import cores, each
from omnijax.laws import EFFECTS
from omnijax.rig import load_rig


@pytest.fixture
def two_cores(monkeypatch):
    """Two workers, whatever this machine has."""
    monkeypatch.setattr(threads.os, "sched_getaffinity", lambda pid: {0, 1}, raising=False)


def test_items_keep_their_order_and_run_at_the_same_time(two_cores):
    both = threading.Barrier(2, timeout=30)  # broken where one waits for the other's end

    def work(k):
        both.wait()
        return 10 * k

    assert each(work, [3, 1]) == [30, 10]


def test_within_each_there_is_one_core_left(two_cores):
    def inner(_):
        return threading.current_thread().name

    def outer(_):
        return {threading.current_thread().name, *each(inner, range(4))}, cores()

    assert cores() == 2
    assert all(len(names) == 1 and left == 1 for names, left in each(outer, range(2)))
    assert cores() == 2


def test_errors_and_the_callers_context_hold_in_threads(two_cores):
    def divide(x):
        return np.ones(1) / x

    with np.errstate(divide="raise"), pytest.raises(FloatingPointError):
        each(divide, [np.ones(1), np.zeros(1)])
    with np.errstate(divide="ignore"):
        assert np.isinf(each(divide, [np.ones(1), np.zeros(1)])[1])


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """Two short runs of a machine with nothing added."""
    plant, rng = load_plant(), np.random.default_rng(20)
    stated = plant.machine(rng)
    true = plant.perturbed(rng, stated)
    torque = np.stack([plant.torques(true, plant.wander(rng, 1.5)) for _ in range(2)])
    tables = plant.record(stated, true, {}, torque, rng, noise=0.0)
    folder = tmp_path_factory.mktemp("quiet")
    plant.write_case(folder, stated, tables)
    runs = noisy(tables, plant.NOISE, rng)
    return RigModel(load_rig(folder / "rig.toml"), runs, plant.NOISE, dict(EFFECTS))


@pytest.mark.parametrize("law", [None, Effect("contact-cubic", "w2", {"K3": 1e11})])
def test_many_points_at_once_are_the_points_one_by_one(model, two_cores, monkeypatch, law):
    """More points than are kept: none may be taken for another that is gone."""
    effects = () if law is None else (law,)
    steps = np.random.default_rng(0).normal(size=(24, len(model.priors)))
    points = [Point(0.1 * u, effects) for u in steps]
    together = model.residuals(points, "train")
    monkeypatch.setattr(threads.os, "sched_getaffinity", lambda pid: {0}, raising=False)
    for point, found in zip(points, together, strict=True):
        (alone,) = model.residuals([point], "train")
        np.testing.assert_allclose(found, alone, rtol=0, atol=1e-9 * np.abs(alone).max())


def test_difference_tangents_leave_nothing_kept_but_the_point_itself(model):
    """Their rigs are asked for once; kept, each held its motion, rotation and elastic states."""
    point = Point(
        0.1 * np.ones(len(model.priors)), (Effect("bearing-coulomb", "w2", {"torque": 0.01}),)
    )
    (residual,) = model.residuals([point], "train")
    before = {stage: dict(kept) for stage, kept in model.machine._kept._stages.items()}
    assert {"motion", "rotated"} <= set(before)
    tangent_rows(model, point, model.free(point), residual)
    assert model.machine._kept._stages == before


def test_what_is_made_aside_is_kept_to_its_end_only():
    cache, made = StageCache(), []

    def ask(*keys):
        """Which of `keys` are made for it."""
        made.clear()
        for key in keys:
            cache.get("stage", key, lambda key=key: made.append(key) or key)
        return b"".join(made)

    assert ask(b"a") == b"a"
    with cache.aside():
        assert ask(b"a", b"b", b"b") == b"b"
        with cache.aside():
            assert ask(b"a", b"b", b"c") == b"c"
        assert ask(b"a", b"b", b"c") == b"c"
    assert ask(b"a", b"b", b"c") == b"bc"
    with cache.aside():
        cache.forget()
        assert ask(b"a") == b"a"
    assert ask(b"a", b"b") == b"b"
