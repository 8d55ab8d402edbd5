"""Values with units as people read them: 0.4 µm, 188 kN/m."""

import math

import numpy as np

_PREFIX = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_PREFIXED = {"m", "m/s", "N", "N m", "s", "N/m", "Pa", "Hz", "N s/m"}


def scaled(value: float, unit: str) -> tuple[float, str]:
    """(factor, unit) in which `value` reads well: 4e-7 m is 0.4 µm, so (1e6, "µm")."""
    unit = "" if unit == "1" else unit
    if value == 0 or not math.isfinite(value) or unit not in _PREFIXED:
        return 1.0, written(unit)
    digits = math.log10(abs(value)) + (1 if abs(value) < 1 else 0)  # 0.4 µm, but 188 kN/m
    power = int(np.clip(3 * math.floor(digits / 3), -9, 9))
    return 10.0**-power, _PREFIX[power] + written(unit)


def written(unit: str) -> str:
    """A unit as people write it: m/s² for m/s^2."""
    return "" if unit == "1" else unit.replace("^2", "²").replace("^3", "³")


def amount(value: float, unit: str) -> str:
    """A value with its unit, prefixed where that reads better."""
    factor, name = scaled(value, unit)
    return f"{value * factor:.4g} {name}".strip()


def estimate(value: float, sigma: float | None, unit: str) -> str:
    """A value with its 1-sigma and unit, "5.660 ± 0.002 µm"; as many places as the sigma shows."""
    if sigma is None or not 0 < sigma < math.inf or not math.isfinite(value):
        return amount(value, unit)
    factor, name = scaled(max(abs(value), sigma), unit)
    value, sigma = value * factor, sigma * factor
    if not 1e-4 < max(abs(value), sigma) < 1e6:
        return f"{value:.4g} ± {sigma:.2g} {name}".strip()
    places = max(0, 1 - math.floor(math.log10(sigma)))
    return f"{value:.{places}f} ± {sigma:.{places}f} {name}".strip()


def label(name: str, unit: str) -> str:
    """Text of an axis."""
    return f"{name} ({unit})" if unit else name
