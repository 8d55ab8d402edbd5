"""Which wheel and stiffnesses shake the Atlas sphere least, within what can be built and held?

Seven variables, one of them a whole number; no slip, no lift-off, a preload that the frame bears, a
pressure that the rollers bear, and no natural frequency near a roller-passing order.

Run: python experiments/wheel_design.py [folder for the figure]
"""

import dataclasses
import sys
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from omnijax.study import design, designed_rig, load_study
from omnijax.vibration import contact_load, natural_frequencies, steady_metrics

study = load_study(Path(__file__).parent / "studies" / "wheel.toml")
found = design(study)
print(found)

# the answer by other means than the search's own figures
rig, speeds = designed_rig(study, found), jnp.array(study.drives[0].values)
load = contact_load(rig, speeds)
rms = float(steady_metrics(rig, speeds, ("rms",))["rms"])
lines = np.outer(np.asarray(rig.wheels.rollers * speeds) / (2 * np.pi), [1, 2, 3])
modes = np.asarray(natural_frequencies(rig))
apart = np.abs(modes[:, None, None] / lines - 1).min()
print(
    f"checked: rms {1e3 * rms:.4f} mm, slip margin {float(load.slip_margin.min()):.2f} N, least "
    f"normal force {float(load.least.min()):.1f} N, modes {100 * apart:.2f} % from the nearest line"
)
assert found.optimal
assert np.isclose(rms, found.objective, rtol=1e-9)
assert float(load.slip_margin.min()) > 80 - 1e-3 and float(load.least.min()) > 40
assert apart > 0.15 - 1e-5
assert found.variables["wheel.rollers"] == 16  # more, smaller gaps
assert found.variables["wheel.roundness"] < 0.3501

# what a limit costs, by its multiplier and by searching again with 1 N more preload
price = found.prices["preload <= 120 N"]
relaxed = design(
    dataclasses.replace(
        study,
        variables=tuple(v._replace(start=found.variables[v.name]) for v in study.variables),
        constraints=tuple(
            dataclasses.replace(c, high=c.high + 1.0) if c.quantity == "preload" and c.high else c
            for c in study.constraints
        ),
    )
)
gain = found.objective - relaxed.objective
print(
    f"1 N more preload: {1e6 * price:.3f} µm by the multiplier, {1e6 * gain:.3f} µm searched again"
)
assert relaxed.optimal and relaxed.variables["wheel.rollers"] == 16
assert np.isclose(gain, price, rtol=0.05)

if len(sys.argv) > 1:
    from omnijax.report import style

    with style():
        found.plot_searches().figure.savefig(Path(sys.argv[1]) / "wheel_design.png", dpi=120)
