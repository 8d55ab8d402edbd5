"""What a sweep varies: any rig parameter of one number, and the quantities of its drive."""

from collections.abc import Mapping
from typing import Any

from .._errors import InputError, did_you_mean
from ..rig import (
    Rig,
    UnknownParameter,
    parameter_info,
    parameter_paths,
    read_parameter,
)
from ._axes import SweepAxis, read_axis
from ._evaluation import Drive, drive_quantities
from ._parameters import checked_parameters, joint_problems, may_vary, overlap_problems


def read_axes(rig: Rig, drive: Drive, vary: Mapping[str, Any]) -> list[SweepAxis]:
    """The axes that `vary` asks for, in SI units and checked against what `rig` allows."""
    problems, axes = [], []
    for path, given in vary.items():
        try:
            axes.append(_read(rig, drive, path, given))
        except InputError as error:
            problems += error.problems
    if not problems:
        problems = overlap_problems(rig, tuple(vary), drive_quantities(drive, rig.names))
    if not problems:
        own = [axis for axis in axes if axis.path not in drive_quantities(drive, rig.names)]
        ends = {p: (a.low, a.high) for a in own for p in checked_parameters(rig, [a.path])}
        problems = joint_problems(rig, ends)
    if problems:
        raise InputError(problems)
    return axes


def _read(rig: Rig, drive: Drive, path: str, given: Any) -> SweepAxis:
    quantities = drive_quantities(drive, rig.names)
    if path in quantities:
        return read_axis(path, given, quantities[path].unit)
    try:
        info = parameter_info(rig, path)
    except UnknownParameter:
        known = [info.path for info in parameter_paths(rig) if may_vary(rig, info)]
        hint = did_you_mean(path, [*known, *quantities])
        raise InputError(f"neither the rig nor its drive has a parameter `{path}`.{hint}") from None
    if not may_vary(rig, info):
        raise InputError(f"`{path}` is no single number (shape {info.shape}): it cannot be varied.")
    axis = read_axis(path, given, info.unit)
    if info.whole and axis.count is None:
        raise InputError(f"`{path}` takes whole numbers only: give a list, as in {path}=10,12,14.")
    levels = axis.levels() if info.whole and axis.count else (axis.low, axis.high)
    for value in levels:
        read_parameter(rig, path, float(value))
    return axis
