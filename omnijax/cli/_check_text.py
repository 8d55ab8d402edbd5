"""What `omnijax check` prints: the machine in lines of 80 characters, the same in a pipe."""

import math
from collections.abc import Iterator
from typing import Any

from .._text import listed
from ..rig import FACTS, open_paths
from ._console import columns, paragraph


def lines(name: str, summary: dict[str, Any]) -> Iterator[str]:
    """The summary of `check` for people."""
    wheels = summary["wheels"]
    yield f"{name}: right. {len(wheels)} wheel{'s' * (len(wheels) > 1)}."
    yield from _bodies(summary)
    yield ""
    yield from _directions(wheels)
    yield ""
    yield from _numbers(wheels)
    yield ""
    yield from _kinematics(summary)
    yield from _weight(summary)
    yield from _frequencies(summary)
    if summary["effects"]:
        told = ", ".join(f"{effect['id']} at {effect['place']}" for effect in summary["effects"])
        yield paragraph(f"effects: {told}", "  ")
    for effect in summary["laws_not_run"]:
        yield paragraph(
            f"not run: {effect['id']} at {effect['place']}, a law in {effect['law']}, whose "
            "declaration is right; the frequencies are those without it", "  ",
        )  # fmt: skip
    if summary["uncertainty"]:
        yield paragraph(f"uncertain (1 σ): {', '.join(_spreads(summary))}", "  ")
    for sentence in summary["not_open"]:
        yield paragraph(f"warning: {sentence}", "  ")
    for note in summary["notes"]:
        yield paragraph(f"note: {note}", "  ")


_SPREADS = {"1": (100.0, "%"), "rad": (180 / math.pi, "°"), "s": (1e3, "ms"), "m": (1e3, "mm")}


def _spreads(summary: dict[str, Any]) -> Iterator[str]:
    """The 1-sigmas of `[uncertainty]`: per cent, an angle, a time or a length."""
    units = open_paths([wheel["name"] for wheel in summary["wheels"]])
    for path, sigma in summary["uncertainty"].items():
        factor, sign = _SPREADS[units.get(path, "1")]
        yield f"{path} {factor * sigma:.4g} {sign}"


def _bodies(summary: dict[str, Any]) -> Iterator[str]:
    sphere, gravity = summary["sphere"], summary["gravity"]
    inertia = sphere["inertia"]
    kind = f"inertia {inertia:.4g} kg m²" if isinstance(inertia, float) else "3×3 inertia"
    yield f"sphere    radius {sphere['radius']:g} m, mass {sphere['mass']:.4g} kg, {kind}"
    pull = math.hypot(*gravity)
    weight = f"; gravity {pull:g} m/s²" if pull else ""
    yield (
        f"platform  mass {summary['platform']['mass']:.4g} kg; "
        f"the whole machine {summary['total_mass']:.4g} kg{weight}"
    )


def _directions(wheels: list[dict[str, Any]]) -> Iterator[str]:
    profiles = [wheel["profile"] for wheel in wheels]
    if len(set(profiles)) == 1:
        yield f"every wheel has the profile {profiles[0]}"
    else:
        pairs = (f"{w['name']} {w['profile']}" for w in wheels)
        yield paragraph(f"profiles: {', '.join(pairs)}", "  ")
    rows = [["wheel", "zenith", "azimuth", "skew", "normal", "drive"]]
    for wheel in wheels:
        angles = [f"{x:.4g}°" for x in wheel["angles"]]
        vectors = [" ".join(f"{x:6.3f}" for x in wheel[key]) for key in ("normal", "drive")]
        rows.append([wheel["name"], *angles, *vectors])
    yield from columns(rows)


def _numbers(wheels: list[dict[str, Any]]) -> Iterator[str]:
    """What all wheels share once; what differs, wheel by wheel."""
    shared, single = [], []
    for key, (label, factor, unit, _) in FACTS.items():
        values = [f"{wheel[key] * factor:.6g}" for wheel in wheels]
        if len(set(values)) == 1:
            shared.append([label, f"{values[0]} {unit}".strip()])
        else:
            single.append((label, unit, values))
    yield from columns(shared)
    for label, unit, values in single:
        pairs = (f"{w['name']} {v}" for w, v in zip(wheels, values, strict=True))
        yield paragraph(f"{label}{f' ({unit})' if unit else ''}: {', '.join(pairs)}", "  ")


