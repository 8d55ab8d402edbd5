"""Displacement, acceleration and the contacts' own deflection: is every pair of them at odds?

Run: python experiments/pareto_front3.py [folder for the figure]
"""

import sys
from pathlib import Path

import numpy as np

from omnijax.study import load_study, pareto

front = pareto(load_study(Path(__file__).parent / "studies" / "front3.toml"))
print(front)
for values, x in zip(front.values, front.x, strict=True):
    print(
        f"rms {1e3 * values[0]:.4f} mm, acceleration {values[1]:.3f} m/s^2, elastic part "
        f"{1e3 * values[2]:.4f} mm: K {x[0]:.4g} N/m, C {x[1]:.4g} N s/m"
    )
good = np.array([status == "optimal" for status in front.status])
assert good.sum() >= 5
values = front.values[good]
for i in range(len(values)):  # nothing is beaten in all three
    others = np.delete(values, i, axis=0)
    assert not np.any(np.all(others < values[i] * (1 - 1e-9), axis=1))
for m in range(3):  # each metric has its own best design
    assert values[:, m].max() > 1.05 * values[:, m].min()

if len(sys.argv) > 1:
    from omnijax.report import style

    with style():
        front.plot_front().figure.savefig(Path(sys.argv[1]) / "pareto_front3.png", dpi=120)
