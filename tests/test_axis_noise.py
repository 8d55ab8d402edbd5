"""The noise of an axis's logs: each has its own, declared and shown together."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from seeds import drawn_anew

from omnijax.diagnosis._answer.shown import Shown, noise_remarks, noise_table
from omnijax.diagnosis._ode import OdeEvidence, build_model
from omnijax.diagnosis._search import Level
from omnijax.machine import Log, MachineCase, parse_machine

STEP, COUNT = 2e-3, 4000
MACHINE = {"kind": "axis", "axis": {"inertia": 0.01, "damping": 0.02}, "motor": {"input": "torque"}}


def logged(rng, sigma: float, declared: float | None = None, role: str = "train") -> Log:
    """A log of slow sines with white noise of 1-sigma `sigma`, rad."""
    t = np.arange(COUNT) * STEP
    sines = sum(np.sin(2 * np.pi * f * t + 6 * rng.random()) for f in (0.4, 0.9, 2.1))
    return Log(role, role, t, {"input": 0.1 * sines},
               {"position": sines + sigma * rng.normal(size=COUNT)},
               {} if declared is None else {"position": declared})  # fmt: skip


def case(*logs: Log) -> MachineCase:
    return MachineCase(Path(), parse_machine(MACHINE), list(logs), False, [])


def test_a_noisy_log_is_no_noise_of_others():
    """It was one level for all: a log of 20 times the noise hid what the others show."""
    rng, sigmas = drawn_anew("noisy log"), (1e-4, 1e-4, 2e-3)
    logs = [
        logged(rng, s, role=role)
        for s, role in zip(sigmas, ("train", "held-out", "train"), strict=True)
    ]
    quiet, _, (said,) = build_model(case(*logs[:2]))
    model, _, (also,) = build_model(case(*logs))
    np.testing.assert_allclose(model.noise, sigmas, rtol=0.1)
    assert also == said  # the low pass is as wide
    np.testing.assert_allclose(model.row_noise.sigma[:2], quiet.row_noise.sigma)
    np.testing.assert_allclose(model.weights("train")[[0, -1]], 1 / model.row_noise.sigma[[0, 2]])


def test_logs_of_one_encoder_have_one_noise_where_one_of_them_rests():
    rng, count = drawn_anew("encoder"), 1e-3
    logs = [logged(rng, 0.0, role=role) for role in ("train", "held-out")]
    logs[1].outputs["position"] *= (
        np.linspace(0.0, 1.0, COUNT) ** 9
    )  # it rests for half of the time
    for log in logs:
        log.outputs["position"] = count * np.round(log.outputs["position"] / count)
    model, *_ = build_model(case(*logs))
    assert model.noise[0] == model.noise[1] > 0.1 * count


@pytest.mark.parametrize("factor", [0.2, 1.0, 1.1, 10.0])
def test_what_the_data_show_decides_over_a_declared_noise(factor):
    """A declaration was believed whatever it was: one ten times too large hid effects."""
    rng = drawn_anew("declared")
    sigma = 10 ** rng.uniform(-5, -3)
    logs = [logged(rng, sigma, factor * sigma, role) for role in ("train", "held-out")]
    model, noise, _ = build_model(case(*logs))
    assert [x.declared for x in noise] == [factor * sigma] * 2
    agrees = factor in (1.0, 1.1)
    assert {x.source for x in noise} == {"declared" if agrees else "differences"}
    np.testing.assert_allclose(model.noise, factor * sigma if agrees else sigma, rtol=0.1)


def test_a_declared_noise_is_kept_beside_motion_that_differences_take_for_noise():
    rng = drawn_anew("jerks")
    log = logged(rng, 1e-7, 1e-7)
    t = np.arange(COUNT) * STEP
    for at in rng.uniform(0, t[-1], 40):  # jumps of the acceleration
        log.outputs["position"] += np.where(t > at, rng.normal() * (t - at) ** 2, 0.0)
    _, (noise,), _ = build_model(case(log))
    assert (noise.sigma, noise.source) == (1e-7, "declared")


def evidence(*declared: float | None, raised: float) -> OdeEvidence:
    """Evidence of a held-out log whose rows' noise was `raised` by what no law explains."""
    rng = drawn_anew("apart")
    logs = [
        logged(rng, 1e-4, x, role) for x, role in zip(declared, ("train", "held-out"), strict=True)
    ]
    made = case(*logs)
    model, noise, _ = build_model(made)
    model.row_noise = dataclasses.replace(model.row_noise, sigma=raised * model.row_noise.sigma)
    return OdeEvidence(model, made.file, noise, [], [], False)


@pytest.mark.parametrize(
    "factor, raised, told", [(1.0, 1.0, False), (0.2, 1.0, True), (1.0, 5.0, True)]
)
def test_what_was_declared_is_told_as_it_was(factor, raised, told):
    """The number that the answer called declared was the one that it had raised itself."""
    one = evidence(None, factor * 1e-4, raised=raised)
    level = Shown(
        ({"acceleration": Level(1.0, 0.01, 1.0)},), ("held-out",), {"acceleration": 0.0}, ([], [])
    )
    table = noise_table(one, level)
    row = table["acceleration"]
    gain = one.model.measured.rows[1].gain()
    assert row["declared"] == pytest.approx(factor * 1e-4 * gain)
    assert row["shown"] == pytest.approx(raised * 1e-4 * gain, rel=0.1)
    assert any("another noise than was declared" in x for x in noise_remarks(table)) == told


def test_no_noise_is_called_declared_where_none_was():
    assert evidence(1e-4, None, raised=2.0).assumed("acceleration")["declared"] is None
