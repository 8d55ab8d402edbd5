"""Long-run RMS and supremum of |dR| at constant speeds, to 1e-6."""

import numpy as np

from . import _c
from . import _problem as problem
from ._clock import Tool

BATCH, DAMPING, ACCURACY = 256, 120.0, 1e-6


def tools(skip) -> list[Tool]:
    """Ours and the same closed form in C."""
    rows = problem.designs(BATCH, DAMPING)
    library = _c.compiled("elastic")
    if library is None:
        skip("C (no compiler; it also gives the reference)")
        return []
    expected = _c.steady(library, rows, 1 << 14)

    def error(found):
        return problem.error(found, expected)

    found = [Tool("c-exact", lambda: _c.steady(library, rows, 512), BATCH, error, 7, "closed form")]
    import jax
    import jax.numpy as jnp

    from omnijax.simulate import steady_state

    from . import _omnijax as ours

    @jax.jit
    def run(rows):
        def one(row):
            state = steady_state(ours.rig(row), jnp.asarray(problem.SPEEDS), model="paper")
            return jnp.stack([state.rms, state.peak])

        return jax.vmap(one)(rows)

    values = jnp.asarray(rows)
    found.append(Tool("omnijax", lambda: np.asarray(run(values)), BATCH, error, 5, "closed form"))
    return found
