"""The claim that rolling and spin resistance are negligible, over materials and normal forces."""

import jax.numpy as jnp
import numpy as np

from ..dynamics import RotationMoment, minimum_normal_force, rolling_torques, turned
from ..laws import HertzResistance, effective_modulus, effective_radius
from ..rig import Rig, acting
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
    wheels, torque, zero = rig.wheels, jnp.asarray(TORQUE), jnp.zeros(rig.size)
    free, force = _turning(rig, torque, jnp.zeros(3))
    least = minimum_normal_force(jnp.asarray(force), wheels.contact.friction)
    law = HertzResistance(
        jnp.asarray(effective_radius(rig.sphere.radius, wheels.radius[0])),
        jnp.asarray(effective_modulus(modulus, ratio, modulus, ratio)),
        jnp.asarray(arm_ratio),
        jnp.asarray(1e-6),
    )
    at = RotationMoment(
        wheels.spin_axis, jnp.eye(3), jnp.asarray(free / np.linalg.norm(free)), zero, zero, torque,
        torque, least if preload is None else zero + preload,
    )  # fmt: skip
    (resisting,) = acting(rig.add(law, "all").at("rolling"), rig.size)
    resisted, _ = rolling_torques(rig, resisting, at)
    slowed, _ = _turning(rig, torque + resisted.shaft, resisted.opposing)
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
