"""Bounds of the numbers that a refit of a machine's laws may change."""

from ..._search import AbstractModel, Free, Point, free_numbers
from ..._settings import SETTINGS
from .candidates import Scales

GAIN_BOUND = SETTINGS.free_model.gain_bound
ORDER_RANGE = SETTINGS.free_model.order_range
SLOWEST_FRICTION = SETTINGS.free_model.slowest_friction
FASTEST_FRICTION = SETTINGS.free_model.fastest_friction
LIMIT_RANGE = SETTINGS.free_model.limit_range
TIME_RANGE = SETTINGS.free_model.time_range


def ranges_of(model: AbstractModel, point: Point, scales: Scales, resolution: float) -> list[Free]:
    """Gains within half of what is stated, orders and times about where they begin.

    `resolution` are the orders that the data tell apart.
    """
    out = []
    for f in free_numbers(model, point):
        value = point.effects[f.effect].values[f.key]
        low, high = f.low, f.high
        wave = (point.effects[f.effect].id, f.key) == ("encoder-eccentricity", "amplitude")
        if f.key == "g" or wave:  # what an encoder's wave changes of its slope is a gain too
            low, high = -GAIN_BOUND, GAIN_BOUND
        if f.key == "order":  # over few turns a line is wide
            wide = max(ORDER_RANGE * float(value), resolution / 2)
            low, high = max(float(value) - wide, 0.0), float(value) + wide
        if f.key in ("width", "speed"):  # as narrow as shows, as wide as the speeds
            low, high = SLOWEST_FRICTION * scales.speed, FASTEST_FRICTION * scales.speed
        if f.key == "limit":
            low, high = float(value) / LIMIT_RANGE, float(value) * LIMIT_RANGE
            if model.laws[point.effects[f.effect].id].port == "actuator":
                high = max(float(scales.torques[-1]), float(value))
        if f.key in ("tau", "delay"):
            low, high = max(low, float(value) / TIME_RANGE), min(high, float(value) * TIME_RANGE)
        out.append(Free(f.effect, f.key, f.index, low, high))
    return out
