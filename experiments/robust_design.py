"""One stiffness and damping for two pilots and three speeds: what does it cost, what does it save?

The design for the worst of six cases beside the one for cruising with the light pilot alone.

Run: python experiments/robust_design.py [folder for the figure]
"""

import sys
import tomllib
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from omnijax.study import design, design_problem, parse_study

text = (Path(__file__).parent / "studies" / "robust.toml").read_text(encoding="utf-8")
study = parse_study(tomllib.loads(text))
robust = design(study)
print(robust)

problem = design_problem(study)
figures = jax.jit(lambda grid: jax.lax.map(lambda x: problem.figures(x, problem.extra), grid))

# a fine grid of the same two variables, every case of it
stiffness, damping = np.geomspace(1.5e5, 3e6, 36), np.linspace(50, 200, 4)
grid = np.stack(np.meshgrid(stiffness, damping, indexing="ij"), axis=-1).reshape(-1, 2)
f, g = (np.asarray(x) for x in figures(jnp.asarray(grid)))
limits = np.array([limit.bound for limit in problem.limits])
worst = np.where(np.all(g <= limits, axis=1), f.max(axis=1), np.inf)
best = int(np.argmin(worst))
print(
    f"best of {len(grid)} designs on a grid: {1e3 * worst[best]:.4f} mm at K = "
    f"{grid[best, 0]:.4g} N/m, C = {grid[best, 1]:.4g} N s/m"
)
cruise = problem.cases.index("cruise, light pilot")
alone = int(np.argmin(np.where(np.all(g <= limits, axis=1), f[:, cruise], np.inf)))
here = robust.cases["cruise, light pilot"]
print(
    f"best of the grid for cruising with the light pilot: {1e3 * f[alone, cruise]:.4f} mm there, "
    f"but {1e3 * f[alone].max():.4f} mm in its worst case; the robust design: {1e3 * here:.4f} mm "
    f"there, {1e3 * robust.objective:.4f} mm in its worst case"
)
assert robust.optimal
assert len(robust.multipliers) and "worst cases" in robust.multipliers[-1]
assert robust.objective <= worst[best] * (1 + 1e-9)
assert worst[best] < 1.05 * robust.objective  # and the grid comes near it
assert f[alone].max() > 1.4 * robust.objective

if len(sys.argv) > 1:
    from omnijax.report import style

    with style():
        robust.plot_cases().figure.savefig(Path(sys.argv[1]) / "robust_design.png", dpi=120)
