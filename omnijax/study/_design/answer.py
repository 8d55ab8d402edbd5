"""The answer from the ends of all searches: which is best, what holds it, what conflicts."""

import math

from ..._text import quantity_text
from .._problem import Problem
from ._search import ACTIVE, FEASIBLE, ON_BOUND, STATIONARY, SearchEnd, best_of, limits_text
from .result import Design

SLIGHT = 1e-3  # of a bound in the least violation


def make_design(
    problem: Problem, ends: list[SearchEnd], notes: tuple[str, ...] = (), size: float = 0.0
) -> Design:
    """The result from the ends of all searches; `size` is that of the objective at starts."""
    best = best_of(ends)
    kkt, names = best.kkt, [v.name for v in problem.variables]
    columns = {
        "start": [e.start.tolist() for e in ends],
        "x": [e.x.tolist() for e in ends],
        "objective": [e.value for e in ends],
        "violation": [float(e.kkt.violation) for e in ends],
        "kkt_residual": [float(e.kkt.residual) for e in ends],
        "evaluations": [e.evaluations for e in ends],
        "status": [e.status for e in ends],
        "reason": [conflict(problem, e) if e.status == "infeasible" else e.reason for e in ends],
    }
    reason = conflict(problem, best) if best.status == "infeasible" else best.reason
    return Design(
        status=best.status,
        reason=reason,
        variables=dict(zip(names, best.x.tolist(), strict=True)),
        objective=best.value,
        objective_name=problem.name,
        unit=problem.unit,
        cases=dict(zip(problem.cases, best.f.tolist(), strict=True)),
        active=tuple(_active(problem, best)),
        multipliers=tuple(_prices(problem, best)) if best.status != "infeasible" else (),
        kkt_residual=float(kkt.residual),
        violation=float(kkt.violation),
        evaluations=sum(e.evaluations for e in ends),
        ends=columns,
        units={v.name: v.unit for v in problem.variables},
        prices={
            limit.text: float(price / limit.scale)
            for limit, price in zip(problem.limits, kkt.limits, strict=True)
            if price > 0 and best.status != "infeasible"
        },
        whole=tuple(v.name for v in problem.variables if v.whole),
        limits={
            limit.text: (limit.sense * float(g + limit.bound), limit.unit)
            for limit, g in zip(problem.limits, best.g, strict=True)
        },
        notes=(*_dead_ends(problem, ends, best), *notes),
        size=size,
    )


def _dead_ends(problem: Problem, ends: list[SearchEnd], best: SearchEnd) -> list[str]:
    """Which limits stopped searches short of a feasible design, where there is one."""
    short = [e for e in ends if e.status == "infeasible"]
    if not short or best.status == "infeasible":
        return []
    names = [
        limit.text
        for i, limit in enumerate(problem.limits)
        if any(e.g[i] / limit.scale > FEASIBLE for e in short)
    ]
    return [
        f"{len(short)} of {len(ends)} searches ended short of a feasible design, held up by "
        f"{limits_text(names)}."
    ]


def missed(problem: Problem, over) -> list[str]:
    """The limits that g - limit (c,) misses, and by how much."""
    return [
        f"`{limit.text}` is missed by {quantity_text(float(more), limit.unit)}"
        for limit, more in zip(problem.limits, over, strict=True)
        if more / limit.scale > FEASIBLE
    ]


def conflict(problem: Problem, end: SearchEnd) -> str:
    """Which constraints cannot be met together: those that the least violation balances."""
    held = [
        f"`{v.name}` at its {'lower' if price < 0 else 'upper'} bound"
        for v, price in zip(problem.variables, end.kkt.bounds, strict=True)
        if abs(price) > SLIGHT
    ]
    beside = f", held back by {' and '.join(held)}" if held else ""
    least = "the least violation nearby" if end.kkt.residual <= STATIONARY else "the nearest found"
    head = "no design within the bounds was found that meets all constraints"
    return f"{head}; {least}: {' and '.join(missed(problem, end.g))}{beside}"


def _active(problem: Problem, end: SearchEnd) -> list[str]:
    lines = []
    for v, share, free in zip(problem.variables, end.share, end.free, strict=True):
        if free and min(share, 1 - share) <= ON_BOUND:
            side, bound = ("lower", v.low) if share < 0.5 else ("upper", v.high)
            lines.append(f"`{v.name}` is at its {side} bound {quantity_text(bound, v.unit)}.")
    for limit, g in zip(problem.limits, end.g, strict=True):
        if abs(g) / limit.scale <= ACTIVE:
            lines.append(f"`{limit.text}` is active.")
    return lines


def _prices(problem: Problem, end: SearchEnd) -> list[str]:
    """What relaxing each active limit or bound buys, from its multiplier."""
    lines, name = [], problem.name
    for limit, price in zip(problem.limits, end.kkt.limits, strict=True):
        if price > 0:
            gain = quantity_text(price / limit.scale * _unit_step(limit), problem.unit)
            step = quantity_text(_unit_step(limit), limit.unit)
            lines.append(f"relaxing `{limit.text}` by {step} buys {gain} of {name}.")
    for v, price in zip(problem.variables, end.kkt.bounds, strict=True):
        if price != 0:
            bound = v.low if price < 0 else v.high
            span = math.log(v.high / v.low) if v.log else (v.high - v.low) / (abs(bound) or 1.0)
            gain = quantity_text(abs(price) * 0.01 / span, problem.unit)
            verb = "lowering" if price < 0 else "raising"
            what = "1 %" if bound else f"0.01 {v.unit}"
            side = "lower" if price < 0 else "upper"
            lines.append(f"{verb} the {side} bound of `{v.name}` by {what} buys {gain} of {name}.")
    heavy = [
        f"{case} ({100 * w:.0f} %)"
        for case, w in zip(problem.cases, end.kkt.cases, strict=True)
        if w > 1e-3 and len(problem.cases) > 1 and problem.worst
    ]
    return lines + ([f"worst cases that hold the optimum: {', '.join(heavy)}."] if heavy else [])


def _unit_step(limit) -> float:
    """One unit of the limit, or a hundredth of its scale where one unit is out of proportion."""
    return 1.0 if 0.5 <= limit.scale <= 1e4 else 0.01 * limit.scale
