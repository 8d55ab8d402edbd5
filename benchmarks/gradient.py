"""RMS and peak of the transient with their gradients in (eta, K, k, C)."""

import numpy as np

from . import _c
from . import _problem as problem
from ._clock import Tool

BATCH, DAMPING = 1024, 120.0


def tools(skip) -> list[Tool]:
    """Ours and C's central differences, with the bare values beside them."""
    rows = problem.designs(BATCH, DAMPING)
    expected = problem.reference_gradient(rows[::128])
    found: list[Tool] = []

    def error(gradient):
        return problem.gradient_error(np.asarray(gradient)[::128], expected)

    library = _c.compiled("elastic")
    if library is None:
        skip("C (no compiler)")
    else:

        def differences():
            out = np.zeros((len(rows), 2, 4))
            _c.elastic(library, "exact", rows, problem.SAMPLES, problem.STEP)
            for p in range(4):
                way = np.ones(4)
                way[p] = 1e-5
                ends = []
                for sign in (1, -1):
                    moved = rows.copy()
                    moved[:, p] *= 1 + sign * 1e-5
                    ends.append(_c.elastic(library, "exact", moved, problem.SAMPLES, problem.STEP))
                out[:, :, p] = (ends[0] - ends[1]) / (2e-5 * rows[:, p : p + 1])
            return out

        found.append(Tool("c-exact", differences, BATCH, error, 5, "central differences, 9 runs"))
    import jax.numpy as jnp

    from omnijax.simulation import Operating, modal_figures

    from . import _omnijax as ours

    drive = jnp.asarray(problem.SPEEDS)

    def make(row):
        return Operating(ours.rig(row), drive, jnp.zeros(3), jnp.zeros(3))

    def figures(gradient: bool):
        return modal_figures(
            make, rows, duration=problem.DURATION, step=problem.STEP, model="paper",
            gradient=gradient, total=problem.MANY,
        )  # fmt: skip

    def rms_error(slopes):  # its samples count the start, where nothing moves
        count = problem.SAMPLES
        mine = slopes[::128, :1] * np.sqrt((count + 1) / count)
        return problem.gradient_error(mine, expected[:, :1])

    note = "RMS and refined peak with gradients and statuses; error of the RMS's"
    found.append(Tool("omnijax", lambda: figures(True).slopes, BATCH, rms_error, 5, note))
    values = Tool(
        "omnijax values", lambda: figures(False).values, BATCH, lambda _: None, 5, "no gradient"
    )
    return [*found, values]
