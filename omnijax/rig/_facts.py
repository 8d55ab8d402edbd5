"""What a rig is in a table: the numbers of bodies and wheels as people write them."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np
from jax.core import Tracer

from .._html import html_table
from .._programs import kept


class WheelFact(NamedTuple):
    """One number of each wheel: label, factor to the printed unit, that unit, and its value."""

    label: str
    factor: float
    unit: str
    of: Callable[[Any], Any]


FACTS = {
    "radius": WheelFact("radius r_b", 1e3, "mm", lambda w: w.radius),
    "rollers": WheelFact("rollers n", 1, "", lambda w: w.rollers),
    "roundness": WheelFact("roundness η (gap angle / pitch)", 1, "", lambda w: w.roundness),
    "gap_depth": WheelFact(
        "gap depth Δr_w", 1e3, "mm", lambda w: None
    ),  # of the sphere's radius too
    "contact_stiffness": WheelFact(
        "contact stiffness K", 1e-3, "kN/m", lambda w: w.contact.stiffness
    ),
    "contact_damping": WheelFact("contact damping C", 1, "N s/m", lambda w: w.contact.damping),
    "mount_stiffness": WheelFact("mount stiffness k", 1e-3, "kN/m", lambda w: w.mount.stiffness),
    "mount_damping": WheelFact("mount damping c", 1, "N s/m", lambda w: w.mount.damping),
    "closure_stiffness": WheelFact(
        "closure stiffness K'", 1e-3, "kN/m", lambda w: w.closure.stiffness
    ),
    "preload": WheelFact("preload N0", 1, "N", lambda w: w.closure.preload),
    "friction": WheelFact("friction μ", 1, "", lambda w: w.contact.friction),
}


def wheel_facts(rig: Any) -> dict[str, np.ndarray]:
    """`FACTS` of every wheel in SI, (n,) each."""
    depth = np.broadcast_to(np.asarray(derived(rig)[0]), rig.size)
    facts = {key: fact.of(rig.wheels) for key, fact in FACTS.items()} | {"gap_depth": depth}
    return {key: np.asarray(value) for key, value in facts.items()}


@kept
def derived(rig: Any) -> tuple[Any, Any]:
    """Gap depth of the wheels and the mass of the whole machine, by one program."""
    return rig.gaps.depth, rig.total_mass


def direction_angles(normal: Any, drive: Any) -> list[float]:
    """Zenith, azimuth and skew of a wheel in degrees, as a rig file may give them.

    The half turn is 180, never -180.
    """
    touch, drive = -np.asarray(normal), np.asarray(drive)
    zenith, azimuth = np.arccos(np.clip(touch[2], -1, 1)), np.arctan2(touch[1], touch[0])
    level = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    skew = np.arctan2(drive @ np.cross(level, touch), drive @ level)
    angles = (round(float(x), 9) + 0.0 for x in np.degrees([zenith, azimuth, skew]))
    return [180.0 if x == -180.0 else x for x in angles]


def rig_html(rig: Any) -> str:
    """The table of a rig: its wheels, one a column, and the bodies in the caption."""
    if any(isinstance(x, Tracer) for x in jax.tree.leaves(rig)):
        return html_table(f"a traced rig of {rig.size} wheels", [])
    wheels = rig.wheels
    rows: list[list[str]] = [["profile", *(profile.id for profile in rig.profiles), ""]]
    angles = [direction_angles(r, d) for r, d in zip(wheels.normal, wheels.drive, strict=True)]
    for i, name in enumerate(("zenith", "azimuth", "skew")):
        rows.append([name, *(f"{angle[i]:.4g}" for angle in angles), "°"])
    for key, values in wheel_facts(rig).items():
        label, factor, unit, _ = FACTS[key]
        rows.append([label, *(f"{factor * x:.6g}" for x in values), unit])
    return html_table(_bodies(rig), rows, ["wheel", *rig.names, "unit"])


def _bodies(rig: Any) -> str:
    sphere, inertia = rig.sphere, np.asarray(rig.sphere.inertia)
    kind = "3×3 inertia" if inertia.ndim else f"inertia {float(inertia):.4g} kg m²"
    said = [
        f"sphere: radius {float(sphere.radius):g} m, mass {float(sphere.mass):.4g} kg, {kind}",
        f"platform: mass {float(rig.platform.mass):.4g} kg; "
        f"the whole machine {float(derived(rig)[1]):.4g} kg",
    ]
    effects = [f"{placed.law.id} at {placed.place}" for placed in rig.effects]
    return "; ".join(said + ([f"effects: {', '.join(effects)}"] if effects else []))
