"""Units of a log's channels: said, likely, or left out; and columns in SI."""

import numpy as np

from ...recording import usual_step
from .._axis import INPUTS
from .._log import MEASURED
from .._unit_of_channel import factor_of

ALIKE = 4.0  # sizes of a goal and of what follows it, one over the other, in one unit
LONGEST = 0.2  # s, of a step; one that is longer is in a smaller unit
SMALLER = ("ms", "us", "ns")


def output_unit(motion: str, measured: str) -> str:
    """SI unit of a position or velocity."""
    unit = "m" if motion == "translation" else "rad"
    return unit if measured == "position" else f"{unit}/s"


def input_unit(motion: str, drives: str) -> str:
    """SI unit of a guessed input."""
    return INPUTS[drives][motion == "translation"]


def is_unit(said: str | None, si: str) -> bool:
    """Whether a text is a unit of the quantity whose SI unit is `si`."""
    try:
        return said is not None and factor_of(said, si) > 0
    except ValueError:
        return False


def motion_of(units: dict[str, str], measured: str, drives: str) -> str:
    """The motion that units tell: of what is `measured`, or where it has none of a force."""
    said = units.get(measured)
    if said is None and drives == "torque":
        known, unit = units.get("input"), input_unit("translation", drives)
    else:
        known, unit = said, output_unit("translation", measured)
    return "translation" if is_unit(known, unit) else "rotation"


def in_si(values, unit: str | None, si: str) -> np.ndarray:
    """A channel (t,) in SI, as a log of these units is read."""
    values = np.asarray(values, float)
    return values if unit is None else values * factor_of(unit, si)


def fitting(units: dict[str, str], motion: str, drives: str) -> dict[str, str]:
    """Only units of the quantity that a channel has."""
    wanted = {k: output_unit(motion, k) for k in MEASURED}
    wanted |= {"t": "s", "input": input_unit(motion, drives)}
    return {k: u for k, u in units.items() if is_unit(u, wanted[k])}


def with_unit_of_both(units: dict[str, str], goal, position) -> dict[str, str]:
    """Units with that of a goal or position for the other one too, where only one has any.

    A controller compares them as they are; so where their sizes are alike, their units are.
    """
    known = {units[k] for k in ("input", "position") if k in units}
    sizes = np.nanstd(np.asarray(goal, float)), np.nanstd(np.asarray(position, float))
    if len(known) == 1 and max(sizes) < ALIKE * min(sizes):
        units = units | dict.fromkeys(("input", "position"), known.pop())
    return units


def step_of(column, units: dict[str, str]) -> tuple[float, dict[str, str]]:
    """Usual step of a column of times, s, and the units with that of the time.

    It is milli-, micro- or nanoseconds where none is said and steps would be long.
    """
    t = np.asarray(column, float)
    t = t * (factor_of(units["t"], "s") if "t" in units else 1.0)
    steps = np.diff(t)
    step = usual_step(steps[steps > 0])
    for unit in SMALLER if "t" not in units else ():
        if step > LONGEST:
            step, units = step / 1000, units | {"t": unit}
    return step, units
