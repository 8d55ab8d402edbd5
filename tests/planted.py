"""Rigs and effects drawn at random, for the package and, in its own words, for the plant."""

from collections.abc import Callable, Collection
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from omnijax import laws
from omnijax.rig import Closure, Contact, Mount, Platform, Rig, Sphere, Wheels

PROFILES = {
    "gated": laws.GatedSine(), "half": laws.HalfSine(), "wave": laws.ContinuousSine(),
    "pivot": laws.Rollers(),
}  # fmt: skip
W0 = 0.6  # rad/s, width of all friction at the shafts


class Planted(NamedTuple):
    """One effect: where it may be, its parameters at random, how it is off, the plant's words.

    `words(values, mask, n)` gives the plant's entries for the wheels of `mask` (n,).
    """

    everywhere: bool  # else at one wheel
    draw: Callable[[np.random.Generator], dict[str, Any]]
    words: Callable[[dict[str, Any], np.ndarray], dict[str, Any]]
    off: dict[str, Any]


def _one(key: str, word: str, low: float, high: float, everywhere: bool = True) -> Planted:
    """An effect of one size."""
    return Planted(
        everywhere,
        lambda rng: {key: rng.uniform(low, high)},
        lambda v, mask: {word: v[key] * mask},
        {key: 0.0},
    )


def _with(sized: Planted, more: Callable, words: Callable) -> Planted:
    """`sized` with further parameters, and the plant's words for them."""
    return Planted(
        sized.everywhere,
        lambda rng: sized.draw(rng) | more(rng),
        lambda v, mask: sized.words(v, mask) | words(v, mask),
        sized.off,
    )


def _wave(key: str, word: str, low: float, high: float) -> Planted:
    """A line of an order of one wheel."""
    return _with(
        _one(key, word, low, high, False),
        lambda rng: {"order": rng.uniform(1, 9), "phase": rng.uniform(0, 6)},
        lambda v, mask: {f"{word}_order": v["order"] * mask, f"{word}_phase": v["phase"] * mask},
    )


def _dry(key: str, word: str, low: float, high: float) -> Planted:
    """Friction at the shafts, whose width is the plant's for all of them."""
    sized = _one(key, word, low, high)
    return _with(sized, lambda rng: {"width": W0}, lambda v, mask: {"w0": W0})


def _unit(vector):
    return np.asarray(vector) / np.linalg.norm(vector)


