"""What a log lacks costs a diagnosis what it lacks, and is told: cells, rows, clocks, groups."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from seeds import drawn_anew
from test_plant import recorded

from omnijax.diagnosis import Point, RigModel
from omnijax.diagnosis._machine import to_run
from omnijax.laws import EFFECTS
from omnijax.recording import Recording, channels, read_case
from omnijax.recording._shorten import thinned
from omnijax.recording._values import BRIDGE

NOISE = {"dR": 2e-6, "theta": 1e-4, "Omega": 1e-4, "a": 5e-3}
TORQUES = channels("torque", 3)
SECONDS = 2.4


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """A folder of two short runs of a healthy machine, and their tables."""
    folder = tmp_path_factory.mktemp("gaps")
    _, _, tables = recorded(folder, 71, SECONDS)
    return folder, tables


def read(case, change) -> list[Recording]:
    """The runs once every table has been changed."""
    folder, tables = case
    for k, table in enumerate(tables):
        changed = change({c: np.array(x) for c, x in table.items()})
        rows = zip(*changed.values(), strict=True)
        text = "\n".join([",".join(changed), *(",".join(f"{x:.12g}" for x in r) for r in rows)])
        (folder / f"run-{k + 1}.csv").write_text(text.replace("nan", "") + "\n", encoding="utf-8")
    return read_case(folder).runs


def left_of(case, runs: list[Recording]) -> tuple[np.ndarray, RigModel]:
    """What the stated machine leaves of the fitted run, and the model."""
    rig = read_case(case[0]).rig
    model = RigModel(rig, [to_run(run) for run in runs], NOISE, dict(EFFECTS))
    (left,) = model.residuals([Point(np.zeros(len(model.priors)))], "train")
    return left, model


def emptied(columns, lost: slice):
    """A change: cells of these columns are empty."""

    def change(table: dict[str, Any]) -> dict[str, Any]:
        for c in columns:
            table[c][lost] = np.nan
        return table

    return change


def cut(lost):
    """A change: these rows are missing."""
    return lambda table: {c: np.delete(x, lost) for c, x in table.items()}


def test_empty_cells_of_a_torque_cost_what_missing_rows_cost(case):
    """A straight line had counted as measured: a healthy machine was off by 170 sigma."""
    rng = drawn_anew("empty torques")
    first = int(rng.integers(150, 800))
    lost = slice(first, first + int(rng.integers(BRIDGE + 1, 200)))
    empty, rows = read(case, emptied(TORQUES, lost)), read(case, cut(lost))
    (one, model), (other, second) = left_of(case, empty), left_of(case, rows)
    assert not np.any(model.machine.runs[0].known[lost])
    ours, theirs = model.machine.rows[0], second.machine.rows[0]
    np.testing.assert_array_equal(ours.rotation > 0, theirs.rotation > 0)
    np.testing.assert_array_equal(ours.elastic > 0, theirs.elastic > 0)
    np.testing.assert_allclose(one, other, atol=1e-6)
    assert 0.9 < np.sqrt(np.mean(ours.split(one)[1][ours.rotation > 0] ** 2)) < 1.1


def test_what_was_lost_stays_lost_in_parts_of_a_run(case):
    run = read(case, emptied(TORQUES[1:2], slice(300, 340)))[0]
    np.testing.assert_array_equal(np.flatnonzero(run.lost), np.arange(300, 340))
    less = thinned(run, 7)
    near = np.abs(run.rows[::7] - 320.5) < 20 + 6
    np.testing.assert_array_equal(less.lost, near)
    assert not dataclasses.replace(run, time=run.time[:9], channels={}).lost.any()
