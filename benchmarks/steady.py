"""Long-run RMS and supremum of |dR| at constant speeds, to 1e-6."""

import functools

from . import _c
from . import _problem as problem
from ._clock import Tool

BATCH, DAMPING = 1024, 120.0


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

    found = []
    for points in (512, 1024):
        run = functools.partial(_c.steady, library, rows, points)
        note = f"closed form, {points} points a segment"
        name = "c-exact" if points == 1024 else f"c-exact /{points}"
        found.append(Tool(name, run, BATCH, error, 7, note))
    import jax.numpy as jnp

    from omnijax.simulation import Operating
    from omnijax.vibration import long_run_metrics

    from . import _omnijax as ours

    drive, values = jnp.asarray(problem.SPEEDS), jnp.asarray(rows)

    def make(row):
        return Operating(ours.rig(row), drive, jnp.zeros(3), jnp.zeros(3))

    figures_of = functools.partial(
        long_run_metrics, names=("rms", "peak"), model="paper", total=problem.MANY
    )

    def figures():
        return figures_of(make, values).values

    def slopes():
        return figures_of(make, values, gradient=True).slopes

    found.append(Tool("omnijax", figures, BATCH, error, 7, "with poles and statuses"))
    nothing = Tool("omnijax gradient", slopes, BATCH, lambda _: None, 5, "RMS and peak")
    return [*found, nothing]
