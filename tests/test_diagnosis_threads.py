"""Side by side on several cores: the same answers, errors and context as one after the other."""

import gc
import threading
import weakref

import jax.numpy as jnp
import numpy as np
import pytest
from test_diagnosis_null import noisy
from test_plant import recorded
from threadpoolctl import threadpool_limits

from omnijax.diagnosis import Effect, Point, RigModel
from omnijax.diagnosis import _threads as threads
from omnijax.diagnosis._machine import machine as rig_machine
from omnijax.diagnosis._machine._elastic import stepped
from omnijax.diagnosis._machine.stage_cache import ASIDE, StageCache
from omnijax.diagnosis._search import Candidate, Signatures, tangent_rows
from omnijax.diagnosis._threads import cores, each
from omnijax.laws import EFFECTS
from omnijax.machine import PlacedLaw
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


@pytest.fixture
def on_cores(monkeypatch):
    """Work as on a machine of so many cores."""

    def chosen(count: int) -> None:
        cores = set(range(count))
        monkeypatch.setattr(threads.os, "sched_getaffinity", lambda pid: cores, raising=False)

    return chosen


def test_scores_are_the_same_numbers_on_any_number_of_cores(on_cores):
    """To the last bit: a free run of stick and slip leads from one bit to another minimum."""
    rng = np.random.default_rng(3)
    table, taken = rng.normal(size=(90, 20_001)), np.linalg.qr(rng.normal(size=(20_003, 7)))[0]
    residual, u = rng.normal(size=20_001), rng.normal(size=2)
    law = PlacedLaw(EFFECTS["bearing-coulomb"](torque=jnp.asarray(0.1)), "axis")
    candidates = [
        Candidate("bearing-coulomb", f"w{k}", (law,) * 3, lambda c: {"torque": c[0]})
        for k in range(30)
    ]
    signatures, found = Signatures(candidates, table), []
    for count in (1, 2, 3):
        on_cores(count)
        with threadpool_limits(1, "blas"):  # as `diagnose` does
            scan = signatures.scan(residual, taken, u)
        (towards,) = scan.towards.values()
        found.append([scan.right, towards, *scan.blocks])
    for other in found[1:]:
        for one, same in zip(found[0], other, strict=True):
            np.testing.assert_array_equal(one, same)


def test_lanes_are_parted_alike_on_any_number_of_cores(on_cores, monkeypatch):
    parts = []
    monkeypatch.setattr(stepped, "_side_by_side", lambda some: [parts.append(len(some))])
    seen = []
    for count in (1, 2, 5):
        on_cores(count)
        parts.clear()
        stepped.law_changes([object()] * 21)  # pyright: ignore[reportArgumentType], only counted
        seen.append(sorted(parts))
    assert seen[0] == seen[1] == seen[2] == [7, 7, 7]


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """Two short runs of a machine with nothing added."""
    folder = tmp_path_factory.mktemp("quiet")
    plant, rng, tables = recorded(folder, 20, 1.5, off=True, noise=0.0)
    runs = noisy(tables, plant.NOISE, rng)
    return RigModel(load_rig(folder / "rig.toml"), runs, plant.NOISE, dict(EFFECTS))


CUBIC = Effect("contact-cubic", "w2", {"K3": 1e11})


@pytest.mark.parametrize("law", [CUBIC, pytest.param(None, marks=pytest.mark.full)])
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


def test_a_model_that_was_asked_nothing_is_prepared_about_a_point_at_once(model, monkeypatch):
    """Runs that are weighed anew had been prepared about the stated rig first, for nothing."""
    prepared, rebase = [], rig_machine.Machine.rebase
    monkeypatch.setattr(rig_machine.Machine, "rebase",
                        lambda self, rig: prepared.append(rig) or rebase(self, rig))  # fmt: skip
    point = Point(0.3 * np.ones(len(model.priors)))
    parts = model.rig, model.machine.runs, model.noise, model.laws
    stated, fresh = RigModel(*parts), RigModel(*parts)
    before = stated.residuals([point], "train")[0]
    for other in (stated, fresh):
        other.rebase(point)
    assert len(prepared) == 3  # twice, and once
    found = [x.residuals([point], "train")[0] for x in (stated, fresh)]
    np.testing.assert_array_equal(*found)
    assert np.abs(found[0] - before).max() > 0


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


def test_what_is_made_aside_neither_piles_up_nor_drives_out_what_is_kept():
    """Motions of a run are some 10 MB: those of all rigs of a tangent were a third of the peak."""
    cache, made = StageCache(), []
    for k in range(5):
        cache.get("stage", bytes([k]), object)
    known = dict(cache._stages["stage"])
    with cache.aside():
        for k in range(100, 150):
            made.append(weakref.ref(cache.get("stage", bytes([k]), lambda: np.zeros(1))))
        gc.collect()
        assert sum(x() is not None for x in made) <= ASIDE + 1
        for key, value in known.items():
            assert cache.get("stage", key, object) is value
    assert cache._stages["stage"] == known


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
    assert len(calls) == 5 * runs  # of each: over the spans between points, and at these
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
