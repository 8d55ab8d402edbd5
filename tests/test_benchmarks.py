"""The benchmarks' own ground: C programs against the numpy reference, the table, the arguments."""

import shutil
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from compilations import counted
from machines import ANY_SPEEDS
from seeds import drawn_anew
from tiers import tiered

from benchmarks import __main__ as command
from benchmarks import _c, _general, machine, steady
from benchmarks import _problem as problem
from benchmarks._clock import Tool, loosest, measure, table
from benchmarks._page import PAGE, marks, written
from omnijax.simulation import simulate, torques

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


@pytest.mark.full  # in the gate a separate program: test_reference
@needs_compiler
@pytest.mark.parametrize("case", [(3, 0.0), (4, 2e-6)])
def test_the_machine_program_is_the_rig(case):
    """Hertz contacts, unlike wheels: the C program against adaptive steps of the package's rig."""
    (count, play), rows, samples = case, problem.designs(8, 120.0)[5:6], 60
    ts = problem.STEP * jnp.arange(samples + 1)
    drive = torques(machine.TORQUE[:count])
    run = simulate(
        machine.rig(count, play, jnp.asarray(rows[0])), drive, ts, solver="tsit5", rtol=1e-9
    )
    expected = problem.figures(np.asarray(run.dR[1:]).T)
    library = _c.compiled("machine")
    found = machine.runge_kutta(library, count, rows, play, 64, samples)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    assert expected[0] > 1e-6


@needs_compiler
def test_the_programs_leave_the_process_its_subnormal_numbers():
    assert _c.compiled("elastic") is not None
    assert np.array([5e-324]).max() * np.ones(2)[1] > 0


@needs_compiler
@pytest.mark.parametrize("count", tiered([3, 4, 6], (3).__ne__))
def test_the_general_program_agrees_with_the_modes(count):
    library = _c.compiled("general")
    for damping in (0.0, 120.0, 20000.0):
        rows = problem.designs(16, damping)
        expected = _general.figures(count, rows[::8])
        found = _general.Program(library, count, rows)()
        assert problem.error(found[::8], expected) < 1e-10


@needs_compiler
@pytest.mark.full  # in the gate the special program in C: test_steady_bulk
@pytest.mark.parametrize("count", [3, 4, 6])
def test_the_general_program_and_the_package_agree_on_long_runs(count):
    """Two ways to the suprema: a fine grid and many starts, and what `steady` is measured by."""
    rng, library = drawn_anew("long runs"), _c.compiled("general")
    assert library is not None
    rows = np.tile(problem.designs(1, 120.0), (64, 1))
    rows *= 10 ** rng.uniform([-0.3, -0.5, -0.5, -0.5], [0.3, 0.5, 0.5, 1.5], rows.shape)
    found = _general.Program(library, count, rows).steady(2048, 96)
    ours = steady.ours(count, rows, total=0).values
    assert problem.error(found, np.asarray(ours)) < 1e-6


@pytest.mark.full  # in the gate sweeps: test_sweep, and test_modal
def test_what_is_timed_compiles_nothing_once_warm():
    rows = problem.designs(4, 120.0)
    steady.ours(3, rows, total=0)
    compiled = counted()
    steady.ours(3, rows, total=0)
    assert compiled == []
    jax.jit(lambda x: x + len(compiled))(jnp.ones(13))  # what does compile is counted
    assert compiled


@pytest.mark.full  # in the gate the program in C beside the modes, above
@ANY_SPEEDS
@pytest.mark.parametrize("count", tiered([3, 4], lambda count: count == 4))
def test_general_machines_are_the_rigs_they_are_measured_beside(count):
    import jax.numpy as jnp

    from benchmarks import _omnijax as ours
    from omnijax import propagate, speeds

    rng = drawn_anew("general machines")
    row = np.array([rng.uniform(0.1, 0.9), 10 ** rng.uniform(4.5, 6), 1e6, rng.uniform(0, 9e3)])
    times = _general.TIMES[::10]
    drive = speeds(_general.SPEEDS[:count])
    run = propagate(ours.general_rig(count, jnp.asarray(row)), drive, jnp.asarray(times))
    dR, rate = _general.response(count, row, times)
    for found, expected in ((run.dR, dR.T), (run.dR_rate, rate.T)):
        assert np.abs(found - expected).max() < 1e-8 * np.abs(expected).max(), row


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


def test_a_tool_gets_the_loosest_setting_that_reaches_the_bar_and_runs_warm():
    ran = []

    def solve(tolerance):
        ran.append(tolerance)
        return tolerance

    settings = (1e-2, 1e-3, 1e-4, 1e-5)
    tool = loosest("solver", solve, settings, 1, lambda o: 0.5 * o, 1e-4, 3, "one, rtol {:g}")
    assert ran == [1e-2, 1e-3, 1e-4] and tool.note == "one, rtol 0.0001; rtol 0.001 has 5.0e-04"
    never = loosest("solver", solve, settings, 1, lambda o: 1.0, 1e-4, 1, "rtol {:g}")
    ran.clear()
    rows = measure(
        "task",
        [tool, never, Tool("first", lambda: ran.append("cold"), 1, lambda _: None, 1, "", True)],
    )
    assert ran.count(1e-4) == 1 + 3 and ran.count("cold") == 1  # once to warm up, then timed
    assert rows[1]["note"].endswith("misses 0.0001")


def test_the_table_of_the_page_is_replaced_whole():
    for name in ("table", "hidden effects"):
        begin, end = marks(name)
        page = f"before\n{begin}old row\n{end}after\n"
        assert written(page, name, "new rows") == f"before\n{begin}\nnew rows\n\n{end}after\n"
        with pytest.raises(ValueError, match="lacks the lines"):
            written("no marks", name, "new rows")
        assert begin in PAGE.read_text() and end in PAGE.read_text()


def test_part_of_a_table_is_not_written(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--only", "cold", "--write"])
    with pytest.raises(SystemExit) as stopped:
        command.main()
    assert stopped.value.code == 2 and "leave --only out" in capsys.readouterr().err


def test_an_unknown_task_is_refused(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--only", "transiet"])
    with pytest.raises(SystemExit) as stopped:
        command.main()
    assert stopped.value.code == 2
    assert "no such task: transiet" in capsys.readouterr().err
