"""Paths of rig parameters that are single numbers: which there are, their values, and new ones."""

from collections.abc import Mapping, Sequence

import numpy as np

from .._errors import InputError
from ..dynamics import mobility
from ..rig import (
    ParameterInfo,
    Rig,
    UnknownParameter,
    get_parameter,
    parameter_info,
    parameter_paths,
    put_parameter,
    rig_problems,
)
from ._evaluation import DriveQuantity, corners_of_box

_JOINT = {
    "wheel.roundness", "wheel.rollers", "wheel.radius", "sphere.radius", "closure.preload",
}  # fmt: skip
MOST_CORNERS = 64


def scalar_parameters(rig: Rig) -> tuple[str, ...]:
    """Paths of every parameter that is one number of one body, one wheel or one effect."""
    return tuple(
        info.path for info in parameter_paths(rig) if info.shape == () and not _of_all(info.path)
    )


def _of_all(path: str) -> bool:
    return path.split(".", maxsplit=1)[0] in {"contact", "mount", "closure"}


def speaks_of_all(rig: Rig, path: str) -> bool:
    """Whether `path` names a parameter of all wheels at once."""
    head, second, *_ = path.split(".")
    return _of_all(path) or (head == "wheel" and second not in rig.names)


def may_vary(rig: Rig, info: ParameterInfo) -> bool:
    """Whether a parameter is one number, or one a wheel."""
    return info.shape == () or (speaks_of_all(rig, info.path) and info.shape == (rig.size,))


def checked_parameters(rig: Rig, paths: Sequence[str]) -> tuple[str, ...]:
    """Paths of single numbers; a path that speaks of all wheels becomes one path a wheel."""
    single: list[str] = []
    for path in map(str, paths):  # NumPy's words are arrays to jax
        info = parameter_info(rig, path)
        if not may_vary(rig, info):
            raise InputError(f"`{path}` is no single number (shape {info.shape}).")
        key = path.removeprefix("wheel.")
        single += [path] if info.shape == () else [f"wheel.{name}.{key}" for name in rig.names]
    return tuple(dict.fromkeys(single))


def overlaps(
    rig: Rig, paths: Sequence[str], of_drive: Mapping[str, DriveQuantity] | None = None
) -> list[tuple[str, str]]:
    """Pairs of `paths` that set one number: `wheel.radius` and `wheel.w1.radius`.

    `of_drive`: quantities of the drive that may stand among them.
    """
    moved = of_drive or {}
    numbers = [
        moved[path].sets if path in moved else frozenset(checked_parameters(rig, [path]))
        for path in paths
    ]
    return [
        (paths[j], paths[i])
        for i in range(len(paths)) for j in range(i)
        if numbers[i] & numbers[j]
    ]  # fmt: skip


def overlap_problems(
    rig: Rig, paths: Sequence[str], of_drive: Mapping[str, DriveQuantity] | None = None
) -> list[str]:
    """A sentence on each pair of `paths` whose values would depend on which is set last."""
    return [
        f"`{first}` and `{second}` set the same parameter: one of them is enough."
        for first, second in overlaps(rig, paths, of_drive)
    ]


def part_problems(rig: Rig, paths: Sequence[str]) -> list[str]:
    """What keeps parts from being off by a share of themselves, a sentence each."""
    problems = [
        f"`tolerance`: `{a}` and `{b}` are of the same part." for a, b in overlaps(rig, paths)
    ]
    problems += [
        f"`tolerance.{path}` draws any numbers, but `{path}` takes whole ones only."
        for path in paths
        if parameter_info(rig, path).whole
    ]
    single = checked_parameters(rig, paths)
    return problems + [
        f"`{path}` is 0, so that a relative tolerance of it means nothing."
        for path, value in zip(single, values_of(rig, single), strict=True)
        if value == 0
    ]


def joint_problems(rig: Rig, reached: Mapping[str, tuple[float, float]]) -> list[str]:
    """What a rig file would be refused for where parameters of `rig` go as far as they may.

    `reached`: lowest and highest value by path.  The rules are those of several keys of a wheel
    together, which no range of one of them shows, and go one way in each of them: so the corners
    tell (`MOST_CORNERS` of them at most), all wheels at the same end.  The inertia that varies not
    with its sphere is left alone.
    """
    groups: dict[str, list[str]] = {}
    for path in reached:
        key = group_of(path)
        if key in _JOINT or key.startswith("effect."):
            groups.setdefault(key, []).append(path)
    if not groups or rig_problems(rig):
        return []
    sentences: dict[str, None] = {}
    for high in corners_of_box(len(groups), MOST_CORNERS):
        corner = rig
        for end, paths in zip(high.astype(int), groups.values(), strict=True):
            for path in paths:
                corner = put_parameter(corner, path, reached[path][end])
        told = (x for x in rig_problems(corner) if not x.startswith("`sphere."))
        sentences |= dict.fromkeys(told)
    return [f"what varies makes a rig that cannot be: {told}" for told in sentences]


def refit_remarks(rig: Rig, paths: Sequence[str]) -> list[str]:
    """What to tell of wheel speeds that were fitted to Omega of `rig`, where `paths` vary.

    A design of another radius turns its sphere at another Omega under them.  Paths that are no
    parameters of the rig, quantities of a drive say, are left out.
    """
    fit, moved = mobility(rig).to_wheels, []
    for path in paths:
        try:
            parameter_info(rig, path)
        except UnknownParameter:
            continue
        value = np.asarray(get_parameter(rig, path), float)
        other = put_parameter(rig, path, value * 1.01 + (value == 0) * 1e-3)
        if not np.allclose(mobility(other).to_wheels, fit, rtol=1e-6, atol=1e-9):
            moved.append(f"`{path}`")
    if not moved:
        return []
    return [
        "the wheel speeds that fit `omega` are those of the rig as it stands: with "
        f"{' and '.join(moved)} varied, other designs turn the sphere at another angular velocity."
    ]


def with_values(rig: Rig, paths: Sequence[str], values) -> Rig:
    """`rig` with `values` (p,), traced or not, at `paths`."""
    for i, path in enumerate(paths):
        rig = put_parameter(rig, path, values[i])
    return rig


def values_of(rig: Rig, paths: Sequence[str]) -> np.ndarray:
    """Values at `paths`, SI."""
    return np.array([float(get_parameter(rig, path)) for path in paths])


def group_of(path: str) -> str:
    """The path without the wheel's name: `wheel.w1.contact.stiffness` -> `contact.stiffness`."""
    head, _, rest = path.partition(".")
    if head != "wheel":
        return path
    key = rest.partition(".")[2]
    return key if "." in key else f"wheel.{key}"
