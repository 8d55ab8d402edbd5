"""`omnijax check`: is the rig file right, and what does it say?"""

from collections.abc import Callable, Iterator
from typing import Any

from ._inputs import Json, emit, machine_summary
from ._studies import study_summary


def check(rig: str, /, *, json: Json = False) -> int:
    """Check a rig file or a study file: what it says in a summary, or every error at once.

    Example: omnijax check atlas

    Example: omnijax check study.toml

    Parameters
    ----------
    rig
        A rig file, the name of a bundled rig (atlas, atlas-tripod), a machine file, or a study.
    """
    from .._errors import InputError
    from ._inputs import file_kind

    kind = file_kind(rig)
    try:
        summary = _SUMMARIES[kind](rig)
    except InputError as error:
        if not json:
            raise
        emit(True, {"ok": False, "problems": list(error.problems)}, lambda: None)
        return 2
    emit(json, {"ok": True, **summary}, lambda: print("\n".join(_lines(kind)(rig, summary))))
    return 0


def _lines(kind: str) -> Callable[[str, dict[str, Any]], Iterator[str]]:
    """What tells people of a file; imported when its reading has not failed."""
    if kind == "machine":
        from ._inputs import machine_lines as lines
    elif kind == "study":
        from ._studies import study_lines as lines
    else:
        from ._check_text import lines
    return lines


def rig_summary(name: str) -> dict[str, Any]:
    """What a rig file says; `InputError` with every problem at once."""
    from .._consent import law_files
    from ..rig import load_rig, rig_notes

    with law_files("read"):  # a law file is a program: its declaration is read, nothing is run
        rig = load_rig(name)
    return _summary(rig) | {"laws_not_run": _foreign(name), "notes": rig_notes(name)}


_SUMMARIES: dict[str, Callable[[str], dict[str, Any]]] = {
    "machine": machine_summary, "study": study_summary, "rig": rig_summary,
}  # fmt: skip


def _foreign(name: str) -> list[dict[str, str]]:
    """The effects whose laws stand in files of their own."""
    from ..rig import rig_tables

    blocks = rig_tables(name).get("effect", [])
    return [{k: str(b[k]) for k in ("id", "place", "law")} for b in blocks if "law" in b]


def _summary(rig: Any) -> dict[str, Any]:
    import numpy as np

    from ..dynamics import held_directions, mobility, same_contacts, weight
    from ..rig import closed_numbers, derived, parameter_paths
    from ..vibration import modes

    elastic, motion, pressed = modes(rig), mobility(rig), weight(rig)
    return {
        "sphere": {
            "radius": float(rig.sphere.radius),
            "mass": float(rig.sphere.mass),
            "inertia": np.asarray(rig.sphere.inertia).tolist(),
        },
        "platform": {"mass": float(rig.platform.mass)},
        "total_mass": float(derived(rig)[1]),
        "gravity": np.asarray(rig.platform.gravity).tolist(),
        "wheels": _wheels(rig),
        "driven_axes": motion.driven,
        "held_directions": held_directions(rig),
        "same_contacts": [[rig.names[i], rig.names[k]] for i, k in same_contacts(rig)],
        "kinematics": _kinematics(motion),
        "weight": None
        if pressed is None
        else pressed._asdict() | {"normal": pressed.normal.tolist()},
        "natural_frequencies": np.asarray(elastic.frequency).tolist(),
        "damping_ratios": np.asarray(elastic.damping_ratio).tolist(),
        "modes_without": list(elastic.without),
        "effects": [{"id": placed.law.id, "place": placed.place} for placed in rig.effects],
        "uncertainty": dict(rig.uncertainty),
        "not_open": closed_numbers(rig),
        "parameters": [info.path for info in parameter_paths(rig)],
    }


def _wheels(rig: Any) -> list[dict[str, Any]]:
    """Name, profile, directions and numbers of each wheel."""
    import numpy as np

    from ..rig import direction_angles, wheel_facts

    normal, drive = np.asarray(rig.wheels.normal), np.asarray(rig.wheels.drive)
    return [
        {"name": name, "profile": rig.profiles[i].id}
        | {"angles": direction_angles(normal[i], drive[i])}
        | {"normal": normal[i].tolist()}
        | {"drive": drive[i].tolist()}
        | {key: float(value[i]) for key, value in wheel_facts(rig).items()}
        for i, name in enumerate(rig.names)
    ]


def _kinematics(motion: Any) -> dict[str, Any]:
    """How wheels and sphere turn each other; a conflict's largest speed is 1."""
    import numpy as np

    largest = np.abs(motion.conflicts).max(1, keepdims=True, initial=1e-300)
    return {
        "wheels_from_sphere": _exact(motion.to_wheels),
        "sphere_from_wheels": _exact(motion.to_sphere),
        "condition": motion.condition,
        "undriven": _exact(motion.undriven()),
        "weak": _exact(motion.weak()),
        "conflicts": _exact(motion.conflicts / largest),
    }


def _exact(matrix: Any) -> list:
    """The rows without rounding noise where a zero stands."""
    import numpy as np

    return np.where(
        np.abs(matrix) < 1e-12 * np.max(np.abs(matrix), initial=0), 0.0, matrix
    ).tolist()
