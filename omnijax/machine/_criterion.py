"""How the runs of a machine are compared: by the balance of accelerations or by free runs."""

import math

from ._axis import Axis
from ._base import AbstractMachine
from ._file import MachineFile


def one_inertia(machine: AbstractMachine) -> Axis | None:
    """The machine where it is an axis of one inertia: all its states are measured."""
    return machine if isinstance(machine, Axis) and machine.second_inertia is None else None


def criterion_of(
    file: MachineFile, memory: float, speed: bool = False, lost: bool = False, away: bool = False
) -> str:
    """`balance` or `free-run`: as the file states it, or what says something and needs no start.

    `memory` s are those after which a start is forgotten, `speed`: the speed alone was measured,
    `lost`: by what loses its sign, which no balance can undo, `away`: small errors grow for long.
    """
    if file.compare.criterion != "auto":
        return file.compare.criterion
    if one_inertia(file.machine) is None:
        return "free-run"
    if speed:
        return "free-run" if lost and math.isfinite(memory) else "balance"
    return "balance" if away or not math.isfinite(memory) else "free-run"