def _kinematics(summary: dict[str, Any]) -> Iterator[str]:
    """What the wheels turn, both ways, and what they leave free."""
    motion, names = summary["kinematics"], [wheel["name"] for wheel in summary["wheels"]]
    yield "wheel speeds from the sphere's Ω (round wheels):"
    for name, row in zip(names, motion["wheels_from_sphere"], strict=True):
        terms = " ".join(f"{x:+9.4g} Ω_{axis}" for axis, x in zip("xyz", row, strict=True))
        yield f"  {name} = {terms}"
    yield "the sphere's Ω from wheel speeds:"
    for axis, row in zip("xyz", motion["sphere_from_wheels"], strict=True):
        terms = " ".join(f"{x:+.4g} {name}" for name, x in zip(names, row, strict=True))
        yield paragraph(terms, "        ", f"  Ω_{axis} = ")
    for one, other in summary["same_contacts"]:
        yield paragraph(
            f"warning: {one} and {other} touch the sphere at one place, where no two wheels can "
            "be: turn one of them.", "  ",
        )  # fmt: skip
    driven = summary["driven_axes"]
    if driven < 3:
        free = 3 - driven
        yield _owed(
            names, f"The wheels drive {driven} of 3 rotation axes; the sphere turns freely about "
            f"the other{'s' * (free > 1)}: {_axes(motion['undriven'])}."
        )  # fmt: skip
    elif motion["weak"]:
        yield paragraph(
            f"warning: the wheels hardly drive the axis {_axes(motion['weak'])}: the condition of "
            f"the drive is {motion['condition']:.4g}, so small wheel speeds ask for a fast sphere. "
            "Turn or move a wheel.", "  ",
        )  # fmt: skip
    else:
        yield f"All 3 rotation axes are driven; condition {motion['condition']:.3g} (1 is best)."
    for row in motion["conflicts"]:
        terms = " ".join(f"{x:+.3g} {name}" for name, x in zip(names, row, strict=True))
        yield paragraph(
            f"Wheel speeds must fit each other: {terms} turns nothing, and that part of given "
            "speeds slides.", "  ",
        )  # fmt: skip
    held = 3 - summary["held_directions"]
    if held:
        yield _owed(
            names, f"The contacts hold the sphere in {3 - held} of 3 directions; nothing holds it "
            f"along the other{'s' * (held > 1)}."
        )  # fmt: skip


def _owed(wheels: list[str], sentence: str) -> str:
    """What one or two wheels cannot do, more should: then the sentence is a warning."""
    warned = f"warning: {sentence[0].lower()}{sentence[1:]}" if len(wheels) > 2 else sentence
    return paragraph(warned, "  ")


def _axes(rows: list[list[float]]) -> str:
    return ", ".join(f"({', '.join(f'{x + 0.0:.3g}' for x in row)})" for row in rows)


def _weight(summary: dict[str, Any]) -> Iterator[str]:
    """What presses on the contacts without springs, and whether the preload has room for it."""
    weight = summary["weight"]
    if weight is None:
        return
    names = [wheel["name"] for wheel in summary["wheels"]]
    preload = [wheel["preload"] for wheel in summary["wheels"]]
    forces = ", ".join(f"{n} {x:.4g} N" for n, x in zip(names, weight["normal"], strict=True))
    yield paragraph(f"weight: {weight['force']:.4g} N of {weight['what']} press {forces}", "  ")
    low = [
        f"{n} ({p:.4g} N)"
        for n, p, x in zip(names, preload, weight["normal"], strict=True)
        if p < x * (1 - 1e-6)
    ]
    if low:
        yield paragraph(
            f"warning: the preload is the whole normal force at rest, and lies below the weight's "
            f"part at {', '.join(low)}.", "  ",
        )  # fmt: skip
    if min(weight["normal"]) < -1e-6 * weight["force"]:
        yield paragraph(
            "warning: where the weight's part is negative its wheel lifts off unless a spring "
            "presses more.", "  ",
        )  # fmt: skip
    if weight["missing"] > 1e-6 * weight["force"]:
        yield paragraph(
            f"warning: {weight['missing']:.4g} N of the weight act along no contact's normal.", "  "
        )


def _frequencies(summary: dict[str, Any]) -> Iterator[str]:
    counts: dict[str, int] = {}
    for f, ratio in zip(summary["natural_frequencies"], summary["damping_ratios"], strict=True):
        if f > 1e-6:
            key = f"{f:.4g} Hz ({100 * ratio:.3g} %)"
            counts[key] = counts.get(key, 0) + 1
    told = (f"{count} × {key}" if count > 1 else key for key, count in counts.items())
    laws = summary["modes_without"]
    of = f" without {listed(laws)}" if laws else ""
    yield paragraph(f"natural frequencies{of} (damping): {', '.join(told)}", "  ")
