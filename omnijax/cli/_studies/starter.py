"""A study file for a rig: speeds that fit its wheels, ranges around its own numbers."""

import json
import math
import os
import re
from importlib import resources
from pathlib import Path
from typing import Any

from ..._errors import InputError

_TIMES = re.compile(r"<([\w.]+) \* ([\d.]+)>")
OMEGA = (0.31, 0.19, 0.45)  # direction of the sphere's turning in which every wheel turns
SURFACE = 0.3  # m/s of the sphere's surface


def template(name: str) -> str:
    """The text of a template file."""
    folder = resources.files("omnijax") / "rig" / "data" / "template"
    return (folder / name).read_text(encoding="utf-8")


def study_text(kind: str, name: str, file: Path) -> str:
    """The study file of a kind for the rig `name`, to be written at `file`.

    Raises `InputError` for a rig that is not there, and for a machine file.
    """
    path, written = _found(name, file)
    rig = _rig(kind, path)
    speeds = ", ".join(f"{speed:.6g}" for speed in usual_speeds(rig))
    named = json.dumps(written) + _duration(rig)
    text = template(f"{kind}.toml").replace("<rig>", named, 1)
    text = text.replace("<speeds>", f"[{speeds}]", 1)
    return _TIMES.sub(lambda m: _times(rig, m[1], float(m[2])), text)


def usual_speeds(rig: Any) -> list[float]:
    """Wheel speeds in rad/s that fit each other, at `SURFACE` of the sphere."""
    from ...dynamics import fitting_speeds

    size = SURFACE / (math.hypot(*OMEGA) * float(rig.sphere.radius))
    return fitting_speeds(rig, [size * x for x in OMEGA])


def _found(name: str, file: Path) -> tuple[str, str]:
    """Where the rig is, and how a study at `file` names it: from its own folder."""
    beside = file.parent / name
    if beside.is_file():
        return str(beside), name
    if Path(name).is_file():
        return name, os.path.relpath(name, file.parent)
    return name, name  # a bundled rig, or none


def _rig(kind: str, path: str) -> Any:
    from ...rig import load_rig
    from .._inputs import file_kind

    if file_kind(path) == "machine":
        also = f"; `omnijax {kind} {path} --drive LOG` studies it without one"
        raise InputError(
            "is a machine file of an axis: study files are for rigs"
            f"{also if kind in ('sweep', 'sensitivity') else ''}.", path
        )  # fmt: skip
    return load_rig(path)


def _duration(rig: Any) -> str:
    """The line that asks for runs, after that of the rig, where it has no steady state."""
    from ...dynamics import hold_obstacle
    from ...simulation import exact_obstacle

    reason = exact_obstacle(rig) or hold_obstacle(rig, "coupled")
    return "" if reason is None else f'\nduration = "1 s"  # {reason}: no steady state'


def _times(rig: Any, path: str, factor: float) -> str:
    """Two figures of a parameter (its mean over the wheels) times `factor`, as TOML."""
    from ..._text import quantity_text
    from ...rig import get_parameter, parameter_info

    value = factor * float(get_parameter(rig, path).mean())
    unit = parameter_info(rig, path).unit
    rounded = float(f"{value:.2g}")
    return f"{rounded:g}" if unit == "1" else json.dumps(quantity_text(rounded, unit))
