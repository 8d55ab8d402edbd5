"""`omnijax orders`: which orders of a wheel or of the sphere a run holds."""

import sys
from pathlib import Path
from typing import Any, Literal

from .._files import claim
from .._reading import existing
from ._console import columns
from ._inputs import Force, Json, command_line, emit

TRACKED = 4  # orders followed where none are asked for


def orders(
    run: Path,
    /,
    *,
    channel: str = "dR_x",
    reference: str = "1",
    turns: float = 4.0,
    max_order: float | None = None,
    amplitude: Literal["peak", "rms", "power"] = "peak",
    window: Literal["hann", "flattop"] = "hann",
    track: str | None = None,
    rig: str | None = None,
    out: Path | None = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Order analysis of a run: the map, the waterfall and single orders over time.

    Example: omnijax orders run.nc --channel distance --reference w2 --out orders

    Example: omnijax orders run-1.csv.gz --channel a_z --reference sphere --track 9,18

    Parameters
    ----------
    run
        A run saved by `omnijax simulate`, or a recording.
    channel
        A channel such as dR_x or a_z, or `distance` for |ΔR|.
    reference
        What turns once an order: a wheel's name or number, or `sphere`.
    turns
        Length of a window in turns; longer windows tell closer orders apart.
    max_order
        Highest order of the map.
    amplitude
        What of the sine at an order is shown: its peak, its RMS, or its power (mean square).
    window
        Window over the turns: hann, or flattop for truer heights and wider lines.
    track
        Orders to follow over time (9,18); the strongest where none are given.
    rig
        The rig of a recording, which names the passing of rollers; a saved run knows its own.
    out
        Folder of the page, its pictures and CSVs.
    """
    existing(run)
    from ..report import orders_page, provenance, strongest_orders

    measured, machine = _run(run, rig)
    reference = _known_to(measured, machine, reference)
    claim(folders=[out], force=force)
    how = {"turns": turns, "amplitude": amplitude, "window": window}
    order_map, followed = _analysed(run, measured, (channel, reference), max_order, track, how)
    passing = _passing(measured, machine, reference)
    table = strongest_orders(order_map, passing)
    page = None
    if out is not None:
        from ..rig import rig_text

        text = "" if machine is None else rig_text(machine)
        made = provenance(command_line(), text)
        page = str(orders_page(order_map, followed, made, passing).write(out))
    names = ("order", amplitude, "hz", "meaning")
    data = {"reference": order_map.reference, "channel": channel, "page": page}
    rows = [dict(zip(names, row, strict=True)) for row in table.rows]
    emit(json, data | {"orders": rows}, lambda: _print(order_map, table, page))


def _run(path: Path, rig: str | None) -> tuple[Any, Any]:
    """The run and its rig, None where a recording names none."""
    from ..rig import load_rig

    if path.name.endswith(".nc"):
        from ..simulation import load_run
        from ..view import rig_of_run

        return load_run(path), rig_of_run(path)
    from ..recording import read_recording, rig_of_recording

    named = rig or rig_of_recording(path)
    machine = None if named is None else load_rig(named)  # first: it tells wrong units
    recording = read_recording(path, machine)
    for fault in recording.faults:
        print(f"warning: {fault}", file=sys.stderr)
    return recording, machine


def _known_to(run: Any, rig: Any, reference: str) -> str:
    """The reference as `run` knows it: a recording's columns have numbers, its rig has names."""
    from ..recording import Recording

    if isinstance(run, Recording) and rig is not None and reference in rig.names:
        return str(rig.names.index(reference) + 1)
    return reference


def _analysed(
    file: Path, run: Any, what: tuple[str, str], max_order: float | None, track: str | None,
    how: dict[str, Any],
) -> tuple[Any, Any]:  # fmt: skip
    """The map of a channel over a reference's orders, and the orders followed over time."""
    from .._errors import InputError
    from ..vibration import order_track, rpm_order_map

    try:
        order_map = rpm_order_map(run, *what, max_order=max_order, **how)
        chosen = _orders(track) or [order for order, _ in order_map.strongest(TRACKED)]
        if not chosen:
            raise ValueError(f"`{what[0]}` has no orders: it does not move.")
        how = {key: how[key] for key in ("turns", "amplitude")}
        return order_map, order_track(run, chosen, *what, **how)
    except ValueError as error:
        raise InputError(f"{file.name}: {error}") from error


def _orders(text: str | None) -> list[float]:
    try:
        return [float(part) for part in text.split(",")] if text else []
    except ValueError:
        raise ValueError(f"`track` must be orders such as 9,18, but is {text!r}.") from None


def _passing(run: Any, rig: Any, reference: str) -> dict[str, float]:
    """Order at which each wheel's rollers pass, by its name; none where the rig is not known."""
    from ..vibration import roller_orders

    if rig is None:
        return {}
    orders = roller_orders(run, [float(x) for x in rig.wheels.rollers], reference)
    return {rig.names[int(number) - 1]: order for number, order in orders.items()}


def _print(order_map: Any, table: Any, page: str | None) -> None:
    unit = table.columns[1].unit
    count = len(order_map.time)
    windows = f"{count} window{'s' * (count > 1)} of {order_map.turns:.3g} turns"
    print(f"{order_map.channel} over the orders of {order_map.reference}, {windows}")
    rows = [["order", f"{order_map.kind} ({unit})", "frequency (Hz)", "what repeats so often"]]
    rows += [[f"{order:5.2f}", f"{level:.4g}", hz, why] for order, level, hz, why in table.rows]
    print("\n".join(columns(rows)))
    if page:
        print(f"page: {page}")
