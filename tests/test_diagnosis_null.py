"""Where nothing is missing: score p-values are uniform, and encoder noise is no effect."""

import dataclasses
from importlib import import_module

import numpy as np
import pytest
from scipy.stats import binomtest, kstest
from scipy.stats import t as student
from seeds import drawn_anew
from test_plant import load_plant, runs_of

from omnijax.diagnosis import Effect, Point, RigModel
from omnijax.diagnosis._answer import RigEvidence
from omnijax.diagnosis._machine._motion.smooth import smooth
from omnijax.diagnosis._machine._noise.encoders import smoother_modes, whitener
from omnijax.diagnosis._machine._preparation.start_angles import with_start_angles
from omnijax.diagnosis._machine.runs import Run, with_noise
from omnijax.diagnosis._search import Level, Spectrum, calibrated
from omnijax.diagnosis._search.fit import refit
from omnijax.diagnosis._search.held_out import HeldOut
from omnijax.diagnosis._search.scan import Signatures, taken_up
from omnijax.laws import EFFECTS
from omnijax.rig import load_rig

pytestmark = pytest.mark.long

MACHINES, REPEATS, SECONDS = 3, 4, 2.5
DRAWS = MACHINES * REPEATS


def healthy(folder, rng):
    """(rig, noise, noise-free runs) of a machine drawn from `rng` to which nothing was added."""
    plant = load_plant()
    stated = plant.machine(rng)
    true = plant.perturbed(rng, stated)
    torque = np.stack([plant.torques(true, plant.wander(rng, SECONDS)) for _ in range(2)])
    tables = plant.record(stated, true, {}, torque, rng, noise=0.0)
    folder.mkdir()
    plant.write_case(folder, stated, tables)
    return load_rig(folder / "rig.toml"), plant.NOISE, tables


@pytest.fixture(scope="module")
def machines(tmp_path_factory):
    """Healthy machines, drawn anew in every run."""
    rng, folder = drawn_anew("healthy machines"), tmp_path_factory.mktemp("healthy")
    return [healthy(folder / str(i), rng) for i in range(MACHINES)]


def noisy(tables, noise, rng, last: str = "train") -> list[Run]:
    """The runs with new noise; the role of the last of them."""
    return [
        dataclasses.replace(run, outputs={
            group: run.outputs[group] + sigma * rng.normal(size=run.outputs[group].shape)
            for group, sigma in noise.items()
        })
        for run in runs_of(tables, ["train"] * (len(tables) - 1) + [last])
    ]  # fmt: skip


@pytest.fixture(scope="module")
def scans(machines) -> list[list]:
    """The scores of every draw: each machine calibrated anew under new noise, several times."""
    rng, out = drawn_anew("noise of healthy machines"), []
    for rig, noise, tables in machines:
        point, signatures = None, None
        for _ in range(REPEATS):
            model = RigModel(rig, noisy(tables, noise, rng), noise, dict(EFFECTS))
            if point is None:
                point = refit(model, Point(np.zeros(len(model.priors)))).point
            model.rebase(point)
            fit = refit(model, point)
            if signatures is None:  # the noise does not move them, but for lines that it picks
                candidates = model.candidates(point)
                signatures = Signatures(candidates, model.columns(point, candidates))
            taken = taken_up(fit.jacobian, len(fit.point.u))
            scan = signatures.scan(fit.residual, taken, fit.point.u)
            out.append([score for score in scan.scores if not score.dead])
    return out


def test_p_values_of_the_scores_are_uniform(scans):
    """Of candidates with columns of their own.  The scores of one draw depend on each other."""
    drawn = [np.array([s.p for s in scores if s.candidate.trials == 1]) for scores in scans]
    assert min(len(p) for p in drawn) > 100
    below = {level: [float(np.mean(p < level)) for p in drawn] for level in (0.01, 0.05, 0.5)}
    print({level: np.mean(shares) for level, shares in below.items()})
    bound = student.isf(1e-4 / (2 * len(below)), DRAWS - 1)  # 1e-4 in all, by chance
    for level, shares in below.items():  # the draws are independent: their scatter is the error
        error = np.std(shares, ddof=1) / np.sqrt(DRAWS) + 0.2 * level / np.sqrt(DRAWS)
        assert abs(np.mean(shares) - level) < bound * error, (level, shares)
    one_of_each = [p[(7 * k) % len(p)] for k, p in enumerate(drawn)]
    assert kstest(one_of_each, "uniform").pvalue > 1e-4


def test_no_candidate_stands_out_after_counting_all(scans):
    """Lines that were picked for their size among them: they count all lines."""
    assert any(s.candidate.trials > 1 for s in scans[0])
    smallest = np.array([min(s.p for s in scores) * len(scores) for scores in scans])
    assert binomtest(int(np.sum(smallest < 0.05)), DRAWS, 0.05).pvalue > 1e-3
    assert smallest.min() > 1e-5


def test_modes_of_the_smoother_are_the_smoother():
    noise = np.random.default_rng(0).normal(size=(800, 1))
    modes, gains = smoother_modes(800, 1e6)
    left = smooth(noise, 1.0, 1e6)[0] - modes @ (gains[:, None] * (modes.T @ noise))
    assert np.sqrt(np.mean(left**2)) < 0.05 * np.sqrt(np.mean(smooth(noise, 1.0, 1e6)[0] ** 2))


