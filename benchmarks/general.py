"""Transients of any layout with unlike wheels, 2 s, 1001 samples: RMS and peak of |dR|.

Ours takes a rig and does all of it: its linear system, poles, statuses.  The C program is given the
modes; `c-general` adds the time of LAPACK's eigenvalues for matrices that are there already.
"""

import functools

import numpy as np

from . import _c, _general
from . import _problem as problem
from ._clock import Tool, loosest

BATCH, FEW, DAMPING = 1024, 8, 120.0
DECADES = tuple(10.0**-k for k in range(2, 9))


def tools(count: int, skip) -> list[Tool]:
    """Ours, C with and without its eigenvalues, scipy on the same linear system."""
    rows = problem.designs(BATCH, DAMPING)
    some = rows[:: BATCH // FEW]
    sampled, refined = (_general.figures(count, some, x) for x in (False, True))

    def against(expected):
        return lambda found: problem.error(found[:: BATCH // FEW], expected)

    tools = [
        Tool("omnijax", _ours(count, rows), BATCH, against(refined), 5, "with poles and statuses"),
        Tool("omnijax effects", _ours(count, rows, True), BATCH, lambda _: None, 5, WITH),
        Tool("omnijax others", _others(count, rows), BATCH, lambda _: None, 5, OTHERS),
    ]
    library = _c.compiled("general")
    if library is None:
        skip("C (no compiler)")
    else:
        program = _general.Program(library, count, rows)
        A = np.array([_general.matrices(count, row)[0] for row in rows])

        def whole():
            np.linalg.eig(A)
            return program()

        tools += [
            Tool("c-general", whole, BATCH, against(sampled), 7, "SIMD, with LAPACK's eig"),
            Tool("c-general given", program, BATCH, against(sampled), 7, "SIMD, modes are given"),
        ]
    return [*tools, *(_scipy(count, some[4], sampled[4], x) for x in ("RK45", "LSODA"))]


WITH = "with runout, relaxation and a floor line"
OTHERS = "elastic_rms, sphere_acceleration_rms and slip_margin, from samples"


def _machine(count: int, effects: bool = False):
    import jax.numpy as jnp

    from omnijax.simulation import Operating

    from . import _omnijax as ours

    speeds = jnp.asarray(_general.SPEEDS[:count])

    def make(row):
        rig = ours.general_rig(count, row, effects)
        return Operating(rig, speeds, jnp.zeros(3), jnp.zeros(count))

    return make


SETTINGS = {"duration": problem.DURATION, "step": problem.STEP, "total": problem.MANY}


def _ours(count: int, rows, effects: bool = False):
    from omnijax.simulation import modal_figures

    make = _machine(count, effects)
    return lambda: modal_figures(make, rows, ("rms", "peak"), **SETTINGS).values


def _others(count: int, rows):
    from omnijax.vibration import run_metrics

    make, names = _machine(count), ("elastic_rms", "sphere_acceleration_rms", "slip_margin")
    return lambda: run_metrics(make, rows, names, **SETTINGS).values


def _scipy(count: int, row, expected, method: str) -> Tool:
    from scipy.integrate import solve_ivp

    A, B = _general.matrices(count, row)
    speeds = _general.SPEEDS[:count]

    def run(rtol):
        s = solve_ivp(
            lambda t, y: A @ y + B @ problem.shape(speeds * t, row[0]), (0, problem.DURATION),
            np.zeros(len(A)), method, _general.TIMES, rtol=rtol, atol=rtol * 1e-5,
        )  # fmt: skip
        return problem.figures(s.y[:3])

    error = functools.partial(lambda found: problem.error(found, expected))
    note = "solve_ivp, A y + B rho, one design, rtol {:g}"
    return loosest(f"scipy {method}", run, DECADES, 1, error, note=note)
