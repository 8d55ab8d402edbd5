"""The benchmarks' own ground: C programs against the numpy reference, the table, the arguments."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import __main__ as command
from benchmarks import _c
from benchmarks import _problem as problem
from benchmarks._clock import Tool, measure, table

needs_compiler = pytest.mark.skipif(
    not (shutil.which("cc") or shutil.which("gcc")), reason="no C compiler"
)


@needs_compiler
@pytest.mark.parametrize("damping", [0.0, 120.0, 20000.0])
def test_exact_program_agrees_with_the_modes(damping):
    rows = problem.designs(8, damping)
    found = _c.elastic(_c.compiled("elastic"), "exact", rows, problem.SAMPLES, problem.STEP)
    assert problem.error(found, problem.reference(rows)) < 1e-8


@needs_compiler
def test_runge_kutta_programs_converge_to_the_references():
    rows = problem.designs(8, 120.0)[:2].copy()
    library = _c.compiled("elastic")
    args = ("runge_kutta", rows, problem.SAMPLES, problem.STEP)
    errors = [problem.error(_c.elastic(library, *args, n), problem.reference(rows)) for n in (2, 8)]
    assert errors[1] < 1e-5 < 10 * errors[0]
    library = _c.compiled("dynamics")
    fine, coarse = (
        _c.dynamics(library, rows, problem.TORQUE, 200, problem.STEP, n) for n in (32, 8)
    )
    assert 0 < problem.error(coarse, fine) < 1e-3


@needs_compiler
def test_the_programs_leave_the_process_its_subnormal_numbers():
    assert _c.compiled("elastic") is not None
    assert np.array([5e-324]).max() * np.ones(2)[1] > 0


def test_a_row_that_misses_the_accuracy_says_so():
    tools = [
        Tool("omnijax", lambda: np.ones(4), 4, lambda found: float(found[0] - 1)),
        Tool("loose", lambda: np.ones(4), 4, lambda _: 2e-3, 1, "one"),
        Tool("broken", lambda: np.full(4, np.nan), 4, lambda found: float(found[0])),
    ]
    rows = measure("task", tools)
    notes = {row["tool"]: row["note"] for row in rows}
    assert notes == {"omnijax": "", "loose": "one; misses 0.0001", "broken": "misses 0.0001"}
    assert {"task", "tool", "us_per_design", "error"} <= set(rows[0])
    assert table(rows).count("\n| task |") == 3


def test_an_unknown_task_is_refused(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--only", "transiet"])
    with pytest.raises(SystemExit) as stopped:
        command.main()
    assert stopped.value.code == 2
    assert "no such task: transiet" in capsys.readouterr().err
