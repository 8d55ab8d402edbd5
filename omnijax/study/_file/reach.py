"""How far the parameters of a study reach: its variables, its loads, and tolerances of both."""

from collections.abc import Sequence

from ..._errors import InputError
from ..._text import quantity_text
from ...rig import Rig, get_parameter, parameter_info, read_parameter
from .._parameters import checked_parameters, part_problems
from .._problem import Variable
from .study import Load

Reach = dict[str, tuple[float, float]]  # path of one number -> lowest and highest value


def reach(rig: Rig, variables: Sequence[Variable], loads: Sequence[Load]) -> Reach:
    """What variables and loads make of the rig's parameters; those that neither sets stay out."""
    reached: Reach = {}
    for variable in variables:
        for path in checked_parameters(rig, [variable.name]):
            reached[path] = (variable.low, variable.high)
    of_loads = [
        {path: value for key, value in load.values for path in checked_parameters(rig, [key])}
        for load in loads
    ]
    for path in dict.fromkeys(path for values in of_loads for path in values):
        own = float(get_parameter(rig, path))
        values = [of_load.get(path, own) for of_load in of_loads]
        reached[path] = (min(values), max(values))
    return reached


def tolerance_problems(
    rig: Rig, tolerances: Sequence[tuple[str, float]], reached: Reach
) -> list[str]:
    """Tolerances that mean nothing, or draw what cannot be."""
    problems = part_problems(rig, [path for path, _ in tolerances])
    if problems:
        return problems
    for given, half in tolerances:
        for path in checked_parameters(rig, [given]):
            own = float(get_parameter(rig, path))
            ends = [x * (1 + s * half) for x in reached.get(path, (own, own)) for s in (-1, 1)]
            problems += _outside(rig, given, path, (min(ends), max(ends)))
    return list(dict.fromkeys(problems))


def _outside(rig: Rig, given: str, path: str, ends: tuple[float, float]) -> list[str]:
    """The ends of a part's draws that its parameter cannot have, a sentence each."""
    info, wrong = parameter_info(rig, path), []
    for end in ends:
        try:
            read_parameter(rig, path, end)
        except InputError:
            wrong.append(
                f"`tolerance.{given}` draws {quantity_text(end, info.unit)} at its widest, but "
                f"`{given}` must lie in {info.range}."
            )
    return wrong
