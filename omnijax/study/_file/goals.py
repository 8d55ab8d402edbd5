"""What a study file judges by: objective, constraints, tolerances, and how the answer is sought."""

from collections.abc import Mapping
from typing import Any

from ...rig import Quantity, Rig
from ...vibration import METRICS, metric_problem
from .._constraints import QUANTITIES, Wanted
from .cases import quantity_of
from .read import Reader


def _metric(read: Reader, name: Any, where: str) -> str:
    problem = metric_problem(name)
    if problem is not None:
        read.say(f"`{where}`: {problem}")
        return "rms"
    if not METRICS[name].smaller_is_better:
        read.say(f"`{where}`: `{name}` is no vibration but a margin: hold it by a [[constraint]].")
    return name


def objective(read: Reader, table: Mapping) -> dict[str, Any]:
    """Which metrics count how much, over the cases and over tolerances."""
    if "metric" in table and "weights" in table:
        read.say("`objective` takes either `metric` or `weights`, not both.")
    weights = table.get("weights", {table.get("metric", "rms"): 1.0})
    if not weights:
        read.say("`objective.weights` names no metric.")
        weights = {"rms": 1.0}
    where = "objective.weights" if "weights" in table else "objective.metric"
    pairs = tuple(
        (_metric(read, name, where), read.value(w, f"{where}.{name}", Quantity("1", above=0), 1.0))
        for name, w in weights.items()
    )
    return {
        "weights": pairs,
        "over": table.get("over", "worst"),
        "spread": table.get("spread", "worst"),
        "sigmas": read.number(table, "sigmas", "objective", Quantity("1", low=0), 3.0),
    }


def tolerances(read: Reader, rig: Rig, table: Mapping) -> dict[str, Any]:
    """Relative half widths of parts, and how many draws of them."""
    draws = read.whole(table, "draws", "tolerance", 2, 16)
    pairs = []
    for path, value in table.items():
        if path == "draws":
            continue
        if quantity_of(read, rig, path, "tolerance") is not None:
            part = Quantity("1", above=0, high=0.9)
            pairs.append((path, read.value(value, f"tolerance.{path}", part, 0.01)))
    return {"tolerances": tuple(pairs), "draws": draws}


def search(read: Reader, top: Mapping) -> dict[str, Any]:
    """Everything about how the answer is looked for."""
    search, front, limit, sampling = (
        top.get(key, {}) for key in ("search", "pareto", "limit", "sampling")
    )
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


def constraint(read: Reader, block: Mapping) -> Wanted | None:
    """One limit; None where it says of what is not known."""
    name = block["quantity"]
    where = f"constraint.{name}"
    known = {k: q.unit for k, q in {**QUANTITIES, **METRICS}.items()}
    if name not in known:
        read.say(str(metric_problem(name, QUANTITIES, f"`{where}` is no quantity.")))
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
