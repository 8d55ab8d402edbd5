"""The page of an order analysis: the strongest orders, the map, the waterfall and the tracks."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from .._plot import SCALES
from ..vibration import OrderMap, OrderTrack, name_of
from ._axis import SpeedAxis
from ._content import Column, Fact, Figure, Provenance, Section, Table, shown
from ._page import Page
from ._style import figure, style

STRONGEST = 8  # orders of the table
MULTIPLES = 12  # of a roller passing that are still called so


def orders_page(
    found: OrderMap,
    track: OrderTrack,
    made: Provenance,
    passing: Mapping[str, float] | None = None,
) -> Page:
    """One offline page of an `OrderMap` and the tracks of its orders.

    `passing` gives the order at which each wheel's rollers pass (`roller_orders`), by the wheel's
    name; whole multiples of it are named.
    """
    factor, unit = SCALES.get(found.unit, (1.0, found.unit))
    table = strongest_orders(found, passing)
    order, name = table.rows[0][0], name_of(found.channel)
    level = f"{shown(table.rows[0][1])} {unit} {found.kind}"
    answer = f"Order {shown(order)} of {found.reference} is the strongest in {name} ({level})"
    why = table.rows[0][3]
    return Page(
        title="Orders",
        question=f"Which orders of {found.reference} shake {name}?",
        answer=f"{answer}: {why}." if why else f"{answer}.",
        facts=[
            Fact("slowest", float(found.speed.min()), "rpm"),
            Fact("fastest", float(found.speed.max()), "rpm"),
            Fact("windows", len(found.time)),
        ],
        sections=[
            Section("Strongest orders", figures=[_spectrum(found, factor, unit)], tables=[table]),
            Section(
                "Over the run", MAP, [*_map(found, factor, unit), *_track(track, factor, unit)]
            ),
        ],
        provenance=made,
    )


MAP = (
    "A line that stays at its order as the speed changes comes from what turns; one that bends "
    "as a hyperbola stays at its frequency: a resonance or the floor. Grey: the sampling is too "
    "slow to tell this order from a folded one."
)


def strongest_orders(
    found: OrderMap, passing: Mapping[str, float] | None = None, count: int = STRONGEST
) -> Table:
    """Orders with the highest RMS amplitude over the windows; first the largest."""
    factor, unit = SCALES.get(found.unit, (1.0, found.unit))
    low, high = found.speed.min() / 60, found.speed.max() / 60
    resolution = 2 * (found.orders[1] - found.orders[0])
    rows = []
    for order, level in found.strongest(count):
        hertz = shown(order * low)
        if shown(order * high) != hertz:
            hertz = f"{hertz} to {shown(order * high)}"
        rows.append([order, factor * level, hertz, _meaning(order, passing or {}, resolution)])
    columns = [
        Column("order"), Column(f"{found.kind} amplitude", unit),
        Column("frequency", "Hz", text=True, minor=True),
        Column("what repeats so often", text=True),
    ]  # fmt: skip
    return Table(columns, rows, "strongest-orders", f"Orders of {found.reference}.")


def _meaning(order: float, passing: Mapping[str, float], resolution: float) -> str:
    """The lowest multiple of a wheel's roller passing that fits."""
    fits = [
        (times, name)
        for name, first in passing.items()
        for times in [round(order / first)]
        if 1 <= times <= MULTIPLES and abs(order - times * first) <= resolution
    ]
    if fits:
        times, name = min(fits)
        return f"{times} × the passing of wheel {name}'s rollers"
    return "once a turn" if abs(order - 1) <= resolution else ""


def _spectrum(found: OrderMap, factor: float, unit: str) -> Figure:
    """The average over the run; other units of its axis hold at the mean speed."""
    turning = float(found.speed.mean()) * np.pi / 30
    over_frequency = dataclasses.replace(found, orders=found.orders * turning)
    with style():
        fig, (ax,) = figure(height=3.4)
        over_frequency.plot_spectrum(ax=ax)
    data = {"order / 1": found.orders, "frequency / Hz": found.orders * turning / (2 * np.pi)}
    data[f"{found.channel}, {found.kind} / {unit}"] = factor * found.spectrum()
    mean = f"{shown(float(found.speed.mean()))} rpm"
    words = f"Root mean square over the windows; rpm, rad/s and Hz at the mean speed of {mean}."
    axis = SpeedAxis(f"order of {found.reference}", "orders", reference=turning)
    return Figure(fig, "order-spectrum", words, data, axis)


def _map(found: OrderMap, factor: float, unit: str) -> list[Figure]:
    window, order = np.meshgrid(found.time, found.orders, indexing="ij")
    speed = np.broadcast_to(found.speed[:, None], window.shape)
    keep = np.isfinite(found.amplitude) & (found.amplitude > 0.01 * np.nanmax(found.amplitude))
    data: dict[str, Any] = {
        "time / s": window[keep],
        "speed / rpm": speed[keep],
        "order / 1": order[keep],
        f"{found.channel} / {unit}": factor * found.amplitude[keep],
    }
    drawn = []
    with style():
        for name, caption, draw, height in (
            ("order-map", "Amplitude over orders and time; cells above 1 % in the CSV.",
             found.plot, 4.4),
            ("waterfall", "One spectrum above the other; the bar at the right is the scale.",
             found.plot_waterfall, 5.0),
        ):  # fmt: skip
            fig, (ax,) = figure(height=height)
            draw(ax=ax)
            drawn.append(Figure(fig, name, caption, data if name == "order-map" else {}))
    return drawn


def _track(track: OrderTrack, factor: float, unit: str) -> list[Figure]:
    with style():
        fig, (ax,) = figure(height=4.2)
        track.plot(ax=ax)
    data: dict[str, Any] = {"time / s": track.time, "speed / rpm": track.speed}
    for i, order in enumerate(track.orders):
        data[f"order {order:g} / {unit}"] = factor * track.amplitude[:, i]
        data[f"phase of order {order:g} / rad"] = track.phase[:, i]
    words = "Amplitude of single orders; dashed where the sampling alone cannot tell them."
    return [Figure(fig, "order-tracks", words, data)]
