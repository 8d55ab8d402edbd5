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
    try:
        from omnijax.simulation._bulk.rig import bulk_figures, bulk_gradients, plan_bulk
    except ImportError:
        skip("omnijax (bulk gradients are not there)")
        return found
    import jax.numpy as jnp

    from . import _omnijax as ours

    drive = jnp.asarray(problem.SPEEDS)

    def make(row):
        return ours.rig(row), drive, jnp.zeros(3)

    plan, values = plan_bulk(make, rows, problem.DURATION, problem.STEP, "paper"), jnp.asarray(rows)

    def values_only():
        return [np.asarray(x) for x in bulk_figures(make, values, plan)]

    def both():
        _, slopes = bulk_gradients(make, values, plan)
        return np.stack([np.asarray(slopes["rms"]), np.asarray(slopes["peak"])], axis=1)

    def peak():
        return np.asarray(bulk_gradients(make, values, plan, ("peak",))[1]["peak"])

    def peak_error(slopes):
        return problem.gradient_error(slopes[::128][:, None], expected[:, 1:])

    found.append(Tool("omnijax", both, BATCH, error, 5, "RMS and peak with gradients"))
    found.append(Tool("omnijax peak", peak, BATCH, peak_error, 5, "peak with its gradient"))
    found.append(Tool("omnijax values", values_only, BATCH, lambda _: None, 5, "no gradient"))
    return found
