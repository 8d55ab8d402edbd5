"""Units of a log's channels: `deg`, `mA`, an encoder's `360/4096 deg`, `1/2000 rev`."""

import re

from ..rig import GRAVITIES, Quantity

NUMBER = r"(\d*\.?\d+(?:[eE][+-]?\d+)?)"
SHARE = re.compile(rf"\s*{NUMBER}\s*(?:/\s*{NUMBER})?\s*([^\d\s/].*?)\s*\Z")


def factor_of(said: str, si: str) -> float:
    """One unit `said` in the SI unit `si`; `ValueError` where it is no unit of that.

    `g` of an acceleration is standard gravity.
    """
    match = SHARE.match(said)
    number, unit = (1.0, said.strip()) if match is None else (_ratio(match), match[3])
    if si == "m/s^2" and unit in GRAVITIES:  # of mass else
        return number * GRAVITIES[unit]
    return number if unit == si else number * Quantity(si).read(f"1 {unit.replace('°', 'deg')}")


def _ratio(match: re.Match) -> float:
    """The number before a unit, or the quotient of two."""
    below = float(match[2] or 1.0)
    if below == 0:
        raise ValueError("must not be divided by zero.")
    return float(match[1]) / below
