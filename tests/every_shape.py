"""The product's flows with every annotated shape checked at every call; a program of its own.

`python tests/every_shape.py FOLDER [FLOW ...]`, a flow being one of those below or a worked study
of `experiments/`: the check has to stand before omnijax is imported.
"""

import os
import runpy
import sys
import time
from functools import partial
from pathlib import Path

os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("JAX_PLATFORMS", "cpu")

from jaxtyping import install_import_hook

CHECKED = ("laws", "rig", "recording", "dynamics", "simulation", "vibration", "study")
if __name__ == "__main__":
    install_import_hook([f"omnijax.{name}" for name in CHECKED], "shapes.checked")

import equinox as eqx  # noqa: E402
import jax  # noqa: E402
import numpy as np  # noqa: E402

import omnijax  # noqa: E402
from omnijax.cli._frame import run  # noqa: E402
from omnijax.rig import InputError  # noqa: E402
from omnijax.simulation import simulate_many  # noqa: E402
from omnijax.vibration import METRICS, modes, natural_frequencies  # noqa: E402

SPEEDS = {"ballbot": [3.0, -2.0, 1.0], "four-wheel": [3.0, 1.0, -2.0, 0.5]}


def command(*words):
    """One command; it must succeed."""
    assert run([str(word) for word in words]) == 0, words


def rig_file(folder, example):
    path = folder / f"{example}.toml"
    if not path.exists():
        command("init", path, "--example", example)
    return path


def run_of(folder, example):
    """A run at constant speeds: figures, files, orders."""
    rig = omnijax.load_rig(rig_file(folder, example))
    run = omnijax.simulate(rig, SPEEDS[example], "8 s")
    omnijax.evaluate(run, rig, tuple(METRICS))
    assert run.summary()
    run.save(folder / f"{example}.nc", rig)
    again = omnijax.load_run(folder / f"{example}.nc")
    np.testing.assert_array_equal(again.dR, run.dR)
    omnijax.evaluate(again, rig, "rms")
    again.to_xarray()
    omnijax.order_track(again, [9, 18], reference="w1")
    omnijax.rpm_order_map(again, reference="w1")
    command("orders", folder / f"{example}.nc", "--out", folder / f"{example}-orders")


def runs(folder):
    """A run of three wheels; of other numbers `drawn_wheels` are traced."""
    run_of(folder, "ballbot")


def four_wheels(folder):
    """The run of four wheels worked out, its files and orders."""
    run_of(folder, "four-wheel")


def torques(folder):
    """Runs under motor torques, one by one and in bulk."""
    rig = omnijax.load_rig(rig_file(folder, "ballbot"))
    drive = omnijax.torques([0.02, 0.01, 0.0])
    ts = np.arange(21) / 500
    run = omnijax.simulate(rig, drive, ts)
    omnijax.evaluate(run, rig, "rms")
    stiffer = omnijax.set_parameter(rig, "contact.stiffness", "300 kN/m")
    both = jax.tree.map(lambda *leaves: np.stack(leaves), rig, stiffer)
    simulate_many(both, drive, ts)


def steady(folder):
    """Steady states, modes and what the wheels can drive.

    Shapes are checked while a program is traced: a steady state need not be compiled.
    """
    for example, values in SPEEDS.items():
        path = rig_file(folder, example)
        rig = omnijax.load_rig(path)
        state = jax.eval_shape(partial(omnijax.steady_state, rig), np.array(values))
        assert state.rms.shape == () and state.peak_component.shape == (3,)
        modes(rig)
        natural_frequencies(rig)
        command("check", path)


def drawn_wheels(folder):
    """Faces of a rig of 2, 5 or 6 drawn wheels and of a batch of such rigs, traced alone."""
    from machines import drawn_machine
    from seeds import drawn_anew

    from omnijax.dynamics import TRANSLATIONS, linear_system, wheel_shape

    rng, ts = drawn_anew("wheels of shapes"), np.arange(21) / 500
    n, batch = int(rng.choice([2, 5, 6])), int(rng.integers(2, 5))
    first, *others = (drawn_machine(rng, n) for _ in range(batch))
    rigs = [first, *(eqx.tree_at(lambda r: r.profiles, rig, first.profiles) for rig in others)]
    turning = rng.uniform(-5, 5, (batch, n))

    def run(rig, values):
        given = omnijax.speeds(values, [1.0, 2.0, 3.0])
        found = omnijax.propagate(rig, given, ts)
        figures = omnijax.evaluate(found, rig, ("rms", "peak", "sphere_weighted_acceleration"))
        return found.dR, found.theta, found.normal_force, figures

    def long_run(rig, values):
        return omnijax.steady_state(rig, values, harmonics=8, grid_bits=6).peak_component

    def of_the_rig(rig, values):
        system = linear_system(TRANSLATIONS["coupled"](rig))
        matrices = eqx.filter(system, eqx.is_array)
        return wheel_shape(rig, values), matrices, natural_frequencies(rig)

    for function in (run, long_run, of_the_rig):
        stacked = jax.tree.map(lambda *leaves: np.stack(leaves), *rigs)
        several = jax.eval_shape(jax.vmap(function), stacked, turning)
        assert all(leaf.shape[0] == batch for leaf in jax.tree.leaves(several)), function


