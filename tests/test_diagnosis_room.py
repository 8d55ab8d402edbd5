"""Runs that memory has no room for, runs that tell nothing and machines that run away: refused."""

import dataclasses
import re
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from recordings import columns, write
from tiers import tiered

from omnijax import InputError, read_case
from omnijax._errors import DataWarning
from omnijax.diagnosis import _room, diagnose
from omnijax.laws import EFFECTS, ContactCubic, RollingResistance
from omnijax.machine import load_model, read_machine_case
from omnijax.rig import bundled_rigs

DRIVEN = """
from omnijax.machine import AbstractMachine

class Driven(AbstractMachine):
    J: float = 0.02
    b: float = -1e4
    inputs = {"input": "N m"}
    outputs = {"position": "rad"}
    places = {"shaft": ("motor",)}
    uncertainty = {"J": 0.2}

    def rate(self, x, u, ports):
        return x[1], (u["input"] - self.b * x[1]) / self.J

    def read(self, x, u):
        return {"position": x[0]}

    def start(self, first):
        return first["position"]
"""


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    folder = tmp_path_factory.mktemp("case")
    (folder / "rig.toml").write_bytes(bundled_rigs()["atlas"].read_bytes())
    for seed, name in enumerate(("a", "b")):
        write(folder / f"{name}.csv", columns(samples=300, seed=seed))
    return read_case(folder)


def longer(case, factor, step=2e-3):
    """The same runs, over and over."""
    runs = [
        dataclasses.replace(
            run, time=step * np.arange(factor * len(run.time)),
            channels={k: np.tile(x, factor) for k, x in run.channels.items()},
        )
        for run in case.runs
    ]  # fmt: skip
    return dataclasses.replace(case, runs=runs)


def test_the_memory_needed_grows_with_the_samples_and_the_refusal_says_how_to_thin(
    case, monkeypatch
):
    one, three = (_room.memory_of(longer(case, k), dict(EFFECTS)) for k in (1, 3))
    assert three == pytest.approx(3 * one, rel=0.2)  # longer runs have a few more lines
    monkeypatch.setattr(_room, "available", lambda: 0.9 * three)
    too_few = r"`--first \S+s` uses .*one sample in 3 is too few"
    with pytest.raises(InputError, match=too_few) as found:
        diagnose(longer(case, 3))
    said = re.search(r"needs about (\S+) MB", str(found.value))
    assert said is not None and float(said[1]) == pytest.approx(three / 1e6, rel=0.01)
    monkeypatch.setattr(_room, "available", lambda: 1.5 * three)
    with pytest.warns(DataWarning, match=r"`--thin 2` keeps one sample in 2, `--first \S+s`"):
        _room.check_room(longer(case, 3, step=2e-4), dict(EFFECTS))
    _room.check_room(case, dict(EFFECTS))


def test_short_runs_are_refused(case):
    short = [
        dataclasses.replace(run, time=run.time[:20], path=Path(f"{run.name}.csv"))
        for run in case.runs
    ]
    with pytest.raises(InputError, match=r"a run needs 100 samples: a\.csv has 20, b\.csv has 20"):
        diagnose(dataclasses.replace(case, runs=short))


@pytest.mark.parametrize("rolling", tiered([False, True], (False).__eq__))
def test_a_rig_that_runs_away_is_refused(case, rolling):
    """It ended in a traceback; friction of rolling takes the turning along with the contacts."""
    soft = case.rig.add(ContactCubic(jnp.asarray(-1e18)), "w2")
    soft = soft.add(RollingResistance(jnp.asarray(1e-4)), "all") if rolling else soft
    said = r"rig\.toml: the machine as described runs away .* the runs to learn from: .* not finite"
    with pytest.raises(InputError, match=said):
        diagnose(dataclasses.replace(case, rig=soft))


@pytest.mark.full  # in the gate a rig that does, above
def test_a_machine_of_ones_own_that_runs_away_is_refused(tmp_path):
    """It ended in a traceback: a whole number cannot be NaN."""
    t = 2e-3 * np.arange(400)
    for k in range(3):
        rows = np.stack([t, np.sin(9 * t + k), 1e-3 * np.cos(9 * t + k)], 1)
        np.savetxt(
            tmp_path / f"{k}.csv", rows, delimiter=",", header="t,input,position", comments=""
        )
    (tmp_path / "own.py").write_text(DRIVEN)
    read = read_machine_case(tmp_path, load_model(tmp_path / "own.py"))
    with pytest.raises(InputError, match="the machine as described runs away under the inputs of"):
        diagnose(read)
