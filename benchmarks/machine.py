"""Torque-driven machines of any layout, Hertz contacts, mounts with play: 2 s, 1000 samples."""

import functools
from typing import NamedTuple

import numpy as np

from . import _c, _general
from . import _problem as problem
from ._clock import Tool, loosest

BATCH, FEW, DAMPING = 256, 4, 120.0
DECADES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
PRELOAD = 200.0  # N, at which no contact opens: where one does, no two step sizes agree for long
TORQUE = np.array([0.02, 0.1, 0.05, 0.04])  # N m


def tools(count: int, play: float, skip) -> list[Tool]:
    """Ours by fixed and adaptive steps, C Runge-Kutta, scipy; `play` (m) is half of the mounts'."""
    library = _c.compiled("machine")
    if library is None:
        skip("C (no compiler; it also gives the reference)")
        return []
    rows = problem.designs(BATCH, DAMPING)
    c = functools.partial(runge_kutta, library, count, rows, play)
    whole = c(64)

    def error(found):
        return problem.error(found, whole if len(found) == BATCH else whole[:: BATCH // FEW])

    steps = (2, 3, 4, 5, 6, 7, 8, 10, 12)
    return [
        loosest("c-rk4", c, steps, BATCH, error, note="scalar, {} steps a sample"),
        *_ours(count, play, rows, error),
        _scipy(library, count, play, rows[BATCH // 2], whole[BATCH // 2]),
    ]


class _Given(NamedTuple):
    """What the C program is told of some designs: arrays in its order."""

    values: np.ndarray  # (b, 1 + 3 n): eta; K, C and k of every wheel
    normal: np.ndarray  # (n, 3)
    drive: np.ndarray
    torque: np.ndarray  # N m


def _given(count: int, rows) -> _Given:
    made = [(_general.stiffness(count, row), row) for row in rows]
    values = [np.concatenate([row[:1], *wheels, np.full(count, row[2])]) for wheels, row in made]
    arrays = values, *_general.layout(count), TORQUE[:count]
    return _Given(*(np.ascontiguousarray(x, float) for x in arrays))


def runge_kutta(library, count: int, rows, play: float, substeps: int, samples=problem.SAMPLES):
    """RMS and peak of |dR| of `rows` (eta, K, k, C), the wheels' own about them, by `machine.c`."""
    *rigs, torque = map(_c.pointer, _given(count, rows))
    out, number = np.zeros((len(rows), 2)), _c.number
    getattr(library, f"machine_{count}")(
        len(rows), *rigs, number(PRELOAD), number(play), torque,
        samples, number(problem.STEP), substeps, _c.pointer(out),
    )  # fmt: skip
    return out


def _scipy(library, count: int, play: float, row, expected) -> Tool:
    from scipy.integrate import solve_ivp

    arrays, number = _given(count, row[None]), _c.number
    *rig, torque = map(_c.pointer, arrays)
    out, rate = np.zeros(12 + 3 * count), getattr(library, f"rate_{count}")

    def field(t, y):
        y = np.ascontiguousarray(y)
        rate(_c.pointer(y), _c.pointer(out), *rig, number(PRELOAD), number(play), torque)
        return out.copy()

    def run(rtol):
        s = solve_ivp(
            field, (0, problem.DURATION), 0 * out, "RK45", problem.TIMES, rtol=rtol,
            atol=rtol * 1e-5,
        )  # fmt: skip
        return problem.figures(s.y[:3])

    note = "solve_ivp RK45, right-hand side in C, one design, rtol {:g}"
    error = functools.partial(problem.error, expected=expected)
    return loosest("scipy", run, DECADES, 1, error, note=note)


def rig(count: int, play: float, row):
    """The same machine as a rig."""
    import equinox as eqx
    import jax.numpy as jnp

    from omnijax import laws

    from . import _omnijax as ours

    made = ours.general_rig(count, row).add(laws.ContactHertz(), "all")
    if play:
        made = made.add(laws.MountBacklash(jnp.asarray(play)), "all")
    return eqx.tree_at(lambda r: r.wheels.closure.preload, made, jnp.full(count, PRELOAD))


def _ours(count: int, play: float, rows, error) -> list[Tool]:
    import diffrax as dfx
    import jax
    import jax.numpy as jnp

    from omnijax._compiling import Effort, compiler_options
    from omnijax.simulation import simulate, simulate_many, torques

    from . import _omnijax as ours

    drive, ts = torques(TORQUE[:count]), problem.STEP * jnp.arange(problem.SAMPLES + 1)
    every, few = jnp.asarray(rows), jnp.asarray(rows[:: BATCH // FEW])

    @functools.partial(jax.jit, compiler_options=compiler_options(Effort.MOST, 0))  # as sweeps
    def many(rows, substeps):
        rigs = jax.vmap(lambda row: rig(count, play, row))(rows)
        run = simulate_many(rigs, drive, ts, substeps=substeps, method="runge-kutta")
        return ours.figures(run.dR[:, 1:])

    @functools.cache
    def adaptive(rtol):
        def one(row):
            run = simulate(
                rig(count, play, row), drive, ts,
                solver="tsit5", rtol=rtol, adjoint=dfx.ForwardMode(),
            )  # fmt: skip
            return ours.figures(run.dR[1:])

        return jax.jit(jax.vmap(one))

    return [
        loosest(
            "omnijax", lambda n: np.asarray(many(every, jnp.asarray(n))), (4, 6, 8, 10, 12, 16, 20),
            BATCH, error, note="simulate_many: Runge-Kutta, {} steps for two samples",
        ),
        loosest(
            "omnijax simulate tsit5", lambda rtol: np.asarray(adaptive(rtol)(few)),
            DECADES[1:], FEW, error, note="diffrax, adaptive, rtol {:g}",
        ),
    ]  # fmt: skip
