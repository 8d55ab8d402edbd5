"""The sliders of the explore page: which parameters, over which range, in which unit."""

import math
from typing import NamedTuple

import numpy as np

from .._text import path_words, scaled
from ..rig import Rig, get_parameter, parameter_info, parameter_paths

RPM = 30 / math.pi  # in one rad/s


class Slider(NamedTuple):
    """One slider; `path` is a parameter path of the rig, or `speed.NAME`.

    `value`, `low` and `high` are SI; a page shows `factor` times them in `unit`.
    """

    path: str
    label: str
    unit: str
    value: float
    low: float
    high: float
    log: bool = False
    whole: bool = False
    factor: float = 1.0


_LOG = (
    ("contact.stiffness", "contact stiffness K", "N/m"),
    ("contact.damping", "contact damping C", "N s/m"),
    ("mount.stiffness", "mount stiffness k", "N/m"),
    ("mount.damping", "mount damping c", "N s/m"),
    ("closure.preload", "preload N₀", "N"),
)


def sliders(rig: Rig, speeds: list[float]) -> list[Slider]:
    """Sliders for all wheels together, at the mean of unequal wheels, and one a wheel's speed."""
    out = [
        Slider("wheel.roundness", "roundness η", "", _mean(rig, "wheel.roundness"), 0.0, 1.0),
    ]
    if "wheel.rollers" in {info.path for info in parameter_paths(rig)}:
        out.append(_rollers(rig))
    for path, label, unit in _LOG:
        value = _mean(rig, path)
        middle = value if value > 0 else 1.0
        low, high = max(middle / 100, parameter_info(rig, path).low), middle * 100
        value = max(value, low)
        factor, shown = scaled(value, unit)
        out.append(Slider(path, label, shown, value, low, high, log=True, factor=factor))
    top = max(3.0, 3 * max(map(abs, speeds)))
    for name, speed in zip(rig.names, speeds, strict=True):
        path = f"speed.{name}"
        out.append(Slider(path, path_words(path), "rpm", speed, -top, top, factor=RPM))
    return out


def _rollers(rig: Rig) -> Slider:
    value = float(round(_mean(rig, "wheel.rollers")))
    return Slider("wheel.rollers", "rollers", "", value, 4.0, max(40.0, value), whole=True)


def _mean(rig: Rig, path: str) -> float:
    values = np.asarray(get_parameter(rig, path))
    if np.all(values > 0):
        return float(math.exp(np.log(values).mean()))
    return float(values.mean())
