"""Torque-driven dynamics of the whole coupled machine with spin resistance, 2 s, 1000 samples."""

import functools

import numpy as np

from . import _c
from . import _problem as problem
from ._clock import Tool

BATCH, FEW, DAMPING = 256, 8, 120.0


def tools(skip) -> list[Tool]:
    """Ours, C RK4 at several steps, scipy on C's right-hand side, plain diffrax on ours."""
    rows = problem.designs(BATCH, DAMPING)
    some = rows[:: BATCH // FEW].copy()
    library = _c.compiled("dynamics")
    if library is None:
        skip("C (no compiler; it also gives the reference)")
        return []
    c = functools.partial(_c.dynamics, library)
    whole = c(rows, problem.TORQUE, problem.SAMPLES, problem.STEP, 64)
    expected = whole[:: BATCH // FEW]

    def error(found):
        return problem.error(found, expected if len(found) == FEW else whole)

    found = []
    for n in (6, 8):
        run = functools.partial(c, rows, problem.TORQUE, problem.SAMPLES, problem.STEP, n)
        note = f"scalar, step {1e6 * problem.STEP / n:.0f} us"
        found.append(Tool(f"c-rk4 /{n}", run, BATCH, error, 3, note))
    return found + _ours(rows, some, error) + [_scipy(library, some[4], expected[4])]


def _ours(rows, some, error) -> list[Tool]:
    import diffrax as dfx
    import jax
    import jax.numpy as jnp

    from omnijax.simulation import simulate, simulate_many, torques

    from . import _omnijax as ours

    drive, ts = torques(problem.TORQUE), problem.STEP * jnp.arange(problem.SAMPLES + 1)

    @jax.jit
    def many(rows):
        return ours.figures(simulate_many(ours.rigs(rows, True), drive, ts).dR[:, 1:])

    def adaptive(solver, rtol):
        def one(row):
            run = simulate(
                ours.rig(row, True), drive, ts, solver=solver, rtol=rtol, adjoint=dfx.ForwardMode()
            )
            return ours.figures(run.dR[1:])

        return jax.jit(jax.vmap(one))

    every, few = jnp.asarray(rows), jnp.asarray(some)
    exponential, plain = adaptive("exponential", 1e-5), adaptive("tsit5", 1e-4)
    fixed = Tool("omnijax", lambda: np.asarray(many(every)), BATCH, error, 3)
    return [
        fixed._replace(note="simulate_many: exponential, fixed step"),
        Tool("omnijax simulate", lambda: np.asarray(exponential(few)), FEW, error, 1, "adaptive"),
        Tool("diffrax", lambda: np.asarray(plain(few)), FEW, error, 1, "vmap, Tsit5, our field"),
    ]


def _scipy(library, row, expected) -> Tool:
    from scipy.integrate import solve_ivp

    out, torque = np.zeros(22), np.ascontiguousarray(problem.TORQUE)
    design = np.ascontiguousarray(row)

    def field(t, y):
        y = np.ascontiguousarray(y)
        pointers = [_c.pointer(x) for x in (y, out, design, torque)]
        library.single_rate(*pointers)
        return out.copy()

    def run():
        start = np.zeros(22)
        start[6] = 1
        s = solve_ivp(
            field, (0, problem.DURATION), start, "RK45", problem.TIMES, rtol=1e-4, atol=1e-9
        )
        return problem.figures(s.y[10:13])

    note = "solve_ivp RK45, rtol 1e-4, right-hand side in C, one design"
    return Tool("scipy", run, 1, lambda o: problem.error(o, expected), 1, note)