def modal_designs(obstacle, outputs, tables=False):
    """Two designs that are ready for the modal core, at numbers in rows of four.

    `tables`: whether two wheels have a measured table.
    """
    from machines import ORTHOGONAL, machine

    from omnijax import laws
    from omnijax.simulation import Operating
    from omnijax.simulation._modal.batch import ready

    def of(value):
        return jax.numpy.asarray(value, float)

    rig = machine(ORTHOGONAL).add(laws.ContactRelaxation(of(5e4), of(0.03)), "w1")
    force, angle = of([3.0, 0.0, 1.0]), of([0.1, 0.2, 0.3])
    if tables:
        pitch = float(rig.gaps.pitch[0])
        table = laws.TableShape.fit(pitch * np.arange(6) / 6, 1e-4 * np.arange(6.0), pitch)
        profiles = (table, rig.profiles[1], table)
        rig = eqx.tree_at(lambda r: r.profiles, rig, profiles)

    def make(row):
        mass = rig.platform.mass * row[0]
        heavier = eqx.tree_at(lambda r: r.platform.mass, rig, mass)
        return Operating(heavier, row[1:], force, angle)

    (batch,) = ready(make, [[1.0, 3, -2, 1], [1.1, 3, 2, 1]], "coupled", obstacle, 0, outputs)
    return batch


def by_rows(batch, bars):
    """Shape of the derivatives by the rows from those by the designs' arrays."""
    from omnijax.simulation._modal.batch import _from_designs, _from_points

    points = eqx.filter_eval_shape(_from_designs, batch.points, bars, batch.how, batch.turn)
    return eqx.filter_eval_shape(_from_points, batch.make, batch.rows, points).shape


def run_slopes(folder):
    """Figures of runs and their derivatives, traced alone."""
    from omnijax.simulation._modal import bulk, many_runs

    traced = eqx.filter_eval_shape
    step, count = jax.numpy.asarray(0.002), jax.numpy.asarray(51.0)
    batch = modal_designs(bulk.figures_obstacle, bulk.OUTPUTS)
    figures, bars = traced(bulk._figures, batch.design, batch.layout, step, count, True)
    size = len(batch.rows)
    assert (figures.shape, by_rows(batch, bars)) == ((4, size), (2, size, 4))

    batch = modal_designs(many_runs.modal_obstacle, many_runs.RUN_OUTPUTS)
    layout = batch.layout._replace(rows=batch.design.system.C.shape[1])
    outputs = traced(many_runs._outputs, batch.design, layout, step, count, 64)
    bars = traced(many_runs._run_slopes, batch.design, layout, step, count, outputs)
    assert by_rows(batch, bars) == (1, size, 4)

    batch = modal_designs(many_runs.modal_obstacle, many_runs.RUN_OUTPUTS, tables=True)
    layout = batch.layout._replace(rows=batch.design.system.C.shape[1], kinds=())
    given = layout, step, count
    lanes, _ = traced(many_runs._table_lanes, batch.design, *given)
    assert traced(many_runs._with_tables, outputs, lanes, *given).shape == outputs.shape
    sums = traced(many_runs._table_sums, lanes, *given, outputs)
    bars = traced(many_runs._table_slopes, batch.design, *given, sums)
    assert by_rows(batch, bars) == (1, size, 4)


def steady_slopes(folder):
    """Every figure of long runs and its derivatives, traced alone."""
    from omnijax.simulation._modal import bulk
    from omnijax.vibration._comfort import upright_filters
    from omnijax.vibration._in_bulk import BULK_STEADY_METRICS, SteadyTable

    table, metrics = SteadyTable(BULK_STEADY_METRICS, upright_filters()), len(BULK_STEADY_METRICS)
    batch = modal_designs(bulk.modal_steady_obstacle, bulk.outputs_asked(table))
    layout = batch.layout._replace(rows=bulk.rows_asked(table, batch.layout))
    figures, bars = eqx.filter_eval_shape(bulk._long_run, batch.design, layout, table, True)
    size = len(batch.rows)
    assert (figures.shape, by_rows(batch, bars)) == ((metrics + 2, size), (metrics, size, 4))


def sweeps(folder):
    """A sweep in a store, and slopes of a steady state."""
    path = rig_file(folder, "ballbot")
    vary = ["--vary", "contact.stiffness=1e5,2e5,4e5", "--metric", "rms,peak"]
    command("sweep", path, *vary, "--speed", "3,-2,1", "--duration", "0.2s",
            "--out", folder / "swept")  # fmt: skip
    command("sweep-status", folder / "swept")
    command("export", folder / "swept", folder / "swept.csv")
    command("sensitivity", path, "--speed", "3,-2,1", "--metric", "rms,peak", "--check")


def refusals(folder):
    """The check itself: a wrong shape is an error of the checker, not of the user."""
    rig = omnijax.load_rig(rig_file(folder, "ballbot"))
    try:
        omnijax.propagate(rig, omnijax.speeds([1.0, 2.0, 3.0]), np.zeros((2, 3)))
    except InputError:
        raise
    except Exception as error:
        assert "type" in type(error).__name__.lower(), error
        return
    raise AssertionError("sample times of two axes were taken")


EVERY = (
    runs, four_wheels, torques, steady, drawn_wheels, run_slopes, steady_slopes, sweeps, refusals,
)  # fmt: skip
FLOWS = {f.__name__: f for f in EVERY}


def worked_study(name):
    """A study of `experiments/`, which asserts its own answers."""

    def flow(folder):
        sys.argv = [name, str(folder)]
        file = Path(__file__).parents[1] / "experiments" / f"{name}.py"
        runpy.run_path(str(file), run_name="__main__")

    return flow


if __name__ == "__main__":
    for name in sys.argv[2:] or FLOWS:
        begun, folder = time.process_time(), Path(sys.argv[1])
        flow = FLOWS.get(name) or worked_study(name)
        flow(folder)
        print(f"shapes hold: {name}, {time.process_time() - begun:.0f} CPU s", flush=True)
