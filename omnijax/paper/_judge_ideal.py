"""The claims on the ideal case and on the rigid part."""

import jax.numpy as jnp
import numpy as np

from ..vibration import norm
from ._case import TORQUE, baseline
from ._claim import Claim, at_least, at_most
from ._ideal import angle_residual, line_residual, parabola_residual, time_sinusoid_residual
from ._study import PaperStudy

INERTIAS = "I_s from 2/5 to 2/3 M R², I_w from 2e-4 to 2e-3 kg m²"


def ideal_claims(study: PaperStudy) -> list[Claim]:
    """Linear velocity, parabolic path, sinusoidal attitude, no coupling."""
    ideal, t = study.ideal, study.ideal.t
    runs = range(len(ideal.run.Omega))
    velocity = [line_residual(t, ideal.run.Omega[k]) for k in runs]
    path = [parabola_residual(t, ideal.run.R_l[k]) for k in runs]
    angle = [angle_residual(t, ideal.run.Omega[k], ideal.run.attitude[k]) for k in runs]
    sinusoid = [time_sinusoid_residual(t, ideal.run.attitude[k]) for k in runs]
    end = {
        f"Omega_{a} at 8 s / rad/s": float(v)
        for a, v in zip("xyz", ideal.run.Omega[0, -1], strict=True)
    }
    return [
        Claim(
            "linear-velocity",
            "Ideal case: the sphere's angular velocity grows linearly in time.",
            "fig07",
            [at_most("under constant torques", "largest deviation from a line", velocity, 1e-6)],
            INERTIAS,
            end,
        ),
        Claim(
            "parabolic-path",
            "Ideal case: the platform's position R_l is a parabola in time.",
            "fig08",
            [
                at_most(
                    "under a constant force, contacts elastic, reactions included",
                    "largest deviation from a parabola over the range",
                    path,
                    1e-3,
                )
            ],
            INERTIAS,
            {"R_l at 8 s / m": [float(x) for x in ideal.run.R_l[0, -1]]},
        ),
        Claim(
            "sinusoidal-quaternion",
            "Ideal case: the components of the quaternion are sinusoidal.",
            "fig09",
            [
                at_most(
                    "sinusoids of half the turn angle, which grows as t²",
                    "largest deviation",
                    angle,
                    1e-6,
                ),
                at_most("sinusoids of time with one frequency", "RMS left over", sinusoid, 0.05),
            ],
            INERTIAS,
        ),
        _coupling(study),
    ]


def _coupling(study: PaperStudy) -> Claim:
    ideal = study.ideal
    run, span = ideal.run, np.max(np.abs(ideal.run.R_l[0]))
    path = np.max(np.abs(ideal.no_torque.R_l - run.R_l[0])) / span
    turn = np.max(np.abs(ideal.no_force.Omega - run.Omega[0])) / np.max(np.abs(run.Omega[0]))
    axes = np.asarray(study.rig.wheels.spin_axis)
    return Claim(
        "no-coupling",
        "Ideal case: rotation and translation, and the three axes, do not couple.",
        "fig07, fig08",
        [
            at_most(
                "the path without the torques, the rotation without the force",
                "largest relative change",
                [path, turn],
                1e-3,
            ),
            at_most(
                "one motor turns one axis alone, wheels' axes orthogonal",
                "rotation about the other axes over that about its own",
                _cross(axes, study.rig, study),
                1e-9,
            ),
            at_most(
                "one motor turns one axis alone, wheels' axes 120° apart on a tripod",
                "rotation about the other axes over that about its own",
                _cross(np.asarray(baseline("atlas-tripod").wheels.spin_axis), study.rig, study),
                1e-9,
            ),
        ],
        INERTIAS,
        {
            "Omega from the second motor alone / rad/s": [
                float(x) for x in ideal.one_torque.Omega[-1]
            ]
        },
    )


def _cross(axes, rig, study: PaperStudy) -> list[float]:
    """Share of dOmega/dt off the torque's axis, one torque at a time, by sample of the inertias."""
    from ..dynamics import turned

    shares = []
    wheels, R, rows = rig.wheels, rig.sphere.radius, jnp.asarray(axes)
    inertias = zip(study.samples["sphere.inertia"], study.samples["wheel.inertia"], strict=True)
    for I_s, I_w in inertias:
        inertia, spin = I_s * jnp.eye(3), jnp.full(3, I_w)
        for i in range(3):
            torque = TORQUE[i] * jnp.eye(3)[i]
            turning = np.asarray(
                turned(rows, wheels.radius, R, spin, inertia, torque, jnp.zeros(3))[1]
            )
            along = axes[i] @ turning
            shares.append(float(np.linalg.norm(turning - along * axes[i]) / abs(along)))
    return shares


def rigid_claim(study: PaperStudy) -> Claim:
    """The rigid part is as large as the wheel is out of round."""
    depth = np.asarray(study.rig.gaps.depth)[0]
    peak = float(np.max(norm(study.elastic[0.0].cycle.rigid)))
    radius = float(study.rig.wheels.radius[0])
    return Claim(
        "rigid-size",
        "Rigid case: ΔR is of the size by which the wheel is out of round.",
        "fig10",
        [
            at_least("at least one wheel's depth Δr_w", "peak |ΔR| / Δr_w", peak / depth, 1.0),
            at_most(
                "at most all three depths at right angles, √3 Δr_w",
                "peak |ΔR| / Δr_w",
                peak / depth,
                float(np.sqrt(3)) * (1 + 1e-9),
            ),
        ],
        "geometry alone: no parameter that is not given enters",
        {
            "depth Δr_w / m": float(depth),
            "bound √3 Δr_w / m": float(np.sqrt(3) * depth),
            "peak |ΔR| of the cycle / m": peak,
            "Δr_w / r_b": float(depth / radius),
        },
    )
