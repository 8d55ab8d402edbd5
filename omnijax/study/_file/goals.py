"""What a study file judges by: objective, constraints, tolerances, and how the answer is sought."""

from typing import Any

from ...rig import Quantity, Rig
from ...vibration import METRICS, metric_problem
from .._constraints import QUANTITIES, Constraint
from .cases import quantity_of
from .read import Reader
from .schema import ConstraintTable, Objective, StudyTable, ToleranceTable


def _metric(read: Reader, name: Any, where: str) -> str:
    problem = metric_problem(name)
    if problem is not None:
        read.say(f"`{where}`: {problem}")
        return "rms"
    if not METRICS[name].smaller_is_better:
        read.say(f"`{where}`: `{name}` is no vibration but a margin: hold it by a [[constraint]].")
    return name


def objective(read: Reader, table: Objective) -> dict[str, Any]:
    """Which metrics count how much, over the cases and over tolerances."""
    if {"metric", "weights"} <= table.model_fields_set:
        read.say("`objective` takes either `metric` or `weights`, not both.")
    weights = {table.metric: 1.0} if table.weights is None else table.weights
    if not weights and not read.lost("objective", "weights"):
        read.say("`objective.weights` names no metric.")
    where = "objective.metric" if table.weights is None else "objective.weights"
    pairs = tuple((_metric(read, name, where), weight) for name, weight in weights.items())
    return {
        "weights": pairs, "over": table.over, "spread": table.spread, "sigmas": table.sigmas,
    }  # fmt: skip


def tolerances(read: Reader, rig: Rig, table: ToleranceTable) -> dict[str, Any]:
    """Relative half widths of parts, and how many draws of them."""
    parts = table.model_extra or {}
    known = [path for path in parts if quantity_of(read, rig, path, "tolerance") is not None]
    return {"tolerances": tuple((path, parts[path]) for path in known), "draws": table.draws}


def search(read: Reader, top: StudyTable) -> dict[str, Any]:
    """Everything about how the answer is looked for."""
    metrics = top.pareto.metrics
    if not isinstance(metrics, list) or len(metrics) not in {0, 2, 3}:
        read.say(f"`pareto.metrics` must be a list of 2 or 3 metrics, but is {metrics!r}.")
        metrics = []
    twice = dict.fromkeys(str(name) for name in metrics if metrics.count(name) > 1)
    for name in twice:
        read.say(f"`pareto.metrics` names `{name}` twice.")
    bound = None
    if top.limit is not None:
        name = _metric(read, top.limit.metric, "limit.metric")
        given = {"max", "rise"} & top.limit.model_fields_set
        if len(given) != 1:
            told = "both are given" if given else "neither is given"
            read.say(f"`limit` takes `max` or `rise` (0.1: 10 % over the nominal), but {told}.")
        unit = Quantity(METRICS[name].unit, above=0)
        most = read.value(top.limit.max, "limit.max", unit) if "max" in given else None
        bound = (name, most, top.limit.rise)
    return {
        "starts": top.search.starts,
        "seed": top.search.seed,
        "batch": top.search.batch,
        "stochastic": top.search.stochastic_steps,
        "pareto": tuple(_metric(read, name, "pareto.metrics") for name in metrics),
        "points": top.pareto.points,
        "limit": bound,
        "confidence": 0.99 if top.limit is None else top.limit.confidence,
        "samples": top.sampling.samples,
    }


# What a quantity takes besides its bounds; the others have no use for it.
OWN_KEYS = {
    "orders": "frequency_separation",
    "youngs_modulus": "patch_pressure",
    "poisson_ratio": "patch_pressure",
}
MATERIALS = {
    "youngs_modulus": Quantity("Pa", above=0),
    "poisson_ratio": Quantity("1", high=0.5, above=-1),  # of a stable isotropic solid
}


def _is_count(given: Any) -> bool:
    return isinstance(given, int) and not isinstance(given, bool) and given > 0


def constraint(read: Reader, block: ConstraintTable) -> Constraint | None:
    """One limit; None where it says of what is not known."""
    name, given = block.quantity, block.model_fields_set
    where = f"constraint.{name}"
    known = {k: q.unit for k, q in {**QUANTITIES, **METRICS}.items()}
    if name not in known:
        read.say(str(metric_problem(name, QUANTITIES, f"`{where}` is no quantity.")))
        return None
    bounds = {
        key: read.value(getattr(block, key), f"{where}.{key}", Quantity(known[name]))
        for key in ("min", "max")
        if key in given
    }
    for key in sorted(given & OWN_KEYS.keys()):
        if OWN_KEYS[key] != name:
            read.say(f"`{where}` takes no `{key}`, which belongs to `{OWN_KEYS[key]}`.")
    if not bounds:
        read.say(f"`{where}` needs `min` or `max`.")
        return None
    if len(bounds) == 2 and None not in bounds.values() and bounds["min"] > bounds["max"]:
        read.say(f"`{where}` conflicts with itself: min {bounds['min']:g} > max {bounds['max']:g}.")
    orders = block.orders
    if not isinstance(orders, list) or not orders or not all(map(_is_count, orders)):
        read.say(f"`{where}.orders` must be a list of whole numbers from 1, but is {orders!r}.")
        orders = [1]
    materials = []
    for key, quantity in MATERIALS.items():
        if name == "patch_pressure":
            pair = getattr(block, key)
            if not isinstance(pair, list) or len(pair) != 2:
                read.say(f"`{where}.{key}` must be two numbers: of the sphere and of the wheel.")
                pair = [1.0, 1.0]
            materials += [read.value(x, f"{where}.{key}", quantity, 1.0) for x in pair]
    return Constraint(name, bounds.get("min"), bounds.get("max"), tuple(orders), tuple(materials))
