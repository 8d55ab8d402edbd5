"""Where nothing is missing: score p-values are uniform, and encoder noise is no effect."""

import numpy as np
import pytest
from scipy.stats import binomtest, kstest
from test_plant import load_plant

from omnijax.diagnosis import Point, RigModel
from omnijax.diagnosis._machine.encoders import smoother_modes, whitener
from omnijax.diagnosis._machine.runs import Run
from omnijax.diagnosis._machine.smooth import smooth
from omnijax.diagnosis._machine.start_angles import with_start_angles
from omnijax.diagnosis._search.fit import refit
from omnijax.diagnosis._search.held_out import HeldOut
from omnijax.diagnosis._search.scan import Signatures
from omnijax.laws import EFFECTS
from omnijax.rig import load_rig

DRAWS, SECONDS = 12, 3.5


@pytest.fixture(scope="module")
def quiet(tmp_path_factory):
    """(rig, noise, noise-free runs) of a machine to which nothing was added."""
    plant, rng = load_plant(), np.random.default_rng(20)
    stated = plant.machine(rng)
    true = plant.perturbed(rng, stated)
    torque = np.stack([plant.torques(true, plant.wander(rng, SECONDS)) for _ in range(2)])
    tables = plant.record(stated, true, {}, torque, rng, noise=0.0)
    folder = tmp_path_factory.mktemp("quiet")
    plant.write_case(folder, stated, tables)
    return load_rig(folder / "rig.toml"), plant.NOISE, tables


def noisy(tables, noise, rng) -> list[Run]:
    """The runs with new noise."""
    runs = []
    for k, table in enumerate(tables):
        outputs = {}
        for group, sigma in noise.items():
            clean = np.stack([v for c, v in table.items() if c.startswith(group + "_")], axis=1)
            outputs[group] = clean + sigma * rng.normal(size=clean.shape)
        torque = np.stack([table[f"torque_{i}"] for i in (1, 2, 3)], axis=1)
        n = len(torque)
        runs.append(
            Run(
                f"run-{k}", "train", table["t"], torque, np.zeros((n, 3)), outputs, np.ones(n, bool)
            )
        )
    return runs


@pytest.fixture(scope="module")
def p_values(quiet) -> np.ndarray:
    """p-values (draws, candidates) of the scores under repeated noise, baseline recalibrated.

    Of candidates with columns of their own: a line that is picked for its size counts all lines.
    """
    rig, noise, tables = quiet
    point, signatures, out = None, None, []
    for draw in range(DRAWS):
        runs = noisy(tables, noise, np.random.default_rng([5, draw]))
        model = RigModel(rig, runs, noise, dict(EFFECTS))
        if draw == 0:
            point = refit(model, Point(np.zeros(len(model.priors)))).point
        model.rebase(point)
        fit = refit(model, point)
        if signatures is None:
            candidates = [c for c in model.candidates(point) if c.trials == 1]
            signatures = Signatures(candidates, model.columns(point, candidates))
        scan = signatures.scan(fit.residual, fit.jacobian, len(fit.point.u), fit.point.u)
        out.append([s.p for s in scan.scores if not s.dead])
    return np.array(out)


def test_p_values_of_the_scores_are_uniform(p_values):
    """The scores of one draw depend on each other, those of different draws do not."""
    print({level: float(np.mean(p_values < level)) for level in (0.01, 0.05, 0.2, 0.5)})
    for candidate in p_values.T[:: p_values.shape[1] // 40]:  # 12 draws of one candidate each
        assert kstest(candidate, "uniform").pvalue > 1e-4
    assert 0.002 < np.mean(p_values < 0.01) < 0.02
    assert 0.03 < np.mean(p_values < 0.05) < 0.075
    assert 0.42 < np.mean(p_values < 0.5) < 0.58


def test_no_candidate_stands_out_after_counting_all(p_values):
    smallest = p_values.min(axis=1) * p_values.shape[1]
    assert binomtest(int(np.sum(smallest < 0.05)), DRAWS, 0.05).pvalue > 0.01
    assert smallest.min() > 1e-3


def test_modes_of_the_smoother_are_the_smoother():
    noise = np.random.default_rng(0).normal(size=(800, 1))
    modes, gains = smoother_modes(800, 1e6)
    left = smooth(noise, 1.0, 1e6)[0] - modes @ (gains[:, None] * (modes.T @ noise))
    assert np.sqrt(np.mean(left**2)) < 0.05 * np.sqrt(np.mean(smooth(noise, 1.0, 1e6)[0] ** 2))


def test_whitening_turns_a_low_rank_covariance_into_white_noise():
    rng = np.random.default_rng(1)
    B = rng.normal(size=(60, 3))
    U, shrink = whitener(B)
    W = np.eye(60) - U @ (shrink[:, None] * U.T)
    np.testing.assert_allclose(W @ (np.eye(60) + B @ B.T) @ W, np.eye(60), atol=1e-10)


def test_held_out_runs_confirm_an_effect_and_nothing_else():
    rng = np.random.default_rng(2)
    signal = 0.3 * np.sin(np.arange(4000) / 30)
    sure = []
    for _ in range(200):
        noise = rng.normal(size=4000)
        effect = HeldOut.of(noise + signal, noise)
        assert effect.confirms(1e3)
        assert effect.multiplier == pytest.approx(1.0, abs=0.3)
        chance = HeldOut.of(noise, noise - signal)  # a change that stands for nothing
        assert not chance.confirms(1e3)
        assert not HeldOut.of(noise + 3 * signal, noise + 2 * signal).confirms(1e3)
        sure.append(chance.sure)
    assert kstest(sure, "norm").pvalue > 0.01


def test_start_angles_of_wheels_without_encoder_are_found(quiet):
    """dR and a say where the wheels stood, up to whole gaps."""
    rig, noise, tables = quiet
    runs = noisy(tables[:1], noise, np.random.default_rng(7))
    true = runs[0].outputs.pop("theta")[0]
    model = RigModel(rig, runs, noise, dict(EFFECTS))
    (run,) = with_start_angles(model.machine, rig)
    assert run.start is not None
    pitch = 2 * np.pi / np.asarray(rig.wheels.rollers)
    off = np.mod(run.start - true + pitch / 2, pitch) - pitch / 2
    assert np.abs(off).max() < 3e-3  # the machine is not calibrated yet
