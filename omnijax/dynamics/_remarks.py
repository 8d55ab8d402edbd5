"""What speaks against prescribed wheel speeds, a sentence each; of known numbers alone."""

from typing import Any, NamedTuple

import numpy as np

from ..rig import Rig
from ._mobility import mobility, sliding

FITS = 1e-4  # of the fastest rim: what speeds written in five digits slide by


class Sliding(NamedTuple):
    """What prescribed speeds make the contacts slide by, one entry a wheel."""

    speed: np.ndarray  # m/s, the largest
    share: float  # the largest over the speed of the fastest rim

    @property
    def fits(self) -> bool:
        """Whether the speeds agree with a motion of the sphere, but for rounding."""
        return self.share <= FITS


def sliding_of(rig: Rig, speed: np.ndarray) -> Sliding:
    """How far wheel speeds (t, n) in rad/s are from any that fit each other."""
    slides = np.abs(sliding(rig, speed)).max(axis=0, initial=0.0)
    rim = np.abs(speed * np.asarray(rig.wheel_radius)).max(initial=0.0)
    return Sliding(slides, float(slides.max() / max(rim, 1e-300)))


def sliding_remarks(names: tuple[str, ...], slides: Sliding) -> list[str]:
    """What the sliding of the wheels `names` says against their speeds; empty where they fit."""
    if slides.fits:
        return []
    each = ", ".join(f"{n} {1e3 * x:.3g} mm/s" for n, x in zip(names, slides.speed, strict=True))
    return [
        "The speeds do not fit each other: no motion of the sphere agrees with them, and the "
        f"contacts slide by {each}. The nearest motion is taken; `omnijax check` says what fits, "
        "and --omega x,y,z (in Python `dynamics.fitting_speeds`) gives fitting speeds."
    ]


def driving_remarks(rig: Rig) -> list[str]:
    """Axes that three or more wheels leave undriven, or hardly drive; fewer cannot drive all."""
    if rig.size < 3:
        return []
    driven = mobility(rig)
    told = [
        f"no wheel drives the axis ({_components(axis)}): the sphere does not turn about it."
        for axis in driven.undriven()
    ]
    if len(driven.weak()):
        told.append(
            f"the wheels hardly drive the axis ({_components(driven.weak()[0])}): condition "
            f"{driven.condition:.4g}; small errors of the speeds turn the sphere fast about it."
        )
    return told


def _components(direction: Any) -> str:
    """The components of a direction, with zeros for rounding."""
    return ", ".join(f"{round(float(x), 6) + 0.0:.3g}" for x in direction)
