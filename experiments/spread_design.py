"""Contacts are off by up to 20 %: is the design for the nominal machine the best one to build?

Mean + 2 sigma of the vibration over drawn machines: Adam on fresh draws, then a search to the end
on fixed ones.  Machines that no search has seen compare it with the nominal optimum.

Run: python experiments/spread_design.py
"""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from omnijax import set_parameter
from omnijax.rig import get_parameter
from omnijax.study import design, load_study
from omnijax.vibration import steady_metrics

MACHINES = 1024

study = load_study(Path(__file__).parent / "studies" / "spread.toml")
spread = design(study)
print(spread)
speeds = jnp.array(study.drives[0].values)
width = np.array([half for _, half in study.tolerances])
unit = np.random.default_rng(11).uniform(-1, 1, (MACHINES, len(width), study.rig.size))
draws = jnp.asarray(unit * width[:, None])  # relative, by part and wheel


def shaken(x, off):
    """RMS of |dR| with contacts x = (K, C) on every wheel and each wheel's parts off, m."""
    rig = study.rig
    for name, value in zip(("contact.stiffness", "contact.damping"), x, strict=True):
        rig = set_parameter(rig, name, value)
    for (path, _), share in zip(study.tolerances, off, strict=True):
        rig = set_parameter(rig, path, get_parameter(rig, path) * (1 + share))
    return steady_metrics(rig, speeds, ("rms",))["rms"]


figures = jax.jit(lambda x, off: jax.lax.map(lambda d: shaken(x, d), off, batch_size=64))


def seen(stiffness, damping):
    values = np.asarray(figures(jnp.array([stiffness, damping]), draws))
    return values.mean(), values.std(), values.mean() + study.sigmas * values.std()


# the best nominal machine, on a grid of stiffnesses with the same damping
damping = spread.variables["contact.damping"]
stiffness = np.linspace(150e3, 260e3, 111)
exact = [float(figures(jnp.array([K, damping]), 0 * draws[:1])[0]) for K in stiffness]
nominal = stiffness[int(np.argmin(exact))]
chosen = spread.variables["contact.stiffness"]
for name, K in (("for the spread", chosen), ("nominal", nominal)):
    mean, deviation, both = (1e3 * x for x in seen(K, damping))
    print(
        f"{name}, {1e-3 * K:.1f} kN/m: mean {mean:.4f} mm, sigma {deviation:.4f} mm, "
        f"mean + 2 sigma {both:.4f} mm"
    )
gain = 1 - seen(chosen, damping)[2] / seen(nominal, damping)[2]
print(f"of {MACHINES} machines not seen before: {100 * gain:+.2f} % by designing for the spread")

assert spread.optimal and spread.agreement == (2, 2)
assert damping > 59.9  # at its bound, so that the grid needs only stiffness
assert seen(nominal, damping)[2] > 1.1 * min(exact)  # parts off cost something
assert chosen < 0.98 * nominal  # away from the resonance above
assert gain > 0.02
