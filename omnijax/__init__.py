"""Differentiable simulation, design and diagnosis of a sphere on omnidirectional wheels."""

import importlib
from typing import Any

__version__ = "0.1.0"

_MODULES = {  # where a public name lives; nothing is imported before it is asked for (no jax)
    "rig": (
        "InputError bundled_rigs get_parameter load_rig load_laws parameter_info parameter_paths "
        "parse_rig rig_text save_rig set_parameter Rig"
    ),
    "laws": "AbstractLaw EFFECTS PROFILES Parameter",
    "simulate": (
        "Signal SpeedDrive SteadyState TorqueDrive Trajectory exact_obstacle propagate steady_state"
    ),
}
_WHERE = {name: module for module, names in _MODULES.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    if name in _WHERE:
        return getattr(importlib.import_module(f".{_WHERE[name]}", __name__), name)
    if name in _MODULES or name in {"dynamics", "vibration", "study", "diagnosis", "report", "cli"}:
        return importlib.import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_WHERE})
