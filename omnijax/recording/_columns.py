"""The columns of a recording: their names, their groups and their SI units."""

import re

AXES = ("x", "y", "z")
UNITS = {
    "t": "s",
    "torque": "N m",
    "force": "N",
    "dR": "m",
    "theta": "rad",
    "Omega": "rad/s",
    "a": "m/s^2",
}
INPUTS = ("torque", "force")
OUTPUTS = ("dR", "theta", "Omega", "a")
PER_WHEEL = ("torque", "theta")  # numbered from 1; the other groups have axes x, y, z


def channels(group: str, wheels: int) -> tuple[str, ...]:
    """Column names of one group: `channels("dR", 3)` is dR_x, dR_y, dR_z."""
    ends = (str(i + 1) for i in range(wheels)) if group in PER_WHEEL else AXES
    return tuple(f"{group}_{end}" for end in ends)


def columns(wheels: int) -> tuple[str, ...]:
    """Every column that a recording of a rig with this many wheels may have, in file order."""
    return ("t", *(c for group in (*INPUTS, *OUTPUTS) for c in channels(group, wheels)))


def group_of(column: str) -> str:
    """Group of a column: `group_of("dR_z")` is dR; a group is its own."""
    return column if column in UNITS else column.rsplit("_", 1)[0]


def is_column(name: str) -> bool:
    """Whether `name` is a group, or a column that the recording of some rig may have."""
    group, _, end = name.rpartition("_")
    if group in PER_WHEEL:
        return re.fullmatch(r"[1-9]\d*", end) is not None
    return name in UNITS or (group in UNITS and group != "t" and end in AXES)


def unit_of(column: str) -> str:
    """SI unit of a column or group."""
    return UNITS[group_of(column)]


def count_wheels(names) -> int:
    """Number of wheels that the columns `names` speak of: the highest number of a torque."""
    matches = (re.fullmatch(r"torque_(\d+)", name) for name in names)
    return max((int(m.group(1)) for m in matches if m), default=0)
