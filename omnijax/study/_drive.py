"""Drives as plain numbers and back, and the quantities of a drive that a sweep may vary."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .._errors import InputError
from ..simulation import Signal, SpeedDrive, TorqueDrive
from ..simulation import speeds as speed_drive

Drive = SpeedDrive | TorqueDrive
_OPTIONAL = ("initial_angle", "initial_velocity")


def drive_to_plain(drive: Drive) -> dict[str, Any]:
    """The drive as nested dictionaries of numbers."""
    found: dict[str, Any] = {"kind": _kind(drive)}
    for name in (_kind(drive), "force"):
        signal = getattr(drive, name)
        parts = {"knots": signal.knots, "values": signal.values, "slopes": signal.slopes}
        found[name] = {key: np.asarray(part).tolist() for key, part in parts.items()}
    for name in _OPTIONAL:
        value = getattr(drive, name, None)
        if value is not None:
            found[name] = np.asarray(value).tolist()
    return found


def drive_from_plain(found: dict[str, Any]) -> Drive:
    """The drive that `drive_to_plain` described."""

    def signal(name):
        return Signal(*(jnp.asarray(found[name][k], float) for k in ("knots", "values", "slopes")))

    rest = {name: jnp.asarray(found[name], float) for name in _OPTIONAL if name in found}
    if found["kind"] == "speed":
        return SpeedDrive(speed=signal("speed"), force=signal("force"), **rest)
    return TorqueDrive(torque=signal("torque"), force=signal("force"), **rest)


def _kind(drive: Drive) -> str:
    return "speed" if isinstance(drive, SpeedDrive) else "torque"


def drive_quantities(drive: Drive, names: tuple[str, ...]) -> dict[str, tuple[str, Callable]]:
    """Path -> (unit, (drive, value) -> drive): `speed.w1`, `speed.scale`, `force.x`, ..."""
    kind, unit = _kind(drive), "rad/s" if isinstance(drive, SpeedDrive) else "N m"
    found: dict[str, tuple[str, Callable]] = {f"{kind}.scale": ("1", _scale(kind))}
    for i, name in enumerate(names):
        found[f"{kind}.{name}"] = (unit, _set(kind, i))
    for i, axis in enumerate("xyz"):
        found[f"force.{axis}"] = ("N", _set("force", i))
    return found | {"force.scale": ("1", _scale("force"))}


def _scale(name: str) -> Callable:
    def scaled(drive, value):
        signal = getattr(drive, name)
        new = Signal(signal.knots, signal.values * value, signal.slopes * value)
        return eqx.tree_at(lambda d: getattr(d, name), drive, new)

    return scaled


def _set(name: str, i: int) -> Callable:
    def replaced(drive, value):
        signal = getattr(drive, name)
        new = Signal(
            signal.knots, signal.values.at[:, i].set(value), signal.slopes.at[:, i].set(0.0)
        )
        return eqx.tree_at(lambda d: getattr(d, name), drive, new)

    return replaced


def is_constant(signal: Signal) -> bool:
    """Whether the signal has one value at all times."""
    values, slopes = np.asarray(signal.values), np.asarray(signal.slopes)
    return bool(np.all(slopes == 0) and np.all(values == values[0]))


def read_speeds(speeds: Any, names: tuple[str, ...]) -> Drive:
    """Constant wheel speeds (rad/s) as a drive; `InputError` for another number of wheels."""
    values = np.atleast_1d(np.asarray(speeds, float))
    if values.shape != (len(names),):
        raise InputError(
            f"`speed` must have one value a wheel ({len(names)}), but has {values.size}."
        )
    return speed_drive(values.tolist())
