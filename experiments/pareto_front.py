"""What does a smoother ride (less acceleration) cost in displacement?

The front by epsilon-constraints, and how many evaluations a population method needs for one of
equal quality (pymoo's NSGA-II, where it is installed).  One of our evaluations is an objective
together with its gradient.

Run: python experiments/pareto_front.py [folder for the figure]
"""

import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from omnijax.study import load_study, pareto
from omnijax.study._design.rig import RigCases

study = load_study(Path(__file__).parent / "studies" / "front.toml")
front = pareto(study)
print("\n".join(front.sentences()))
for values, x in zip(front.values, front.x, strict=True):
    print(
        f"rms {1e3 * values[0]:.4f} mm, acceleration {values[1]:.3f} m/s^2, "
        f"K {x[0]:.3g}, C {x[1]:.4g}"
    )

assert set(front.status) == {"optimal"}
assert np.all(np.diff(front.values[:, 1]) < 0)  # every step in rms buys acceleration

if len(sys.argv) > 1:
    from omnijax.report import style

    with style():
        front.plot_front().figure.savefig(Path(sys.argv[1]) / "front.png", dpi=110)

try:
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.core.problem import Problem
    from pymoo.optimize import minimize
except ModuleNotFoundError:
    print("pymoo is not installed: no comparison.")
    raise SystemExit(0) from None

cases = RigCases(study, front.metrics)
low, high = (np.log([getattr(v, side) for v in study.variables]) for side in ("low", "high"))
evaluate = jax.jit(jax.vmap(lambda x: cases.every(jnp.exp(x), jnp.zeros((1, 0)))[0][0, 0]))


class Ride(Problem):
    """The two metrics over the logarithms of stiffness and damping."""

    def __init__(self):
        super().__init__(n_var=2, n_obj=2, xl=low, xu=high)

    def _evaluate(self, x, out, *args, **kwargs):
        out["F"] = np.asarray(evaluate(jnp.asarray(x)))


POPULATION, GENERATIONS = 40, 60
theirs = minimize(Ride(), NSGA2(pop_size=POPULATION), ("n_gen", GENERATIONS), seed=1).F
level = np.interp(theirs[:, 0], front.values[:, 0], front.values[:, 1])
inside = (theirs[:, 0] >= front.values[0, 0]) & (theirs[:, 0] <= front.values[-1, 0])
gap = (theirs[:, 1] / level - 1)[inside]
ratio = POPULATION * GENERATIONS / front.evaluations
print(
    f"NSGA-II: {POPULATION * GENERATIONS} evaluations, {ratio:.1f} times ours; its designs lie "
    f"{100 * gap.min():+.2f} to {100 * gap.max():+.2f} % in acceleration from our front"
)
assert gap.min() > -0.05  # chords between our points lie above the front by up to that
assert ratio > 1
