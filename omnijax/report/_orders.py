"""The page of an order analysis: the strongest orders, the map, the waterfall and the tracks."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from .._plot import SCALES
from .._text import listed
from ..vibration import OrderMap, OrderTrack, name_of
from ._axis import SpeedAxis
from ._content import Column, Fact, Figure, Provenance, Section, Table, shown
from ._page import Page
from ._style import figure, style

STRONGEST = 8  # orders of the table
MULTIPLES = 12  # of a roller passing that are still called so


def orders_page(
    order_map: OrderMap,
    track: OrderTrack,
    made: Provenance,
    passing: Mapping[str, float] | None = None,
) -> Page:
    """One offline page of an `OrderMap` and the tracks of its orders.

    `passing` gives the order at which each wheel's rollers pass (`roller_orders`), by the wheel's
    name; whole multiples of it are named.
    """
    factor, unit = SCALES.get(order_map.unit, (1.0, order_map.unit))
    table = strongest_orders(order_map, passing)
    order, name = table.rows[0][0], name_of(order_map.channel)
    level = f"{shown(table.rows[0][1])} {unit} {order_map.kind}"
    answer = f"Order {shown(order)} of {order_map.reference} is the strongest in {name} ({level})"
    why = table.rows[0][3]
    return Page(
        title="Orders",
        question=f"Which orders of {order_map.reference} shake {name}?",
        answer=f"{answer}: {why}." if why else f"{answer}.",
        facts=[
            Fact("slowest", float(order_map.speed.min()), "rpm"),
            Fact("fastest", float(order_map.speed.max()), "rpm"),
            Fact("windows", len(order_map.time)),
            Fact("turns of a window", order_map.turns),
        ],
        sections=[
            Section(
                "Strongest orders", figures=[_spectrum(order_map, factor, unit)], tables=[table]
            ),
            _over_the_run(order_map, track, factor, unit),
        ],
        provenance=made,
    )


MAP = (
    "A line that stays at its order as the speed changes comes from what turns; one that bends "
    "as a hyperbola stays at its frequency: a resonance or the floor. Grey: the sampling is too "
    "slow to tell this order from a folded one."
)
ONE = (
    "The run is one window long, so that nothing shows over time: a longer run does, or shorter "
    "windows (`--turns`)."
)


def _over_the_run(order_map: OrderMap, track: OrderTrack, factor: float, unit: str) -> Section:
    """How the orders change; one window has no course."""
    if len(order_map.time) == 1:
        return Section("Over the run", ONE)
    return Section(
        "Over the run", MAP, [*_map(order_map, factor, unit), *_track(track, factor, unit)]
    )


def strongest_orders(
    order_map: OrderMap, passing: Mapping[str, float] | None = None, count: int = STRONGEST
) -> Table:
    """Orders with the highest RMS amplitude over the windows; first the largest."""
    factor, unit = SCALES.get(order_map.unit, (1.0, order_map.unit))
    low, high = order_map.speed.min() / 60, order_map.speed.max() / 60
    resolution = 2 * (order_map.orders[1] - order_map.orders[0])
    rows = []
    for order, level in order_map.strongest(count):
        hertz = shown(order * low)
        if shown(order * high) != hertz:
            hertz = f"{hertz} to {shown(order * high)}"
        rows.append([order, factor * level, hertz, _meaning(order, passing or {}, resolution)])
    columns = [
        Column("order"), Column(f"{order_map.kind} amplitude", unit),
        Column("frequency", "Hz", text=True, minor=True),
        Column("what repeats so often", text=True),
    ]  # fmt: skip
    return Table(columns, rows, "strongest-orders", f"Orders of {order_map.reference}.")


def _meaning(order: float, passing: Mapping[str, float], resolution: float) -> str:
    """The lowest multiple of a roller passing that fits, of every wheel that has it."""
    fits = [
        (times, name)
        for name, first in passing.items()
        for times in [round(order / first)]
        if 1 <= times <= MULTIPLES and abs(order - times * first) <= resolution
    ]
    if fits:
        least, _ = min(fits)
        wheels = [name for times, name in fits if times == least]
        if len(wheels) == 1:
            return f"{least} × the passing of wheel {wheels[0]}'s rollers"
        return f"{least} × the passing of the rollers of wheels {listed(wheels)}"
    return "once a turn" if abs(order - 1) <= resolution else ""


def _spectrum(order_map: OrderMap, factor: float, unit: str) -> Figure:
    """The average over the run; other units of its axis hold at the mean speed."""
    turning = float(order_map.speed.mean()) * np.pi / 30
    over_frequency = dataclasses.replace(order_map, orders=order_map.orders * turning)
    with style():
        fig, (ax,) = figure(height=3.4)
        over_frequency.plot_spectrum(ax=ax)
    data = {
        "order / 1": order_map.orders,
        "frequency / Hz": order_map.orders * turning / (2 * np.pi),
    }
    data[f"{order_map.channel}, {order_map.kind} / {unit}"] = factor * order_map.spectrum()
    mean = f"{shown(float(order_map.speed.mean()))} rpm"
    words = f"Root mean square over the windows; rpm, rad/s and Hz at the mean speed of {mean}."
    axis = SpeedAxis(f"order of {order_map.reference}", "orders", reference=turning)
    return Figure(fig, "order-spectrum", words, data, axis)


def _map(order_map: OrderMap, factor: float, unit: str) -> list[Figure]:
    window, order = np.meshgrid(order_map.time, order_map.orders, indexing="ij")
    speed = np.broadcast_to(order_map.speed[:, None], window.shape)
    keep = np.isfinite(order_map.amplitude) & (
        order_map.amplitude > 0.01 * np.nanmax(order_map.amplitude)
    )
    data: dict[str, Any] = {
        "time / s": window[keep],
        "speed / rpm": speed[keep],
        "order / 1": order[keep],
        f"{order_map.channel} / {unit}": factor * order_map.amplitude[keep],
    }
    drawn = []
    with style():
        for name, caption, draw, height in (
            ("order-map", "Amplitude over orders and time; cells above 1 % in the CSV.",
             order_map.plot, 4.4),
            ("waterfall", "One spectrum above the other; the bar at the right is the scale.",
             order_map.plot_waterfall, 5.0),
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
