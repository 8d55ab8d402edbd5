"""Torque-driven dynamics of the whole coupled machine with spin resistance, 2 s, 1000 samples."""

import functools

import numpy as np

from . import _c
from . import _problem as problem
from ._clock import Tool, loosest

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

    run = functools.partial(c, rows, problem.TORQUE, problem.SAMPLES, problem.STEP)
    steps = loosest(
        "c-rk4", run, (3, 4, 5, 6, 7, 8, 10), BATCH, error, note="scalar, {} steps a sample"
    )
    return [steps, *_ours(rows, some, error), _scipy(library, some[4], expected[4])]


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

    every, few = jnp.asarray(rows), jnp.asarray(some)

    @functools.cache
    def solver(name, rtol):
        def one(row):
            run = simulate(
                ours.rig(row, True), drive, ts, solver=name, rtol=rtol, adjoint=dfx.ForwardMode()
            )
            return ours.figures(run.dR[1:])

        return jax.jit(jax.vmap(one))

    def adaptive(name, rtol):
        return np.asarray(solver(name, rtol)(few))

    fixed = Tool("omnijax", lambda: np.asarray(many(every)), BATCH, error, 3)
    return [
        fixed._replace(note="simulate_many: exponential, fixed step"),
        *(
            loosest(
                f"omnijax simulate {name}", functools.partial(adaptive, name),
                (1e-3, 1e-4, 1e-5, 1e-6), FEW, error, note="diffrax, adaptive, rtol {:g}",
            )
            for name in ("exponential", "tsit5")
        ),
    ]  # fmt: skip


def _scipy(library, row, expected) -> Tool:
    from scipy.integrate import solve_ivp

    out, torque = np.zeros(22), np.ascontiguousarray(problem.TORQUE)
    design = np.ascontiguousarray(row)

    def field(t, y):
        y = np.ascontiguousarray(y)
        pointers = [_c.pointer(x) for x in (y, out, design, torque)]
        library.single_rate(*pointers)
        return out.copy()

    def run(rtol):
        start = np.zeros(22)
        start[6] = 1
        s = solve_ivp(
            field, (0, problem.DURATION), start, "RK45", problem.TIMES, rtol=rtol, atol=rtol * 1e-5
        )
        return problem.figures(s.y[10:13])

    note = "solve_ivp RK45, right-hand side in C, one design, rtol {:g}"
    decades = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
    return loosest("scipy", run, decades, 1, lambda o: problem.error(o, expected), note=note)
