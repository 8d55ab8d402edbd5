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
SUBSTEPS = (1, 2, 3, 4, 6, 8, 12)  # of the Runge-Kutta program
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
        _sweep(count, rows[0]),
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
    tools += [_scipy(count, some[4], sampled[4], x) for x in ("RK45", "LSODA")]
    return [*tools, _plain_diffrax(count, some, sampled), *_numba(count, some, sampled, skip)]


WITH = "with runout, relaxation and a floor line"
OTHERS = "elastic_rms, sphere_acceleration_rms and slip_margin, from samples"
SETTINGS = {"duration": problem.DURATION, "step": problem.STEP, "total": problem.MANY}


def _ours(count: int, rows, effects: bool = False):
    from omnijax.simulation import modal_figures

    from . import _omnijax as ours

    make = ours.design(count, effects)
    return lambda: modal_figures(make, rows, ("rms", "peak"), **SETTINGS).values


def _sweep(count: int, row) -> Tool:
    from . import _omnijax as ours

    one = ours.general_rig(count, row)

    def error(rows, figures):
        return problem.error(figures, _general.figures(count, rows, refined=True))

    return ours.sweep_tool(one, row, _general.SPEEDS[:count], "coupled", error)


def _others(count: int, rows):
    from omnijax.vibration import run_metrics

    from . import _omnijax as ours

    names = ("elastic_rms", "sphere_acceleration_rms", "slip_margin")
    return lambda: run_metrics(ours.design(count), rows, names, **SETTINGS).values


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


def _systems(count: int, rows) -> list[np.ndarray]:
    """A (b, 2 m, 2 m), B (b, 2 m, n), and width and depth of the gaps (b, 2)."""
    made = [_general.matrices(count, row) for row in rows]
    gaps = [problem.gap(eta) for eta in rows[:, 0]]
    return [np.array(x) for x in (*zip(*made, strict=True), gaps)]


def _plain_diffrax(count: int, some, few) -> Tool:
    """vmap of an adaptive solve, as the manual has it."""
    import diffrax as dfx
    import jax
    import jax.numpy as jnp

    speeds, pitch = jnp.asarray(_general.SPEEDS[:count]), 2 * jnp.pi / problem.N

    def field(t, y, system):
        A, B, (width, depth) = system
        into = jnp.mod(speeds * t, pitch)
        rho = jnp.where(into < width, -depth * jnp.sin(2 * jnp.pi * into / width), 0.0)
        return A @ y + B @ rho

    def one(system, rtol):
        solution = dfx.diffeqsolve(
            dfx.ODETerm(field), dfx.Tsit5(), 0.0, problem.DURATION, 1e-4,
            jnp.zeros(len(system[0])), system,
            saveat=dfx.SaveAt(ts=jnp.asarray(_general.TIMES)), max_steps=200_000, throw=False,
            stepsize_controller=dfx.PIDController(rtol=rtol, atol=rtol * 1e-5),
        )  # fmt: skip
        square = jnp.sum(solution.ys[:, :3] ** 2, axis=-1)
        return jnp.stack([jnp.sqrt(square.mean()), jnp.sqrt(square.max())])

    solve = jax.jit(jax.vmap(one, (0, None)))
    systems = [jnp.asarray(x) for x in _systems(count, some)]
    return loosest(
        "diffrax", lambda rtol: np.asarray(solve(systems, rtol)), DECADES, len(some),
        functools.partial(problem.error, expected=few), note="vmap, Tsit5, A y + B rho, rtol {:g}",
    )  # fmt: skip


def _numba(count: int, some, few, skip) -> list[Tool]:
    try:
        import numba
    except ImportError:
        skip("numba (not installed)")
        return []
    speeds, samples, pitch = _general.SPEEDS[:count], problem.SAMPLES, 2 * np.pi / problem.N
    step = problem.STEP

    @numba.njit(fastmath=True)
    def run(A, B, gaps, n):
        designs, m = A.shape[:2]
        out, h = np.zeros((designs, 2)), step / n
        y, z, rho, slope = np.zeros(m), np.zeros(m), np.zeros((3, count)), np.zeros((4, m))
        for b in range(designs):
            width, depth = gaps[b]
            total, top = 0.0, 0.0
            y[:] = 0.0
            for j in range(samples):
                for s in range(n):
                    for part in range(3):
                        for i in range(count):
                            angle = speeds[i] * ((j * n + s) * h + 0.5 * part * h)
                            into = angle - pitch * np.floor(angle / pitch)
                            wave = -depth * np.sin(2 * np.pi / width * into)
                            rho[part, i] = wave if into < width else 0.0
                    for stage in range(4):
                        share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                        for a in range(m):
                            z[a] = y[a] + share * h * slope[stage - 1, a]
                        for a in range(m):
                            rate = 0.0
                            for c in range(m):
                                rate += A[b, a, c] * z[c]
                            for i in range(count):
                                rate += B[b, a, i] * rho[(stage + 1) // 2, i]
                            slope[stage, a] = rate
                    for a in range(m):
                        rise = slope[0, a] + 2 * slope[1, a] + 2 * slope[2, a] + slope[3, a]
                        y[a] += h / 6 * rise
                square = y[0] ** 2 + y[1] ** 2 + y[2] ** 2
                total += square
                top = max(top, square)
            out[b] = np.sqrt(total / (samples + 1)), np.sqrt(top)
        return out

    systems, error = _systems(count, some), functools.partial(problem.error, expected=few)
    note = "RK4, A y + B rho, {} steps a sample"
    return [loosest("numba", lambda n: run(*systems, n), SUBSTEPS, len(some), error, note=note)]
