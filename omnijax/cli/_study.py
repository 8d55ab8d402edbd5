"""What `check` says of a study file; nothing is run."""

from collections.abc import Iterator
from typing import Any

from ._table import paragraph


def study_summary(path: str) -> dict[str, Any]:
    """What a study file varies and judges by; `InputError` with every problem at once."""
    from ..study import load_study

    study = load_study(path)
    return {
        "wheels": list(study.rig.names),
        "drives": {case.name: {case.kind: list(case.values)} for case in study.drives},
        "loads": [load.name for load in study.loads],
        "variables": {v.name: {"low": v.low, "high": v.high, "unit": v.unit}
                      for v in study.variables},
        "weights": dict(study.weights),
        "constraints": [limit.quantity for limit in study.constraints],
        "tolerances": dict(study.tolerances),
    }  # fmt: skip


def study_lines(path: str, summary: dict[str, Any]) -> Iterator[str]:
    """The same for people."""
    from .._text import amount

    wheels = len(summary["wheels"])
    yield f"{path}: right. A study of a rig with {wheels} wheel{'s' * (wheels > 1)}."
    for name, drive in summary["drives"].items():
        kind, values = next(iter(drive.items()))
        unit = "rad/s" if kind == "speed" else "N m"
        told = ", ".join(amount(x, unit) for x in values)
        yield paragraph(f"drive {name}: {kind} {told}", "  ")
    for name, v in summary["variables"].items():
        low, high = (amount(v[key], v["unit"]) for key in ("low", "high"))
        yield paragraph(f"varies {name} from {low} to {high}", "  ")
    yield paragraph(f"judges by {', '.join(summary['weights'])}", "  ")
    if summary["constraints"]:
        yield paragraph(f"holds {', '.join(summary['constraints'])}", "  ")
    if summary["tolerances"]:
        pairs = (f"{k} ± {100 * v:g} %" for k, v in summary["tolerances"].items())
        yield paragraph(f"tolerances: {', '.join(pairs)}", "  ")
