"""Differentiable simulation, design and diagnosis of a sphere on omnidirectional wheels."""

import importlib

TYPE_CHECKING = False
if TYPE_CHECKING:  # the command line hears Ctrl-C as soon as this is loaded
    from typing import Any

__version__ = "0.2.0"

_PACKAGES = (  # from left to right: a package imports only from itself and to its left
    "laws",
    "rig",
    "recording",
    "dynamics",
    "simulation",
    "machine",
    "vibration",
    "study",
    "diagnosis",
    "report",
    "paper",
    "view",
    "cli",
)

_EXPORTS = {  # package -> its names here; nothing is imported before it is asked for (no jax)
    "laws": "AbstractLaw EFFECTS PROFILES Parameter",
    "rig": (
        "InputError Rig bundled_rigs get_parameter load_laws load_rig parameter_info "
        "parameter_paths parse_rig rig_text save_rig set_parameter"
    ),
    "simulation": (
        "Signal SpeedDrive SteadyState TorqueDrive Trajectory drive_from_recording "
        "load_run load_trajectory measured propagate simulate simulate_many speeds steady_state "
        "torques"
    ),
    "recording": (
        "Case Fault NoiseFloor Recording noise_floor read_case read_recording write_recording"
    ),
    "study": (
        "Design Front GlobalSensitivity Sensitivity Study SweepResult Tolerances design "
        "global_sensitivity load_study load_sweep pareto sensitivity sweep tolerances"
    ),
    "diagnosis": "Diagnosis diagnose",
    "vibration": (
        "METRICS Modes OrderMap OrderTrack evaluate modes natural_frequencies order_track "
        "rpm_order_map"
    ),
}
_WHERE = {name: package for package, names in _EXPORTS.items() for name in names.split()}


def __getattr__(name: str) -> "Any":
    if name in _WHERE:
        return getattr(importlib.import_module(f".{_WHERE[name]}", __name__), name)
    if name in _PACKAGES:
        return importlib.import_module(f".{name}", __name__)
    if name == "__all__":
        return sorted(_WHERE)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({"__version__", *_WHERE, *_PACKAGES})
