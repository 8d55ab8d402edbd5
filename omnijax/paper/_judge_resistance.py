"""The claim that rolling and spin resistance are negligible, over materials and normal forces."""

import jax.numpy as jnp
import numpy as np

from ..dynamics import turned
from ..laws import HertzResistance, RollingSignal, effective_modulus, effective_radius
from ..rig import Rig
from ._case import TORQUE
from ._claim import Claim, at_most
from ._study import PaperStudy

RUBBER, POLYMER, STEEL = 1e6, 1e9, 2e11  # Pa
POISSON = (0.3, 0.5)


def _turning(rig: Rig, torque, opposing) -> tuple[np.ndarray, np.ndarray]:
    """dOmega/dt of round wheels, and f, under shaft torques and a torque against the sphere."""
    wheels, sphere = rig.wheels, rig.sphere
    force, turning = turned(
        wheels.spin_axis, wheels.radius, sphere.radius, wheels.inertia, sphere.inertia_matrix,
        torque, opposing,
    )  # fmt: skip
    return np.asarray(turning), np.asarray(force)


def slowing(
    rig: Rig, modulus: float, ratio: float, arm_ratio: float, preload: float | None
) -> float:
    """Relative change of dOmega/dt by the resistances; no `preload`: the least N without slip."""
    wheels, torque = rig.wheels, jnp.asarray(TORQUE)
    free, force = _turning(rig, torque, jnp.zeros(3))
    pressed = np.abs(force) / np.asarray(wheels.contact.friction) if preload is None else preload
    curvature = effective_radius(rig.sphere.radius, wheels.radius[0])
    law = HertzResistance(
        jnp.asarray(curvature),
        jnp.asarray(effective_modulus(modulus, ratio, modulus, ratio)),
        jnp.asarray(arm_ratio),
        jnp.asarray(1e-6),
    )
    moving = free / np.linalg.norm(free)
    signal = RollingSignal(
        wheels.spin_axis @ moving,
        -wheels.normal @ moving,
        jnp.broadcast_to(jnp.asarray(pressed), (rig.size,)),
        wheels.contact.friction,
    )
    resisted = law(signal)
    opposing = wheels.spin_axis.T @ resisted.roll - wheels.normal.T @ resisted.spin
    slowed, _ = _turning(rig, torque - resisted.shaft, opposing)
    return float(np.linalg.norm(slowed - free) / np.linalg.norm(free))


def resistance_claim(study: PaperStudy) -> Claim:
    """Negligible: below 5 % of the sphere's angular acceleration."""

    def over(low: float, high: float, arm: float, preload: float | None) -> list[float]:
        moduli = np.geomspace(low, high, 7)
        return [slowing(study.rig, e, nu, arm, preload) for e in moduli for nu in POISSON]

    change = "relative change of dΩ/dt"
    preload = float(study.rig.wheels.closure.preload[0])
    return Claim(
        "resistances-negligible",
        "Rolling and spin resistance are negligible.",
        "table of readings",
        [
            at_most(
                "least normal force without slip, stiff bodies (E from 1 GPa), rolling arm 0 "
                "(pure Hertz)",
                change,
                over(POLYMER, STEEL, 0.0, None),
                0.05,
            ),
            at_most(
                "the same with the rolling arm a",
                change,
                over(POLYMER, STEEL, 1.0, None),
                0.05,
            ),
            at_most(
                "least normal force, rubber to polymer (E from 1 MPa to 1 GPa), rolling arm a",
                change,
                over(RUBBER, POLYMER, 1.0, None),
                0.05,
            ),
            at_most(
                f"the rig's preload of {preload:g} N, stiff bodies, rolling arm a",
                change,
                over(POLYMER, STEEL, 1.0, preload),
                0.05,
            ),
        ],
        "E of both bodies from 1 MPa to 200 GPa, ν from 0.3 to 0.5",
    )
