"""`omnijax check`: is the rig file right, and what does it say?"""

from typing import Any

from ._options import Json, emit


def check(rig: str, /, *, json: Json = False) -> int:
    """Check a rig file: a summary of the machine, or every error at once.

    Example: omnijax check atlas

    Parameters
    ----------
    rig
        A rig file, the name of a bundled rig (atlas, atlas-tripod), or a machine file.
    """
    from .._consent import law_files
    from .._errors import InputError
    from ..rig import load_rig
    from ._axis import check_machine, is_machine

    if is_machine(rig):
        return check_machine(rig, json)
    try:
        with law_files("read"):  # a law file is a program: its declaration is read, nothing is run
            machine = load_rig(rig)
    except InputError as error:
        if not json:
            raise
        emit(True, {"ok": False, "problems": list(error.problems)}, lambda: None)
        return 2
    summary = _summary(machine) | {"laws_not_run": _foreign(rig)}
    emit(json, {"ok": True, **summary}, lambda: _print(rig, summary))
    return 0


def _foreign(name: str) -> list[dict[str, str]]:
    """The effects whose laws stand in files of their own."""
    from .._reading import read_toml
    from ..rig import rig_path

    blocks = read_toml(rig_path(name)).get("effect", [])
    return [{k: str(b[k]) for k in ("id", "place", "law")} for b in blocks if "law" in b]


def _summary(rig: Any) -> dict[str, Any]:
    import numpy as np

    from ..rig import parameter_paths
    from ..vibration import modes

    wheels, found = rig.wheels, modes(rig)
    depth = np.broadcast_to(np.asarray(rig.gaps.depth), rig.size)
    columns = {
        "radius": wheels.radius, "rollers": wheels.rollers, "roundness": wheels.roundness,
        "gap_depth": depth, "contact_stiffness": wheels.contact.stiffness,
        "contact_damping": wheels.contact.damping, "mount_stiffness": wheels.mount.stiffness,
        "mount_damping": wheels.mount.damping, "closure_stiffness": wheels.closure.stiffness,
        "preload": wheels.closure.preload, "friction": wheels.contact.friction,
    }  # fmt: skip
    return {
        "sphere": {
            "radius": float(rig.sphere.radius),
            "mass": float(rig.sphere.mass),
            "inertia": np.asarray(rig.sphere.inertia).tolist(),
        },
        "platform": {"mass": float(rig.platform.mass)},
        "total_mass": float(rig.total_mass),
        "gravity": np.asarray(rig.platform.gravity).tolist(),
        "wheels": [
            {"name": name, "profile": rig.profiles[i].id}
            | {"normal": np.asarray(wheels.normal[i]).tolist()}
            | {"drive": np.asarray(wheels.drive[i]).tolist()}
            | {key: float(value[i]) for key, value in columns.items()}
            for i, name in enumerate(rig.names)
        ],
        "driven_axes": int(np.linalg.matrix_rank(np.asarray(wheels.spin_axis), tol=1e-6)),
        "held_directions": int(np.linalg.matrix_rank(np.asarray(wheels.normal), tol=1e-6)),
        "natural_frequencies": np.asarray(found.frequency).tolist(),
        "damping_ratios": np.asarray(found.damping_ratio).tolist(),
        "effects": [{"id": placed.law.id, "place": placed.place} for placed in rig.effects],
        "uncertainty": dict(rig.uncertainty),
        "parameters": [info.path for info in parameter_paths(rig)],
    }


_ROWS = (  # label, key, factor to the printed unit
    ("profile", "profile", None),
    ("normal", "normal", None),
    ("drive", "drive", None),
    ("radius r_b (mm)", "radius", 1e3),
    ("rollers n", "rollers", 1),
    ("roundness η", "roundness", 1),
    ("gap depth Δr_w (mm)", "gap_depth", 1e3),
    ("contact stiffness K (kN/m)", "contact_stiffness", 1e-3),
    ("contact damping C (N s/m)", "contact_damping", 1),
    ("mount stiffness k (kN/m)", "mount_stiffness", 1e-3),
    ("mount damping c (N s/m)", "mount_damping", 1),
    ("closure stiffness K' (kN/m)", "closure_stiffness", 1e-3),
    ("preload N0 (N)", "preload", 1),
    ("friction μ", "friction", 1),
)


def _print(name: str, summary: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(markup=False, highlight=False)
    sphere, wheels = summary["sphere"], summary["wheels"]
    inertia = sphere["inertia"]
    kind = f"inertia {inertia:g} kg m²" if isinstance(inertia, float) else "3×3 inertia"
    console.print(f"{name}: right. {len(wheels)} wheel{'s' * (len(wheels) > 1)}.")
    console.print(f"sphere    radius {sphere['radius']:g} m, mass {sphere['mass']:g} kg, {kind}")
    console.print(
        f"platform  mass {summary['platform']['mass']:g} kg; "
        f"the whole machine {summary['total_mass']:g} kg"
    )
    table = Table("wheel", *(wheel["name"] for wheel in wheels), box=None, padding=(0, 1))
    for label, key, factor in _ROWS:
        table.add_row(label, *(_cell(wheel[key], factor) for wheel in wheels))
    console.print(table)
    _print_motion(console, summary)
    if summary["effects"]:
        effects = ", ".join(f"{effect['id']} at {effect['place']}" for effect in summary["effects"])
        console.print(f"effects: {effects}")
    for effect in summary["laws_not_run"]:
        console.print(
            f"not run: {effect['id']} at {effect['place']}, a law in {effect['law']}, whose "
            "declaration is right; the frequencies are those without it"
        )
    if summary["uncertainty"]:
        pairs = (f"{path} {100 * value:g} %" for path, value in summary["uncertainty"].items())
        console.print(f"uncertain (1 σ): {', '.join(pairs)}")


def _print_motion(console: Any, summary: dict[str, Any]) -> None:
    """What the wheels leave free, and the natural frequencies."""
    driven, held = 3 - summary["driven_axes"], 3 - summary["held_directions"]
    if driven:
        console.print(
            f"The wheels drive {3 - driven} of 3 rotation axes; the sphere turns freely about "
            f"the other{'s' * (driven > 1)}."
        )
    if held:
        console.print(
            f"The contacts hold the sphere in {3 - held} of 3 directions; nothing holds it "
            f"along the other{'s' * (held > 1)}."
        )
    pairs = zip(summary["natural_frequencies"], summary["damping_ratios"], strict=True)
    text = ", ".join(f"{f:.4g} Hz ({100 * ratio:.3g} %)" for f, ratio in pairs if f > 1e-6)
    console.print(f"natural frequencies (damping): {text}")


def _cell(value: Any, factor: float | None) -> str:
    if factor is None:
        return value if isinstance(value, str) else " ".join(f"{x + 0.0:.4g}" for x in value)
    return f"{value * factor:.6g}"
