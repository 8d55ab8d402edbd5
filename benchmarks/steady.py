"""Long-run RMS and supremum of |dR| at constant speeds, to 1e-6."""

import functools

import numpy as np

from . import _c, _general
from . import _problem as problem
from ._clock import Tool, loosest

BATCH, DAMPING, ACCURACY = 1024, 120.0, 1e-6
POINTS = (512, 1024)  # a segment
# points and directions to start from, cheapest first
SETTINGS = sorted(
    ((points, starts) for points in (256, *POINTS, 2048) for starts in (6, 12, 24, 48)),
    key=lambda setting: setting[0] * (12 + setting[1]),
)
FINEST = (1 << 12, 96)


def tools(count: int, skip) -> list[Tool]:
    """Ours and the same closed form in C; `count` wheels of any layout, or 0: the orthogonal rig.

    Everything is held against C on the finest grid.
    """
    name = "general" if count else "elastic"
    library, rows = _c.compiled(name), problem.designs(BATCH, DAMPING)
    if library is None:
        skip("C (no compiler; it also gives the reference)")
        return []
    return _any_layout(library, rows, count) if count else _orthogonal(library, rows)


def _orthogonal(library, rows) -> list[Tool]:
    expected = _c.steady(library, rows, 1 << 14)
    error = functools.partial(problem.error, expected=expected)
    found = []
    for points in POINTS:
        run = functools.partial(_c.steady, library, rows, points)
        name = "c-exact" if points == POINTS[-1] else f"c-exact /{points}"
        note = f"closed form, {points} points a segment"
        found.append(Tool(name, run, BATCH, error, 7, note))
    return [*found, *_ours(0, rows, error)]


def _any_layout(library, rows, count: int) -> list[Tool]:
    program = _general.Program(library, count, rows)
    error = functools.partial(problem.error, expected=program.steady(*FINEST))
    A = np.array([_general.matrices(count, row)[0] for row in rows])

    def given(setting):
        return program.steady(*setting)

    def whole(setting):
        np.linalg.eig(A)
        return program.steady(*setting)

    note = "{0[0]} points a segment from {0[1]} directions"
    c = functools.partial(
        loosest, settings=SETTINGS, designs=BATCH, error=error, accuracy=ACCURACY, rounds=5
    )
    return [
        c("c-general", whole, note=f"closed form with LAPACK's eig, {note}"),
        c("c-general given", given, note=f"closed form, modes are given, {note}"),
        *_ours(count, rows, error),
    ]


def ours(count: int, rows, gradient: bool = False, total: int = problem.MANY):
    """The package's figures of these designs, of `total` in all."""
    import jax.numpy as jnp

    from omnijax.vibration import long_run_metrics

    from . import _omnijax

    return long_run_metrics(
        _omnijax.design(count), jnp.asarray(rows), ("rms", "peak"),
        model="coupled" if count else "paper", gradient=gradient, total=total,
    )  # fmt: skip


def _ours(count: int, rows, error) -> list[Tool]:
    def figures():
        return ours(count, rows).values

    def slopes():
        return ours(count, rows, gradient=True).slopes

    return [
        Tool("omnijax", figures, BATCH, error, 7, "with poles and statuses"),
        Tool("omnijax gradient", slopes, BATCH, lambda _: None, 5, "RMS and peak"),
    ]