EFFECTS: dict[str, Planted] = {
    "wheel-runout": _with(
        _one("amplitude", "runout", 5e-5, 2e-4, False),
        lambda rng: {"phase": rng.uniform(0, 6)},
        lambda v, mask: {"runout_phase": v["phase"] * mask},
    ),
    "damaged-roller": _with(
        _one("severity", "severity", 0.3, 1.0, False),
        lambda rng: {"roller": 0.0},  # the gap of each wheel that this run reaches: see `start`
        lambda v, mask: {"roller": np.where(mask > 0, v["roller"], -1.0)},
    ),
    "sphere-out-of-round": Planted(
        False,
        lambda rng: {"amplitude": rng.uniform(1e-4, 4e-4), "axis": rng.normal(size=3)},
        lambda v, mask: {"round": v["amplitude"], "round_axis": v["axis"]},
        {"amplitude": 0.0},
    ),
    "contact-cubic": _one("K3", "K3", 1e11, 4e11),
    "contact-hertz": Planted(
        True,
        lambda rng: {"exponent": rng.uniform(1.3, 2.2)},
        lambda v, mask: {"power": v["exponent"]},
        {"exponent": 1.0},  # the linear law, but that it does not pull
    ),
    "contact-relaxation": _with(
        _one("K1", "K1", 1e4, 6e4),
        lambda rng: {"tau": rng.uniform(5e-3, 0.03)},
        lambda v, mask: {"tau": v["tau"] + 0 * mask},
    ),
    "lift-off": Planted(True, lambda rng: {}, lambda v, mask: {"lift": mask}, {}),
    "mount-cubic": _one("k3", "k3", 1e13, 4e13),
    "mount-backlash": _one("gap", "backlash", 5e-6, 2e-5),
    "mount-friction": _with(
        _one("force", "dry", 2.0, 8.0),
        lambda rng: {"width": rng.uniform(2e-3, 6e-3)},
        lambda v, mask: {"v0": v["width"]},
    ),
    "bearing-coulomb": _dry("torque", "coulomb", 0.2, 0.8),
    "bearing-viscous": _one("b", "viscous", 0.01, 0.1),
    "motor-ripple": _wave("amplitude", "ripple", 0.3, 1.0),
    "motor-gain": _one("g", "gain", -0.2, -0.05, False),
    "rolling-resistance": _with(
        _one("arm", "arm", 3e-4, 2e-3),
        lambda rng: {"width": 0.05},
        lambda v, mask: {"arm": v["arm"], "eps": 0.05},
    ),
    "spin-resistance": _with(
        _one("lever", "lever", 3e-4, 2e-3),
        lambda rng: {"width": 0.05},
        lambda v, mask: {"lever": v["lever"], "eps": 0.05},
    ),
    "air-drag": _with(
        _one("D", "drag", 1.0, 4.0, False), lambda rng: {}, lambda v, mask: {"drag": v["D"]}
    ),
    "unbalance": Planted(
        False,
        lambda rng: {"offset": 0.03 * rng.normal(size=3)},
        lambda v, mask: {"offset": v["offset"]},
        {"offset": np.zeros(3)},
    ),
    "floor-vibration": Planted(
        False,
        lambda rng: {
            "amplitude": rng.uniform(2, 6), "frequency": rng.uniform(10, 40),
            "phase": rng.uniform(0, 6), "direction": rng.normal(size=3),
        },
        lambda v, mask: {
            "floor": v["amplitude"], "floor_f": v["frequency"], "floor_phase": v["phase"],
            "floor_d": _unit(v["direction"]),
        },
        {"amplitude": 0.0},
    ),
    "creep": _one("creepage", "creep", 0.02, 0.1, False),
    "wheel-radius": _one("s", "radius", -0.05, -0.01),
    "torque-offset": _one("torque", "bias", 0.3, 1.0, False),
    "actuator-delay": _one("delay", "delay", 5e-3, 2e-2),
    "actuator-lag": Planted(
        True,
        lambda rng: {"tau": rng.uniform(5e-3, 2e-2)},
        lambda v, mask: {"lag": v["tau"] * mask},
        {"tau": 0.04},  # a lag of zero would be another law: there is always one
    ),
    "current-ripple": _wave("g", "current", 0.1, 0.4),
    "actuator-saturation": Planted(
        True,
        lambda rng: {"limit": rng.uniform(1.0, 2.0)},
        lambda v, mask: {"limit": v["limit"] + 0 * mask},
        {"limit": 1e9},
    ),
    "cogging": Planted(
        False,
        lambda rng: {
            "amplitudes": rng.uniform(0.3, 1, 2), "orders": rng.uniform(1, 9, 2),
            "phases": rng.uniform(0, 6, 2),
        },
        lambda v, mask: {
            "cog": np.outer(mask, v["amplitudes"]), "cog_order": np.outer(mask, v["orders"]),
            "cog_phase": np.outer(mask, v["phases"]),
        },
        {"amplitudes": np.zeros(2)},
    ),
    "stribeck": _with(
        _dry("torque", "stribeck", 0.3, 1.0),
        lambda rng: {"speed": rng.uniform(3, 8)},
        lambda v, mask: {"stribeck_speed": v["speed"] + 0 * mask},
    ),
    "load-friction": _dry("mu", "load", 0.05, 0.2),
    "friction-asymmetry": _dry("torque", "asymmetry", 0.2, 0.8),
}  # fmt: skip
BODIES = {"sphere-out-of-round", "air-drag", "unbalance"}


def place_of(name: str, wheel: int) -> str:
    """Where the effect is in these rigs: `wheel` is the index of the one wheel."""
    if name in BODIES:
        return "sphere"
    if name == "floor-vibration":
        return "platform"
    return "all" if EFFECTS[name].everywhere else f"w{wheel + 1}"


class Machine(NamedTuple):
    """A machine without effects, twice, and how a run of it starts."""

    rig: Rig
    plant: dict[str, Any]
    angle: np.ndarray  # rad
    kinds: tuple[str, ...]  # of the wheels' profiles


