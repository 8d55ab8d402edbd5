"""What sensors and loggers do to the outputs: colour, steps, wander, clocks, noise."""

from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from .. import plant
from .machines import FINE

GROUPS = ("dR", "theta", "Omega", "a")
BETWEEN = 8  # points between two samples at FINE, where a smooth reading is lagged
TURNING = 1300  # seed from which Omega and theta wander, are low-passed and drift too
ANEW = 1316  # seed from which loggers may be started anew for every run
FAULTS = ("low-pass", "quantised", "wander", "clock")


def columns_of(group: str, wheels: int) -> list[int]:
    """Columns of a group in the plant's outputs."""
    names = plant.columns(wheels)
    return [j for j, name in enumerate(names) if name.split("_")[0] == group]


def shifted(out: np.ndarray, columns: list[int], delay: float) -> np.ndarray:
    """`columns` of `out` (samples at FINE, ..) read `delay` s late, before the start the first.

    Those of a plant that runs away stay as they are.
    """
    if not np.all(np.isfinite(out[:, columns])):
        return out
    t = np.arange(len(out)) / FINE
    late = out.copy()
    late[:, columns] = CubicSpline(t, out[:, columns])(np.clip(t - delay, 0, t[-1]))
    return late


def lagged(values: np.ndarray, tau: float) -> np.ndarray:
    """First-order low pass of `values` (samples at FINE, ..), linear between samples."""
    return _low_passed(values, 1 / (FINE * tau))


def smoothly_lagged(values: np.ndarray, tau: float) -> np.ndarray:
    """The same of what is smooth between samples.

    As if linear, a lag of 2 ms would lose 0.2 % of what it changes in an acceleration of 30 Hz.
    """
    if not np.all(np.isfinite(values)):
        return values
    t = np.arange(len(values)) / FINE
    between = np.arange((len(values) - 1) * BETWEEN + 1) / (FINE * BETWEEN)
    fine = CubicSpline(t, values)(between)
    return _low_passed(fine, 1 / (FINE * BETWEEN * tau))[::BETWEEN]


def _low_passed(values: np.ndarray, step: float) -> np.ndarray:
    """Response from rest to what is linear between samples, `step` time constants apart."""
    keep = np.exp(-step)
    share = (1 - keep) / step
    weights = [1 - share, share - keep], [1.0, -keep]
    return lfilter(*weights, values, axis=0, zi=share * values[:1])[0]


def of_all_groups(seed: int) -> bool:
    """Whether a seed draws drifts and noise of a colour in all groups, or in dR and a alone."""
    return seed < 100 or seed >= TURNING


def started_anew(seed: int) -> bool:
    """Whether a seed draws clocks that are off by another time in every run."""
    return seed < 100 or seed >= ANEW


def drawn_noise(
    rng: np.random.Generator, wheels: int, everywhere: bool, anew: int = 0
) -> dict[str, Any]:
    """True 1-sigma by column, what is declared, and at most one further fault of a sensor.

    Noise has a colour in every group where `everywhere`, else in dR and a.  A clock may be off by
    another time in each of `anew` runs; 0: it is off by one in all.
    """
    names = plant.columns(wheels)
    scale = {g: np.exp(rng.uniform(np.log(0.6), np.log(1.6))) for g in GROUPS}
    sigma = {c: plant.NOISE[c.split("_")[0]] * scale[c.split("_")[0]] for c in names}
    declared = {g: plant.NOISE[g] * scale[g] for g in GROUPS}
    how = str(rng.choice(["right", "factor", "none", "axis"], p=[0.3, 0.3, 0.2, 0.2]))
    if how == "factor":
        factor = np.exp(rng.uniform(np.log(0.7), np.log(2.0), size=4))
        declared = {g: s * f for (g, s), f in zip(declared.items(), factor, strict=True)}
    if how == "none":
        declared = {}
    if how == "axis":
        noisy = str(rng.choice(names))
        sigma[noisy] *= rng.uniform(1.5, 3.0)
    drawn: dict[str, Any] = {"how": how, "sigma": sigma, "declared": declared, "fault": "none"}
    if rng.random() < 0.4:
        drawn |= _drawn_fault(rng, wheels, everywhere, anew)
    return drawn


def _drawn_fault(rng, wheels: int, everywhere: bool, anew: int) -> dict[str, Any]:
    fault = str(rng.choice(FAULTS))
    if fault == "low-pass":
        groups = ["a", "dR", "Omega", "theta"] if everywhere else ["a", "dR"]
        return {"fault": fault, "at": str(rng.choice(groups)), "size": rng.uniform(1, 6)}
    if fault == "quantised":
        at = str(rng.choice(["theta", "dR", "a"], p=[0.5, 0.25, 0.25]))
        if at == "theta":
            return {"fault": fault, "at": at, "size": 2 * np.pi / 2 ** rng.integers(14, 17)}
        return {"fault": fault, "at": at, "size": plant.NOISE[at] * rng.uniform(0.5, 3)}
    if fault == "wander":
        if everywhere and rng.random() < 0.5:  # a gyro's axes wander together
            at = str(rng.choice(["Omega", "theta"]))
            return {"fault": fault, "at": at, "size": rng.uniform(0.5, 3)}
        names = [c for c in plant.columns(wheels) if everywhere or c[0] in "da"]
        return {"fault": fault, "at": str(rng.choice(names)), "size": rng.uniform(0.5, 3)}
    each = anew if anew and rng.random() < 0.5 else None
    groups = ["dR", "a"] if each is None else ["dR", "Omega", "a"]
    return {"fault": fault, "at": str(rng.choice(groups)), "size": rng.uniform(-8e-4, 8e-4, each)}


def noisy(rng, out: np.ndarray, drawn: dict[str, Any], wheels: int) -> np.ndarray:
    """Outputs at the recording's rate with noise as `drawn`."""
    names, out = plant.columns(wheels), out.copy()
    for j, name in enumerate(names):
        white = rng.normal(size=len(out))
        here = drawn["fault"] != "none" and drawn["at"] in (name, name.split("_")[0])
        if here and drawn["fault"] == "low-pass":
            keep = np.exp(-1 / drawn["size"])
            white = lfilter([np.sqrt(1 - keep**2)], [1, -keep], white)
        if here and drawn["fault"] == "wander":
            walk = np.cumsum(rng.normal(size=len(out)))
            white = white + drawn["size"] * walk / np.sqrt(len(out))
        out[:, j] += drawn["sigma"][name] * white
        if here and drawn["fault"] == "quantised":
            out[:, j] = drawn["size"] * np.round(out[:, j] / drawn["size"])
    return out
