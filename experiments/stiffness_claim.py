"""Is the contact stiffness "the dominant parameter", or does vibration "vary little" with it?

The paper's section 5 says both.  Exact derivatives over a range of speeds answer, for |ΔR|, its
elastic part and the sphere's acceleration; the verdict on each range of speeds is computed.

Run: python experiments/stiffness_claim.py [folder for the figure]
"""

import sys
from pathlib import Path

import numpy as np

from omnijax.study import sensitivity_over_speeds

PAPER = (0.1, 1.2, 0.3)  # rad/s, section 3.1
STIFFNESS = "contact.stiffness"

scale = np.geomspace(0.5, 40.0, 48)
found = sensitivity_over_speeds(
    "atlas",
    PAPER,
    scale,
    ("rms", "elastic_rms", "sphere_acceleration_rms"),
    (STIFFNESS, "wheel.roundness"),
)
rms, elastic = found.of("rms", STIFFNESS), found.of("elastic_rms", STIFFNESS)
round_ = found.of("rms", "wheel.roundness")

print("speed of w2   rms       elastic part   acceleration   rms to roundness   (% per %)")
for i in range(0, len(scale), 6):
    print(
        f"{1.2 * scale[i]:8.3g} rad/s {rms[i]:+9.4f} {elastic[i]:+12.3f}"
        f" {found.of('sphere_acceleration_rms', STIFFNESS)[i]:+14.3f} {round_[i]:+14.3f}"
    )
static = 2e4 / (188208 + 2e4)  # closure.stiffness/(K + K'): a slow wheel shares its shape so
slow = scale <= 1.5  # rollers pass far below the natural frequencies
near = np.abs(rms) > np.abs(round_)  # where stiffness outweighs roundness
top, first, last = 1.2 * scale[slow].max(), 1.2 * scale[near].min(), 1.2 * scale[near].max()
print(
    f"up to {top:.2g} rad/s: stiffness moves |ΔR| by {rms[slow].min():+.3f} to "
    f"{rms[slow].max():+.3f} % per % (the closure spring's static share is {static:+.3f}), "
    f"roundness by {round_[slow].min():+.2f} to {round_[slow].max():+.2f}: "
    '"varied little" holds of |ΔR|;'
)
print(
    f"the elastic part moves by {elastic[slow].min():+.2f} to {elastic[slow].max():+.2f} there: it "
    "depends on stiffness."
)
print(
    f"at {near.sum()} of the {(~slow).sum()} faster speeds, from {first:.2g} to {last:.2g} rad/s, "
    f"stiffness outweighs roundness in |ΔR| itself, by {rms[near].min():+.2f} to "
    f'{rms[near].max():+.2f} % per %: "dominant" holds near a resonance.'
)

assert np.all(np.abs(rms[slow]) < 0.06 * np.abs(round_[slow]))
assert np.all(np.abs(rms[slow] - static) < 0.03)
assert np.all(elastic[slow] < -0.5)
assert not near[slow].any() and near.sum() >= 3
assert rms.max() > 2.0 and rms.min() < -1.0  # of either sign, near a resonance

if len(sys.argv) > 1:
    from omnijax.report import style

    with style():
        figure = found.plot_speeds(STIFFNESS).figure
        figure.savefig(Path(sys.argv[1]) / "stiffness_claim.png", dpi=120)
