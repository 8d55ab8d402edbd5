"""Wheels with measured profiles: transients, their gradients, and long runs of unlike wheels."""

import functools

import numpy as np

from . import _general, _tables
from . import _problem as problem
from ._clock import Tool, loosest

BATCH, FEW, DAMPING = 256, 4, 120.0
DECADES = tuple(10.0**-k for k in range(2, 9))
SETTLED = 25.0  # e-foldings of the slowest pole


def tools(count: int, figures: str, skip) -> list[Tool]:
    """Ours and scipy on the same linear system; `figures`: transient, gradient or steady."""
    rows = problem.designs(BATCH, DAMPING)
    return {"transient": _transient, "gradient": _gradient, "steady": _steady}[figures](count, rows)


def _some(found) -> np.ndarray:
    return np.asarray(found)[:: BATCH // FEW]


@functools.cache
def _design(count: int):
    """The rig of a row at constant speeds: one function, so that it is compiled once."""
    import equinox as eqx

    from omnijax.laws import TableShape

    from . import _omnijax

    angle, readings = _tables.measured(count)
    profiles = tuple(TableShape.fit(angle, x, _tables.TURN) for x in readings)
    plain = _omnijax.design(count)

    def make(row):
        return eqx.tree_at(lambda point: point.rig.profiles, plain(row), profiles)

    return make


def _runs(count: int, rows, gradient: bool = False):
    from omnijax.vibration import run_metrics

    return run_metrics(
        _design(count), rows, ("rms", "peak"), duration=problem.DURATION, step=problem.STEP,
        gradient=gradient, total=problem.MANY,
    )  # fmt: skip


def _long_runs(count: int, rows, gradient: bool = False):
    from omnijax.vibration import long_run_metrics

    return long_run_metrics(
        _design(count), rows, ("rms", "peak"), gradient=gradient, total=problem.MANY
    )


def _transient(count: int, rows) -> list[Tool]:
    expected = _tables.figures(count, _some(rows))

    def error(found) -> float:
        return problem.error(_some(found)[:, :1], expected[:, :1])

    def runs():
        return _runs(count, rows).values

    note = "with refined peak, poles and statuses; error of the RMS"
    return [
        Tool("omnijax", runs, BATCH, error, 5, note),
        _scipy(count, _some(rows)[1], expected[1]),
    ]


def _gradient(count: int, rows) -> list[Tool]:
    expected = problem.reference_gradient(
        _some(rows), lambda row: _tables.response(count, row, _general.TIMES)
    )

    def error(slopes) -> float:
        return problem.gradient_error(_some(slopes)[:, :1], expected[:, :1])

    def slopes():
        return _runs(count, rows, gradient=True).slopes

    note = "RMS and refined peak with gradients and statuses; error of the RMS's"
    return [Tool("omnijax", slopes, BATCH, error, 5, note)]


def _scipy(count: int, row, expected) -> Tool:
    from scipy.integrate import solve_ivp

    A, B = _general.matrices(count, row)
    speeds, splines = _general.SPEEDS[:count], _tables.splines(count)

    def run(rtol):
        def rate(t, y):
            return A @ y + B @ [x(v * t) for x, v in zip(splines, speeds, strict=True)]

        span, start = (0, problem.DURATION), np.zeros(len(A))
        s = solve_ivp(rate, span, start, "LSODA", _general.TIMES, rtol=rtol, atol=rtol * 1e-5)
        return problem.figures(s.y[:3])

    error = functools.partial(lambda found: problem.error(found, expected))
    note = "solve_ivp, A y + B rho, one design, rtol {:g}"
    return loosest("scipy LSODA", run, DECADES, 1, error, note=note)


def _steady(count: int, rows) -> list[Tool]:
    few = _some(rows)
    expected = np.array([_tables.long_run(_tables.periods(count, row)) for row in few])

    def error(found) -> float:
        return problem.error(_some(found), expected)

    def values():
        return _long_runs(count, rows).values

    def slopes():
        return _long_runs(count, rows, gradient=True).slopes

    return [
        Tool("omnijax", values, BATCH, error, 5, "with poles and statuses"),
        Tool("omnijax gradient", slopes, BATCH, lambda _: None, 3, "RMS and peak"),
        _one_by_one(count, few, expected),
        _scipy_turns(count, few[1], expected[1]),
    ]


def _one_by_one(count: int, rows, expected) -> Tool:
    """The package's steady states without its modal core."""
    import jax
    import jax.numpy as jnp

    from omnijax.vibration import SteadyRun, steady_metric

    @jax.jit
    def one(row):
        at = _design(count)(row)
        run = SteadyRun(at.rig, at.speeds, at.angles, "coupled", force=at.force)
        return jnp.stack([steady_metric(run, name) for name in ("rms", "peak")])

    error = functools.partial(problem.error, expected=expected)
    each = [jnp.asarray(row) for row in rows]
    run = functools.partial(lambda each: np.array([one(row) for row in each]), each)
    return Tool("omnijax one by one", run, len(rows), error, 3, "periodic solutions, no modal core")


def _scipy_turns(count: int, row, expected) -> Tool:
    """Each wheel by itself until it has settled, and then over a turn."""
    from scipy.integrate import solve_ivp

    A, B = _general.matrices(count, row)
    wait = SETTLED / np.min(-np.linalg.eigvals(A).real)

    def turn(i: int, rtol: float) -> np.ndarray:
        speed, spline = _general.SPEEDS[i], _tables.splines(count)[i]
        period = _tables.TURN / speed
        times = wait + period * np.arange(_tables.POINTS) / _tables.POINTS

        def rate(t, y):
            return A @ y + B[:, i] * spline(speed * (t - wait))

        span, start = (0.0, wait + period), np.zeros(len(A))
        return solve_ivp(rate, span, start, "LSODA", times, rtol=rtol, atol=rtol * 1e-5).y[:3]

    def run(rtol):
        return _tables.long_run([turn(i, rtol) for i in range(count)])

    error = functools.partial(lambda found: problem.error(found, expected))
    note = "solve_ivp wheel by wheel, settled, then a turn, one design, rtol {:g}"
    return loosest("scipy LSODA", run, DECADES, 1, error, 1e-6, 1, note=note)
