"""Runs that memory has no room for, and runs that tell nothing, are refused before any work."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
from recordings import columns, write

from omnijax import InputError, read_case
from omnijax._errors import DataWarning
from omnijax.diagnosis import _room, diagnose
from omnijax.laws import EFFECTS
from omnijax.rig import bundled_rigs


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    folder = tmp_path_factory.mktemp("case")
    (folder / "rig.toml").write_bytes(bundled_rigs()["atlas"].read_bytes())
    for name in ("a", "b"):
        write(folder / f"{name}.csv", columns(samples=300))
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