@pytest.mark.full
def test_what_a_walk_of_the_encoders_does_to_dR_and_a_is_counted(machines):
    """A healthy machine was unknown: a walk of 2 sigma left a gap in `a`."""
    rng, (rig, noise, tables) = drawn_anew("walk of encoders"), machines[0]
    plain = noisy(tables, noise, rng)
    steps = 0.15 * noise["theta"] * rng.normal(size=(len(plain), *plain[0].outputs["theta"].shape))
    runs = [
        dataclasses.replace(run, outputs={
            **run.outputs, "theta": run.outputs["theta"] + step.cumsum(axis=0)
        })
        for run, step in zip(plain, steps, strict=True)
    ]  # fmt: skip
    walk = Level(1.0, 0.1, 1.0, "wandering", Spectrum(1.0, walk=(0.15 / (2 * np.pi)) ** 2))
    known = [with_noise(run, {f"theta_{k}": walk for k in (1, 2, 3)}, 3) for run in runs]
    left = []
    for some in (plain, runs, known):
        model = RigModel(rig, some, noise, dict(EFFECTS))
        fit = refit(model, Point(np.zeros(len(model.priors))))
        model.rebase(fit.point)
        left.append(model.group_rms(refit(model, fit.point).residual, "train")["a"])
    white, beside, counted = left
    assert white == pytest.approx(1.0, abs=0.1)
    assert counted == pytest.approx(white, abs=0.3 * (beside - white) + 0.05)


def test_whitening_turns_a_low_rank_covariance_into_white_noise():
    rng = np.random.default_rng(1)
    B = rng.normal(size=(60, 3))
    U, shrink = whitener(B.T)
    W = np.eye(60) - U.T @ (shrink[:, None] * U)
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


def test_fitted_runs_are_asked_of_their_readings_without_held_out_ones(machines, monkeypatch):
    """A mode that a held-out run alone excites left a gap there that stood in runs that fit."""
    rig, noise, tables = machines[0]
    runs = noisy(tables, noise, np.random.default_rng(8), "held-out")
    model, asked = RigModel(rig, runs, noise, dict(EFFECTS)), []
    monkeypatch.setattr(
        import_module("omnijax.diagnosis._machine._where.locate"), "on_reading",
        lambda label, left, read, *rest: asked.append((label, [len(x) for x in read])),
    )  # fmt: skip
    evidence = RigEvidence(model, noise, [])
    for split, every in (("train", runs[:1]), ("held-out", runs)):
        asked.clear()
        evidence.locate(Point(np.zeros(len(model.priors))), split)
        elastic = [f"{group}_{axis}" for group in ("dR", "a") for axis in "xyz"]
        assert asked == [(label, [run.samples for run in every]) for label in elastic]


def test_start_angles_of_wheels_without_encoder_are_found(machines):
    """dR and a say where the wheels stood, up to whole gaps."""
    rig, noise, tables = machines[0]
    runs = noisy(tables[:1], noise, np.random.default_rng(7))
    true = runs[0].outputs.pop("theta")[0]
    model = RigModel(rig, runs, noise, dict(EFFECTS))
    model = RigModel(rig, with_start_angles(model.machine, rig), noise, dict(EFFECTS))
    start = calibrated(model, Point(np.zeros(len(model.priors)))).point
    (run,) = with_start_angles(model.machine, model.rig_at(start))
    assert run.start is not None
    pitch = 2 * np.pi / np.asarray(rig.wheels.rollers)
    off = np.mod(run.start - true + pitch / 2, pitch) - pitch / 2
    assert np.abs(off).max() < 3e-3
    (_, blind) = RigEvidence(model, noise, []).remarks()  # a phase there had a sigma of 0.03 rad
    assert f"The angle of {' and '.join(rig.names)} was not measured" in blind
    seen = RigModel(rig, noisy(tables[:1], noise, np.random.default_rng(7)), noise, dict(EFFECTS))
    assert len(RigEvidence(seen, noise, []).remarks()) == 1


def test_no_law_of_an_encoder_makes_its_noise_smaller(machines):
    """A machine at rest was named an eccentricity of 1.7e8 rad: noise was that of the angle."""
    rng = drawn_anew("encoders at rest")
    rig, noise, _ = machines[0]
    time, n = 0.002 * np.arange(500), rig.size
    outputs = {g: s * rng.normal(size=(500, n if g == "theta" else 3)) for g, s in noise.items()}
    run = Run("rest", "train", time, np.zeros((500, n)), np.zeros((500, 3)), outputs,
              np.ones(500, bool))  # fmt: skip
    model = RigModel(rig, [run], noise, dict(EFFECTS))

    def left(*effects):
        (residual,) = model.residuals([Point(np.zeros(len(model.priors)), effects)], "train")
        return model.group_rms(residual, "train")["theta"]

    phase, gain = rng.uniform(0, 6), 10 ** rng.uniform(-1, 3)
    eccentric = {"amplitude": 10 ** rng.uniform(0, 8), "phase": phase}
    plain = left()
    assert plain == pytest.approx(1.0, abs=0.1)
    assert left(Effect("sensor-gain", "theta", {"g": gain})) == pytest.approx(plain, rel=0.01)
    for i in range(n):
        assert left(Effect("encoder-eccentricity", f"theta_{i + 1}", eccentric)) > 0.95 * plain
