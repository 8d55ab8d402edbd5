"""The drives, loads and variables of a study file."""

from typing import Any

from ..._errors import InputError, did_you_mean
from ...dynamics import fitting_speeds
from ...rig import Quantity, Rig, UnknownParameter, parameter_info, parameter_paths
from .._evaluation import drive_quantities
from .._parameters import may_vary
from .._problem import Variable
from .read import Reader
from .schema import DriveTable, StudyTable
from .study import Load, LoadCase


def cases(read: Reader, rig: Rig, top: StudyTable) -> dict[str, Any]:
    """Drives and loads."""
    drives = tuple(_drive(read, rig, block, i) for i, block in enumerate(top.drive))
    if len({d.kind for d in drives}) > 1:
        read.say("the [[drive]] tables of one study are all of `speed` or all of `torque`.")
    loads = []
    for i, block in enumerate(top.load):
        name, values = block.name or f"load {i + 1}", block.set.items()
        where = f"load.{block.name or i + 1}"
        pairs = [(p, _parameter(read, rig, p, v, f"{where}.set")) for p, v in values]
        loads.append(Load(name, tuple(pairs)))
    for kind, entries in (("drive", drives), ("load", loads)):
        names = [x.name for x in entries]
        twice = dict.fromkeys(n for n in names if names.count(n) > 1)
        for n in twice:
            read.say(f"two [[{kind}]] tables are named `{n}`: give each a name of its own.")
    if not drives and not read.lost("drive"):
        read.say(
            "a study needs at least one [[drive]] with `speed`, one number a wheel, or `omega`."
        )
    return {"drives": drives, "loads": tuple(loads) or (Load("as built"),)}


def _drive(read: Reader, rig: Rig, block: DriveTable, i: int) -> LoadCase:
    name, given = block.name or f"drive {i + 1}", block.model_fields_set
    where = f"drive.{block.name or i + 1}"
    named = [key for key in ("speed", "omega", "torque") if key in given]
    if len(named) > 1:
        read.say(f"`{where}` takes one of `speed`, `omega`, `torque`, but has {len(named)}.")
    kind = "torque" if named == ["torque"] else "speed"
    unit = {"speed": "rad/s", "torque": "N m"}[kind]
    if named == ["omega"]:
        values = _of_sphere(read, rig, block.omega, f"{where}.omega")
    else:
        values = _numbers(read, getattr(block, kind), f"{where}.{kind}", unit)
    if len(values) != rig.size:
        read.say(
            f"`{where}.{kind}` must have one value a wheel ({rig.size}), but has {len(values)}."
        )
        values = (0.0,) * rig.size
    force = _numbers(read, block.force, f"{where}.force", "N")
    if len(force) != 3:
        read.say(f"`{where}.force` must have 3 components, but has {len(force)}.")
        force = (0.0,) * 3
    return LoadCase(name, kind, values, force)


def _of_sphere(read: Reader, rig: Rig, given: Any, where: str) -> tuple[float, ...]:
    """Wheel speeds that turn the sphere at the angular velocity given."""
    omega = _numbers(read, given, where, "rad/s")
    if len(omega) != 3:
        read.say(f"`{where}` must have 3 components, but has {len(omega)}.")
        omega = (0.0,) * 3
    return tuple(fitting_speeds(rig, omega))


def _numbers(read: Reader, given: Any, where: str, unit: str) -> tuple[float, ...]:
    given = given if isinstance(given, list | tuple) else [given]
    return tuple(read.value(x, where, Quantity(unit), 0.0) for x in given)


def _parameter(read: Reader, rig: Rig, path: str, value: Any, where: str) -> float:
    quantity = quantity_of(read, rig, path, where)
    return 0.0 if quantity is None else read.value(value, f"{where}.{path}", quantity, 0.0)


def quantity_of(read: Reader, rig: Rig, path: str, where: str, more=()) -> Quantity | None:
    """Unit and range of a parameter of one number, or of one number a wheel."""
    try:
        info = parameter_info(rig, path)
    except UnknownParameter:
        known = [x.path for x in parameter_paths(rig) if may_vary(rig, x)]
        hint = did_you_mean(path, [*known, *more])
        read.say(f"`{where}`: the rig has no parameter `{path}`.{hint}")
        return None
    except InputError as error:
        read.say(f"`{where}`: {error}")
        return None
    if not may_vary(rig, info):
        read.say(f"`{where}`: `{path}` is no single number.")
        return None
    return info.quantity


def variables(read: Reader, rig: Rig, drives, top: StudyTable) -> dict[str, Any]:
    """The variables, and how each is distributed."""
    read_ones, kinds, levels = [], [], []
    for block in top.variable:
        path, given = block.path, block.model_fields_set
        where = f"variable.{path}"
        moved = drive_quantities(drives[0].drive, rig.names) if drives else {}
        quantity = Quantity(moved[path].unit) if path in moved else None
        quantity = quantity or quantity_of(read, rig, path, where, moved)
        if quantity is None:
            continue
        low = read.value(block.low, f"{where}.low", quantity)
        high = read.value(block.high, f"{where}.high", quantity)
        start = read.value(block.start, f"{where}.start", quantity) if "start" in given else None
        stiff = path.endswith("stiffness") and "scale" not in given and bool(low)
        log = stiff or block.scale == "log"
        if low is not None and high is not None:
            kinds.append(block.distribution)
            levels.append(block.levels)
            whole = quantity.whole
            read_ones.append(Variable(path, low, high, log, whole, quantity.unit, start))
    return {
        "variables": tuple(read_ones), "distributions": tuple(kinds), "levels": tuple(levels),
    }  # fmt: skip
