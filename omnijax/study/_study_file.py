"""Study files: what to vary, what to judge by, under which drives and loads; TOML -> `Study`."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .._errors import InputError, did_you_mean
from ..rig import Rig, load_rig, parameter_info, parameter_paths
from ..rig._quantities import Quantity
from ..vibration import METRICS
from ._constraints import QUANTITIES, Wanted
from ._design_problem import Variable, check_variables
from ._sensitivity_target import speaks_of_all
from ._study import Case, Load, Study
from ._study_read import Reader
from ._sweep_drive import drive_quantities

KEYS = (
    "rig", "model", "duration", "rate", "rtol", "objective", "drive", "load", "variable",
    "constraint", "tolerance", "search", "pareto", "limit", "sampling",
)  # fmt: skip
DISTRIBUTIONS = ("uniform", "normal")


def load_study(path: str | Path) -> Study:
    """The study of a TOML file; `InputError` with every problem of the file at once."""
    file = Path(path)
    try:
        data = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"the study file cannot be read: {error.strerror}.", path) from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"is not valid TOML: {error}.", path) from None
    return parse_study(data, file)


def parse_study(data: Mapping[str, Any], path: str | Path | None = None) -> Study:
    """The study of tables as `tomllib` gives them; `rig` is relative to the folder of `path`."""
    read = Reader()
    top = read.table(data, "", KEYS)
    rig = _rig(top.get("rig", "atlas"), path)
    model = read.choice(top, "model", "", ("coupled", "paper"))
    fields: dict[str, Any] = {"rig": rig, "model": model}
    fields |= _cases(read, rig, top)
    fields |= _variables(read, rig, fields["drives"], top)
    fields |= _objective(read, top.get("objective", {}))
    fields |= _tolerances(read, rig, top.get("tolerance", {}))
    fields |= _search(read, top)
    constraints = read.tables(top, "constraint", ("quantity", "min", "max", *_OPTIONS))
    fields["constraints"] = tuple(
        wanted for block in constraints if (wanted := _constraint(read, block)) is not None
    )
    for key, unit in (("duration", "s"), ("rate", "1/s")):
        if key in top:
            fields[key] = read.value(top[key], key, Quantity(unit, above=0), 1.0)
    if "rtol" in top:
        fields["rtol"] = read.value(top["rtol"], "rtol", Quantity("1", above=0, high=1e-3), 1e-6)
    if not read.problems and fields["variables"]:
        try:
            check_variables(fields["variables"])
        except InputError as error:
            read.problems += error.problems
    if read.problems:
        raise InputError(read.problems, path)
    return Study(**fields)


def _rig(name: Any, path: str | Path | None) -> Rig:
    if not isinstance(name, str):
        raise InputError(f"`rig` must be a rig file or a bundled rig, but is {name!r}.", path)
    beside = Path("." if path is None else Path(path).parent) / name
    return load_rig(beside if beside.exists() else name)


def _cases(read: Reader, rig: Rig, top: Mapping) -> dict[str, Any]:
    """Drives and loads."""
    blocks = read.tables(top, "drive", ("name", "speed", "torque", "force"))
    drives = tuple(_drive(read, rig, block, i) for i, block in enumerate(blocks))
    if len({d.kind for d in drives}) > 1:
        read.say("the [[drive]] tables of one study are all of `speed` or all of `torque`.")
    loads = []
    for i, block in enumerate(read.tables(top, "load", ("name", "set"))):
        name = str(block.get("name", f"load {i + 1}"))
        values = read.table(block.get("set", {}), f"load.{name}.set", tuple(block.get("set", {})))
        pairs = [(p, _parameter(read, rig, p, v, f"load.{name}.set")) for p, v in values.items()]
        loads.append(Load(name, tuple(pairs)))
    if not drives and not any("drive" in text for text in read.problems):
        read.say("a study needs at least one [[drive]] with `speed`, one number a wheel.")
    return {"drives": drives, "loads": tuple(loads) or (Load("as built"),)}


def _drive(read: Reader, rig: Rig, block: Mapping, i: int) -> Case:
    name = str(block.get("name", f"drive {i + 1}"))
    kind = "torque" if "torque" in block and "speed" not in block else "speed"
    if "torque" in block and "speed" in block:
        read.say(f"`drive.{name}` takes either `speed` or `torque`, not both.")
    unit = {"speed": "rad/s", "torque": "N m"}[kind]
    values = _numbers(read, block.get(kind, []), f"drive.{name}.{kind}", unit)
    if len(values) != rig.size:
        read.say(
            f"`drive.{name}.{kind}` must have one value a wheel ({rig.size}), but has "
            f"{len(values)}."
        )
        values = (0.0,) * rig.size
    force = _numbers(read, block.get("force", [0.0] * 3), f"drive.{name}.force", "N")
    if len(force) != 3:
        read.say(f"`drive.{name}.force` must have 3 components, but has {len(force)}.")
        force = (0.0,) * 3
    return Case(name, kind, values, force)


def _numbers(read: Reader, given: Any, where: str, unit: str) -> tuple[float, ...]:
    given = given if isinstance(given, list) else [given]
    return tuple(read.value(x, where, Quantity(unit), 0.0) for x in given)


def _parameter(read: Reader, rig: Rig, path: str, value: Any, where: str) -> float:
    quantity = _quantity(read, rig, path, where)
    return 0.0 if quantity is None else read.value(value, f"{where}.{path}", quantity, 0.0)


def _quantity(read: Reader, rig: Rig, path: str, where: str, more=()) -> Quantity | None:
    """Unit and range of a parameter of one number, or of one number a wheel."""
    try:
        info = parameter_info(rig, path)
    except InputError:
        known = [x.path for x in parameter_paths(rig)]
        hint = did_you_mean(path, [*known, *more])
        read.say(f"`{where}`: the rig has no parameter `{path}`.{hint}")
        return None
    whole = speaks_of_all(rig, path) and info.shape == (rig.size,)
    if info.shape != () and not whole:
        read.say(f"`{where}`: `{path}` is no single number.")
        return None
    return Quantity(info.unit, info.low, info.high, whole=info.whole)


def _variables(read: Reader, rig: Rig, drives, top: Mapping) -> dict[str, Any]:
    found, kinds = [], []
    keys = ("path", "low", "high", "scale", "start", "distribution")
    for block in read.tables(top, "variable", keys):
        path = str(block.get("path", ""))
        where = f"variable.{path}"
        moved = drive_quantities(drives[0].drive, rig.names) if drives else {}
        quantity = Quantity(moved[path][0]) if path in moved else None
        quantity = quantity or _quantity(read, rig, path, where, moved)
        if quantity is None:
            continue
        low, high = (read.number(block, key, where, quantity) for key in ("low", "high"))
        start = read.value(block["start"], f"{where}.start", quantity) if "start" in block else None
        stiff = path.endswith("stiffness") and "scale" not in block and bool(low)
        log = stiff or read.choice(block, "scale", where, ("linear", "log")) == "log"
        if low is not None and high is not None:
            kinds.append(read.choice(block, "distribution", where, DISTRIBUTIONS))
            whole = quantity.whole
            found.append(Variable(path, low, high, log, whole, quantity.unit, start))
    return {"variables": tuple(found), "distributions": tuple(kinds)}


def _metric(read: Reader, name: Any, where: str) -> str:
    if name not in METRICS:
        hint = did_you_mean(str(name), METRICS)
        read.say(f"`{where}`: `{name}` is no metric.{hint} Metrics: {', '.join(METRICS)}.")
        return "rms"
    if not METRICS[name].smaller_is_better:
        read.say(f"`{where}`: `{name}` is no vibration but a margin: hold it by a [[constraint]].")
    return name


def _objective(read: Reader, given: Any) -> dict[str, Any]:
    table = read.table(given, "objective", ("metric", "weights", "over", "spread", "sigmas"))
    if "metric" in table and "weights" in table:
        read.say("`objective` takes either `metric` or `weights`, not both.")
    weights = table.get("weights", {table.get("metric", "rms"): 1.0})
    if not isinstance(weights, Mapping) or not weights:
        read.say(f"`objective.weights` must be a table of metrics, but is {weights!r}.")
        weights = {"rms": 1.0}
    where = "objective.weights" if "weights" in table else "objective.metric"
    pairs = tuple(
        (_metric(read, name, where), read.value(w, f"{where}.{name}", Quantity("1"), 1.0))
        for name, w in weights.items()
    )
    return {
        "weights": pairs,
        "over": read.choice(table, "over", "objective", ("worst", "mean")),
        "spread": read.choice(table, "spread", "objective", ("worst", "mean+sigma")),
        "sigmas": read.number(table, "sigmas", "objective", Quantity("1", low=0), 3.0),
    }


def _tolerances(read: Reader, rig: Rig, given: Any) -> dict[str, Any]:
    keys = ("draws", *(given if isinstance(given, Mapping) else ()))
    table = read.table(given, "tolerance", keys)
    draws = read.whole(table, "draws", "tolerance", 2, 16)
    pairs = []
    for path, value in table.items():
        if path == "draws":
            continue
        if _quantity(read, rig, path, "tolerance") is not None:
            part = Quantity("1", above=0, high=0.9)
            pairs.append((path, read.value(value, f"tolerance.{path}", part, 0.01)))
    return {"tolerances": tuple(pairs), "draws": draws}


def _search(read: Reader, top: Mapping) -> dict[str, Any]:
    """Everything about how the answer is looked for."""
    search = read.table(
        top.get("search", {}), "search", ("starts", "seed", "batch", "stochastic_steps")
    )
    front = read.table(top.get("pareto", {}), "pareto", ("metrics", "points"))
    limit = read.table(top.get("limit", {}), "limit", ("metric", "max", "confidence"))
    sampling = read.table(top.get("sampling", {}), "sampling", ("samples",))
    metrics = front.get("metrics", [])
    if metrics and (not isinstance(metrics, list) or len(metrics) not in {2, 3}):
        read.say(f"`pareto.metrics` must be a list of 2 or 3 metrics, but is {metrics!r}.")
        metrics = []
    bound = None
    if limit:
        name = _metric(read, limit.get("metric"), "limit.metric")
        unit = Quantity(METRICS[name].unit, above=0)
        bound = (name, read.number(limit, "max", "limit", unit))
    share = Quantity("1", above=0, high=0.9999)
    return {
        "starts": read.whole(search, "starts", "search", 1, 8),
        "seed": read.whole(search, "seed", "search", 0, 0),
        "batch": read.whole(search, "batch", "search", 1, 8),
        "stochastic": read.whole(search, "stochastic_steps", "search", 0, 0),
        "pareto": tuple(_metric(read, m, "pareto.metrics") for m in metrics),
        "points": read.whole(front, "points", "pareto", 3, 12),
        "limit": bound,
        "confidence": read.number(limit, "confidence", "limit", share, 0.99),
        "samples": read.whole(sampling, "samples", "sampling", 8, 256),
    }


_OPTIONS = ("orders", "youngs_modulus", "poisson_ratio")


def _constraint(read: Reader, block: Mapping) -> Wanted | None:
    name = block.get("quantity")
    where = f"constraint.{name}"
    known = {k: q.unit for k, q in {**QUANTITIES, **METRICS}.items()}
    if name not in known:
        options = ", ".join(known)
        hint = did_you_mean(str(name), known)
        read.say(f"`{where}` is no quantity.{hint} Quantities: {options}.")
        return None
    bounds = {
        key: read.value(block[key], f"{where}.{key}", Quantity(known[name]))
        for key in ("min", "max")
        if key in block
    }
    if not bounds:
        read.say(f"`{where}` needs `min` or `max`.")
        return None
    if len(bounds) == 2 and None not in bounds.values() and bounds["min"] > bounds["max"]:
        read.say(f"`{where}` conflicts with itself: min {bounds['min']:g} > max {bounds['max']:g}.")
    orders = block.get("orders", [1])
    if not isinstance(orders, list) or not all(isinstance(o, int) and o > 0 for o in orders):
        read.say(f"`{where}.orders` must be a list of whole numbers from 1, but is {orders!r}.")
        orders = [1]
    materials = []
    for key, unit in (("youngs_modulus", "Pa"), ("poisson_ratio", "1")):
        if name == "patch_pressure":
            pair = block.get(key)
            if not isinstance(pair, list) or len(pair) != 2:
                read.say(f"`{where}.{key}` must be two numbers: of the sphere and of the wheel.")
                pair = [1.0, 1.0]
            above = Quantity(unit, above=0)
            materials += [read.value(x, f"{where}.{key}", above, 1.0) for x in pair]
    return Wanted(name, bounds.get("min"), bounds.get("max"), tuple(orders), tuple(materials))


def study_of(study: "str | Path | Mapping | Study") -> Study:
    """A study from a file, from tables, or as it is."""
    if isinstance(study, Study):
        return study
    return parse_study(study) if isinstance(study, Mapping) else load_study(study)
