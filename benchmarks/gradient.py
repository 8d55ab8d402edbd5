"""RMS and peak of the transient with their gradients in (eta, K, k, C)."""

from collections.abc import Callable

import numpy as np

from . import _c, _general
from . import _problem as problem
from ._clock import Tool

BATCH, EVERY, DAMPING = 1024, 128, 120.0
STEP = 1e-5  # of a parameter, for C's differences


def tools(count: int, skip) -> list[Tool]:
    """Ours and C's central differences, with the bare values beside them.

    `count` wheels of any layout, or 0: the orthogonal rig.
    """
    rows = problem.designs(BATCH, DAMPING)
    some = rows[::EVERY]
    if count:
        expected = problem.reference_gradient(
            some, lambda row: _general.response(count, row, _general.TIMES)[0]
        )
    else:
        expected = problem.reference_gradient(some)

    def error(slopes) -> float:
        return problem.gradient_error(np.asarray(slopes)[::EVERY], expected)

    library = _c.compiled("general" if count else "elastic")
    if library is None:
        skip("C (no compiler)")
        return _ours(count, rows, expected)
    name, run = ("c-general", _general_runs) if count else ("c-exact", _runs)
    differences = _differences(rows, run(library, count, rows))
    note = "central differences, 9 runs" + ", with LAPACK's eig" * bool(count)
    return [Tool(name, differences, BATCH, error, 5, note), *_ours(count, rows, expected)]


def _moved(rows, p: int, sign: int) -> np.ndarray:
    """The designs with parameter `p` a step further."""
    moved = rows.copy()
    moved[:, p] *= 1 + sign * STEP
    return moved


def _differences(rows, run: Callable[[int, int], np.ndarray]) -> Callable[[], np.ndarray]:
    """Central differences of `run(p, sign)`, the figures with parameter `p` moved; also unmoved."""

    def slopes() -> np.ndarray:
        out = np.zeros((len(rows), 2, 4))
        run(0, 0)
        for p in range(4):
            rise = run(p, 1) - run(p, -1)
            out[:, :, p] = rise / (2 * STEP * rows[:, p : p + 1])
        return out

    return slopes


def _runs(library, _, rows):
    def run(p: int, sign: int) -> np.ndarray:
        moved = _moved(rows, p, sign)
        return _c.elastic(library, "exact", moved, problem.SAMPLES, problem.STEP)

    return run


def _general_runs(library, count: int, rows):
    """As `general`: the matrices are there, their eigenvalues count."""
    ways = [(0, 0), *((p, sign) for p in range(4) for sign in (1, -1))]
    ready = {}
    for way in ways:
        moved = _moved(rows, *way)
        A = np.array([_general.matrices(count, row)[0] for row in moved])
        ready[way] = A, _general.Program(library, count, moved)

    def run(p: int, sign: int) -> np.ndarray:
        A, program = ready[p, sign]
        np.linalg.eig(A)
        return program()

    return run


def _ours(count: int, rows, expected) -> list[Tool]:
    from omnijax.simulation import modal_figures

    from . import _omnijax as ours

    def figures(gradient: bool):
        return modal_figures(
            ours.design(count), rows, duration=problem.DURATION, step=problem.STEP,
            model="coupled" if count else "paper", gradient=gradient, total=problem.MANY,
        )  # fmt: skip

    # the orthogonal rig's reference does not count the start, where nothing moves
    share = 1.0 if count else np.sqrt((problem.SAMPLES + 1) / problem.SAMPLES)

    def rms_error(slopes) -> float:
        return problem.gradient_error(share * slopes[::EVERY, :1], expected[:, :1])

    note = "RMS and refined peak with gradients and statuses; error of the RMS's"
    return [
        Tool("omnijax", lambda: figures(True).slopes, BATCH, rms_error, 5, note),
        Tool(
            "omnijax values", lambda: figures(False).values, BATCH, lambda _: None, 5, "no gradient"
        ),
    ]
