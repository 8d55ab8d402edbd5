"""Machines drawn at random: size, layout, profile, motions, and parts within their tolerances."""

import dataclasses
from typing import Any

import numpy as np

from .. import plant

FINE = 2000.0  # Hz, at which the plant is sampled before the sensors
TOLERANCES = {"wheel.radius": ("r", 3e-4), "wheel.roundness": ("eta", 0.01),
              "wheel.inertia": ("Iw", 0.01), "sphere.inertia": ("I", 0.003)}  # fmt: skip
SCALED = ("M", "Ml", "m", "K", "C", "k", "c", "Kc", "N0")  # with the sphere's radius
BY_WHEEL = ("r", "eta", "Iw", "n")


@dataclasses.dataclass(frozen=True)
class Machine:
    """What the rig file states, what is true, and what the file calls uncertain."""

    stated: dict[str, Any]
    true: dict[str, Any]
    uncertainty: dict[str, float]

    @property
    def wheels(self) -> int:
        """How many."""
        return len(self.stated["K"])


def drawn_machine(rng: np.random.Generator, certain: tuple[str, ...] = ()) -> Machine:
    """A machine of 3 to 5 wheels; `certain` parts are never off, since a hidden effect is alike."""
    wheels = int(rng.choice([3, 4, 5], p=[0.6, 0.25, 0.15]))
    stated = plant.machine(rng, wheels)
    size = np.exp(rng.uniform(np.log(0.1), 0.0))  # spheres of 0.12 to 1.2 m
    for key in SCALED:
        stated[key] = stated[key] * size
    # a small sphere has larger wheels for its size
    stated |= {"R": 1.22 * size, "r": stated["r"] * np.sqrt(size) * rng.uniform(0.8, 1.25)}
    stated["I"] = stated["M"] * stated["R"] ** 2 * rng.uniform(0.4, 0.667)
    stated["Iw"] = stated["m"] * stated["r"] ** 2 * rng.uniform(0.4, 0.7)
    stated |= _layout(rng, stated)
    profile = rng.choice(["gated", "half", "wave", "pivot"], p=[0.45, 0.25, 0.15, 0.15])
    stated |= {word: float(profile == word) for word in ("half", "wave", "pivot")}
    if profile == "half":
        stated["eta"] *= rng.uniform(1.0, 2.0)
    stated = {k: v if np.ndim(v) else float(v) for k, v in stated.items()}
    true, uncertainty = plant.perturbed(rng, stated), dict(plant.SPREAD)
    if rng.random() < 0.4:
        for name, (key, sigma) in TOLERANCES.items():
            if name in certain:
                continue
            count = wheels if key in BY_WHEEL else 1
            off = np.exp(sigma * np.clip(rng.normal(size=count), -2, 2))
            true[key] = true[key] * (off if key in BY_WHEEL else off[0])
            uncertainty[name] = sigma
    return Machine(stated, true, uncertainty)


def _layout(rng: np.random.Generator, stated: dict[str, Any]) -> dict[str, np.ndarray]:
    """Normals and drives: as they are, skewed about the normals, or three at right angles."""
    layout = rng.choice(["along", "skewed", "orthogonal"], p=[0.35, 0.45, 0.2])
    normal, drive = stated["normal"], stated["drive"]
    if layout == "skewed":
        skew = rng.uniform(0.2, 0.7) * rng.choice([-1, 1])
        drive = np.cos(skew) * drive + np.sin(skew) * np.cross(normal, drive)
    elif layout == "orthogonal" and len(normal) == 3:
        normal = np.eye(3)
        drive = np.roll(normal, int(rng.choice([1, 2])), axis=1)
    return {"normal": normal, "drive": drive}


def arrays(rig: dict[str, Any]) -> dict[str, np.ndarray]:
    """A machine as arrays of the same shapes whatever was drawn."""
    each = np.ones(len(rig["K"]))
    return {k: np.asarray(v * each if k in BY_WHEEL else v, float) for k, v in rig.items()}


def drawn_motions(
    rng, stated: dict[str, Any], seconds: float, runs: int, steady: bool
) -> list[np.ndarray]:
    """Omega (samples, 3) of every run at `FINE` Hz: random turnings, or all the same steady one.

    Steady turns of two speeds would tell frictions apart.
    """
    peak = 0.55 * 1.22 / stated["R"]
    if steady:
        return [plant.spin_up(seconds, peak * rng.uniform(0.7, 1.2), FINE)] * runs
    return [plant.wander(rng, seconds, peak, FINE) for _ in range(runs)]


def drawn_force(rng, stated: dict[str, Any], samples: int) -> np.ndarray:
    """Force on the platform (samples, 3) N: three slow lines and a push of half a second."""
    t = np.arange(samples) / FINE
    force = np.zeros((samples, 3))
    for axis in range(3):
        f, start = rng.uniform(0.3, 6.0), rng.uniform(0.5, 3.0)
        force[:, axis] = np.sin(2 * np.pi * f * t) * rng.uniform(0.3, 1)
        inside = np.clip((t - start) / 0.5, 0, 1)
        force[:, axis] += rng.uniform(-1, 1) * np.sin(np.pi * inside) ** 2
    force *= np.clip((t - 0.3) / 0.2, 0, 1)[:, None]
    return force * 0.02 * stated["N0"]
