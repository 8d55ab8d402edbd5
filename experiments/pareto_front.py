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

from omnijax import set_parameter
from omnijax.study import load_study, pareto
from omnijax.vibration import steady_metrics

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

low, high = (np.log([getattr(v, side) for v in study.variables]) for side in ("low", "high"))
speeds = jnp.array(study.drives[0].values)


@jax.jit
@jax.vmap
def evaluate(x):
    """The two metrics of a design at the logarithms of stiffness and damping."""
    rig = study.rig
    for variable, value in zip(study.variables, jnp.exp(x), strict=True):
        rig = set_parameter(rig, variable.name, value)
    return jnp.stack(list(steady_metrics(rig, speeds, front.metrics).values()))


class Ride(Problem):
    """The two metrics over the logarithms of stiffness and damping."""

    def __init__(self):
        super().__init__(n_var=2, n_obj=2, xl=low, xu=high)

    def _evaluate(self, x, out, *args, **kwargs):
        out["F"] = np.asarray(evaluate(jnp.asarray(x)))


POPULATION = 40


def population(generations):
    """The metrics of NSGA-II's designs after some generations of `POPULATION` evaluations."""
    return minimize(Ride(), NSGA2(pop_size=POPULATION), ("n_gen", generations), seed=1).F


def dominated(values, by):
    """Which of `values` (k, 2) another front is better than in both metrics, by a millionth."""
    return (by < (1 - 1e-6) * values[:, None]).all(axis=2).any(axis=1)


LONG, EQUAL = 60, max(1, front.evaluations // POPULATION)
long, equal = population(LONG), population(EQUAL)
shares = [float(dominated(theirs, front.values).mean()) for theirs in (equal, long)]
print(
    f"NSGA-II: after {POPULATION * EQUAL} evaluations (ours: {front.evaluations}) our front is "
    f"better than {100 * shares[0]:.0f} % of its designs in both metrics, after "
    f"{POPULATION * LONG} than {100 * shares[1]:.0f} %; of our points it is better than none"
)
assert not dominated(front.values, np.concatenate([long, equal])).any()
assert shares[0] > 0.5 > shares[1]
