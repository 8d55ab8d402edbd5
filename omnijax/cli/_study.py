"""What `check` says of a study file; nothing is run."""

from pathlib import Path
from typing import Any

from ._options import emit
from ._table import paragraph


def is_study(path: str) -> bool:
    """Whether a file is a study's: TOML with a `rig` or a [[drive]], and no sphere."""
    from .._errors import InputError
    from .._reading import read_toml

    file = Path(path)
    if file.suffix != ".toml" or not file.is_file():
        return False
    try:
        keys = set(read_toml(file))
    except InputError:  # told where it is read as what it is
        return False
    return bool(keys & {"rig", "drive", "variable"}) and not keys & {"sphere", "wheel"}


def check_study(path: str, json: bool) -> int:
    """A study file: what it varies and judges by, or every error at once."""
    from .._errors import InputError
    from ..study import load_study

    try:
        study = load_study(path)
    except InputError as error:
        if not json:
            raise
        emit(True, {"ok": False, "problems": list(error.problems)}, lambda: None)
        return 2
    summary = _summary(study)
    emit(json, {"ok": True} | summary, lambda: _print(path, summary))
    return 0


def _summary(study: Any) -> dict[str, Any]:
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


def _print(path: str, summary: dict[str, Any]) -> None:
    from .._text import amount

    wheels = len(summary["wheels"])
    print(f"{path}: right. A study of a rig with {wheels} wheel{'s' * (wheels > 1)}.")
    for name, drive in summary["drives"].items():
        kind, values = next(iter(drive.items()))
        unit = "rad/s" if kind == "speed" else "N m"
        told = ", ".join(amount(x, unit) for x in values)
        print(paragraph(f"drive {name}: {kind} {told}", "  "))
    for name, v in summary["variables"].items():
        low, high = (amount(v[key], v["unit"]) for key in ("low", "high"))
        print(paragraph(f"varies {name} from {low} to {high}", "  "))
    print(paragraph(f"judges by {', '.join(summary['weights'])}", "  "))
    if summary["constraints"]:
        print(paragraph(f"holds {', '.join(summary['constraints'])}", "  "))
    if summary["tolerances"]:
        pairs = (f"{k} ± {100 * v:g} %" for k, v in summary["tolerances"].items())
        print(paragraph(f"tolerances: {', '.join(pairs)}", "  "))
