"""Side by side on several cores: the same answers, errors and context as one after the other."""

import threading

import numpy as np
import pytest
from test_diagnosis_null import noisy
from test_plant import load_plant

from omnijax.diagnosis import Effect, Point, RigModel
from omnijax.diagnosis import _threads as threads
from omnijax.diagnosis._machine import machine as rig_machine
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


def test_what_is_told_to_be_forgotten_is_made_anew_and_the_rest_is_kept():
    cache, made = StageCache(), []
    for forgotten in ((), ("one",), ()):
        cache.forget(*forgotten) if forgotten else None
        for stage in ("one", "other"):
            cache.get(stage, b"k", lambda stage=stage: made.append(stage))
    cache.forget()
    cache.get("other", b"k", lambda: made.append("other"))
    assert made == ["one", "other", "one", "other"]


ARM = Effect("rolling-resistance", "all", {"arm": 1e-3})


def counted(monkeypatch, where, name):
    """The calls of a function from here on, as a list that grows."""
    calls, function = [], getattr(where, name)

    def called(*given, **named):
        calls.append(given)
        return function(*given, **named)

    monkeypatch.setattr(where, name, called)
    return calls


def test_rigs_that_differ_in_elastic_parts_turn_once_under_the_same_normal_forces(
    model, monkeypatch
):
    """What N does to Omega is asked of each; what N of the last rebase does, once."""
    stiff = next(k for k, p in enumerate(model.priors) if "stiffness" in p.name)
    point = Point(np.zeros(len(model.priors)), (ARM,))
    softer = Point(-0.5 * np.eye(len(model.priors))[stiff], (ARM,))
    calls = counted(monkeypatch, rig_machine, "run_torques")
    model.machine.forget()
    together, runs = model.residuals([point, softer], "train"), len(model.splits["train"])
    assert len(calls) == 3 * runs
    model.machine.forget()
    (alone,) = model.residuals([softer], "train")
    np.testing.assert_allclose(together[1], alone, rtol=0, atol=1e-9 * np.abs(alone).max())
    assert np.abs(together[0] - together[1]).max() > 1


def test_a_rebase_finds_no_motion_again_for_other_normal_forces(model, monkeypatch):
    """Of every smoothing and once at its end; the rest hangs on what was smoothed alone."""
    rig = model.rig_at(Point(np.zeros(len(model.priors))))
    smoothed = counted(monkeypatch, rig_machine, "smooth")
    model.machine.rebase(rig)
    assert len(smoothed) == 2 * len(model.machine.runs)
    kept = model.machine.residual_tables(rig, 0)
    model.machine.forget()
    for found, anew in zip(kept, model.machine.residual_tables(rig, 0), strict=True):
        np.testing.assert_array_equal(found, anew)