def drawn_machine(rng, kinds: tuple[str, ...], gaps: bool = True, light: bool = False) -> Machine:
    """Unlike wheels around the sphere, each at its own tilt; `gaps` or round wheels.

    `light` contacts lift off.
    """
    n = len(kinds)
    around = 2 * np.pi * (np.arange(n) + rng.uniform(-0.2, 0.2, n)) / n
    tilt, skew = rng.uniform(0.4, 0.9, n), rng.uniform(-0.5, 0.5, n)
    normal = np.stack(
        [-np.cos(around) * np.cos(tilt), -np.sin(around) * np.cos(tilt), np.sin(tilt)], 1
    )
    along = np.stack([-np.sin(around), np.cos(around), np.zeros(n)], 1)
    across = np.cross(normal, along)
    drive = np.cos(skew)[:, None] * along + np.sin(skew)[:, None] * across
    plant = {
        "R": rng.uniform(0.1, 1.5), "M": rng.uniform(5, 20), "Ml": rng.uniform(5, 30),
        "g": rng.normal(0, 1, 3) - 9.8 * np.eye(3)[2], "normal": normal, "drive": drive,
        "m": rng.uniform(0.3, 0.9, n), "Iw": rng.uniform(1e-3, 3e-3, n),
        "n": rng.integers(8, 20, n).astype(float),
        "eta": rng.uniform(0.15, 0.45, n) if gaps else np.full(n, 1e-6),
        "K": rng.uniform(1e5, 3e5, n), "C": rng.uniform(100, 400, n),
        "k": rng.uniform(4e5, 1.5e6, n), "c": rng.uniform(50, 180, n),
        "Kc": rng.uniform(1e4, 4e4, n), "N0": rng.uniform(1e3, 2e3, n) * (0.02 if light else 1),
        "mu": rng.uniform(0.5, 0.9, n),
    }  # fmt: skip
    plant["r"] = plant["R"] * rng.uniform(0.05, 0.4, n)
    plant["I"] = plant["M"] * plant["R"] ** 2 * rng.uniform(0.4, 0.66)
    for word in ("half", "wave", "pivot"):
        plant[word] = np.array([float(kind == word) for kind in kinds])
    angle = rng.uniform(0, 6, n)
    return Machine(rig_of(plant, kinds), plant, angle, kinds)


def rig_of(plant: dict[str, Any], kinds: tuple[str, ...]) -> Rig:
    """The package's words for a machine of the plant."""
    p = {key: jnp.asarray(value, float) for key, value in plant.items()}
    wheels = Wheels(
        p["normal"], p["drive"], p["r"], p["m"], p["Iw"], p["n"], p["eta"],
        Contact(p["K"], p["C"], p["mu"]), Mount(p["k"], p["c"]), Closure(p["Kc"], p["N0"]),
    )  # fmt: skip
    names = tuple(f"w{i + 1}" for i in range(len(kinds)))
    profiles = tuple(PROFILES[kind] for kind in kinds)
    return Rig(
        Sphere(p["R"], p["M"], p["I"], jnp.zeros(3)), Platform(p["Ml"], p["g"]), wheels, profiles,
        (), names,
    )  # fmt: skip


ALWAYS = ("contact-hertz", "actuator-lag")  # as both machines know them off: see the table


def placed(
    machine: Machine, values: dict[str, dict[str, Any]], wheel: int, among: Collection[str]
) -> Rig:
    """The machine with the effects `among`: those of `values` on, the others off."""
    rig, any_size = machine.rig, np.random.default_rng(0)
    for name, effect in EFFECTS.items():
        if name not in {*among, *ALWAYS}:
            continue
        given = values.get(name, effect.draw(any_size) | effect.off)
        law = laws.EFFECTS[name](**{key: jnp.asarray(v, float) for key, v in given.items()})
        rig = rig.add(law, place_of(name, wheel))
    return rig


def in_plants_words(nothing: dict, values: dict[str, dict[str, Any]], n: int, wheel: int) -> dict:
    """The plant's effects for the same, `nothing` being those of a machine without any."""
    words = nothing | EFFECTS["actuator-lag"].words(EFFECTS["actuator-lag"].off, np.ones(n))
    words = words | {"w0": W0, "eps": 0.05, "hertz": np.ones(n), "power": 1.0}
    for name, given in values.items():
        effect = EFFECTS[name]
        mask = np.ones(n) if effect.everywhere else (np.arange(n) == wheel).astype(float)
        words = words | effect.words(given, mask)
    return {key: np.asarray(value, float) for key, value in words.items()}
