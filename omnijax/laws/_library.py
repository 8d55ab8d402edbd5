"""The table of effects: id -> law, in the order of the file format; users' laws join it."""

import importlib.util
from pathlib import Path

from . import _actuators, _measurement, _ports, _rolling, _shape_effects, _springs, _torques
from ._base import AbstractLaw

EFFECTS: dict[str, type[AbstractLaw]] = {
    law.id: law
    for law in (
        _shape_effects.WheelRunout,
        _shape_effects.DamagedRoller,
        _shape_effects.SphereOutOfRound,
        _springs.ContactCubic,
        _springs.ContactHertz,
        _springs.ContactRelaxation,
        _springs.LiftOff,
        _springs.MountCubic,
        _springs.MountBacklash,
        _springs.MountFriction,
        _torques.BearingCoulomb,
        _torques.BearingViscous,
        _torques.MotorRipple,
        _actuators.MotorGain,
        _rolling.RollingResistance,
        _rolling.SpinResistance,
        _rolling.AirDrag,
        _rolling.Unbalance,
        _measurement.FloorVibration,
        _rolling.Creep,
        _measurement.SensorGain,
        _measurement.SensorDelay,
        _measurement.SensorDrift,
        _measurement.SensorCrosstalk,
        _shape_effects.WheelRadius,
        _torques.TorqueOffset,
        _actuators.ActuatorDelay,
        _actuators.ActuatorLag,
        _actuators.ActuatorSaturation,
        _torques.Cogging,
        _actuators.CurrentRipple,
        _torques.Stribeck,
        _torques.LoadFriction,
        _torques.FrictionAsymmetry,
        _measurement.EncoderEccentricity,
        _measurement.SensorLag,
        _measurement.SensorSaturation,
        _measurement.SensorRectified,
    )
}


def in_words(effect: str, place: str) -> str:
    """An effect as a mechanic says it, "play in the mount at w2"; its id where it has no words."""
    law = EFFECTS.get(effect)
    words = law.words if law is not None and law.words else f"`{effect}`"
    if place in ("sphere", "platform"):
        return words
    return f"{words} at {'every wheel' if place == 'all' else place}"


PORTS = tuple(
    port.port
    for port in (
        _ports.AbstractRadius,
        _ports.AbstractShape,
        _ports.AbstractSurface,
        _ports.AbstractContact,
        _ports.AbstractSeparation,
        _ports.AbstractMount,
        _ports.AbstractCommand,
        _ports.AbstractActuator,
        _ports.AbstractShaft,
        _ports.AbstractRolling,
        _ports.AbstractBody,
        _ports.AbstractPlatform,
        _ports.AbstractKinematics,
        _ports.AbstractSensor,
    )
)


def load_laws(path: str | Path) -> dict[str, type[AbstractLaw]]:
    """The user's own laws of a Python file: every final law class defined in it that has an `id`.

    Raises `ValueError` where the file cannot be read or run, or defines no law.
    """
    path = Path(path)
    spec = importlib.util.spec_from_file_location(f"omnijax_user_{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise ValueError(f"{path}: no such Python file of laws.")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # whatever the user's file does wrong is the user's to know
        raise ValueError(f"{path}: cannot be run: {type(error).__name__}: {error}") from error
    laws = {
        value.id: value
        for value in vars(module).values()
        if isinstance(value, type)
        and issubclass(value, AbstractLaw)
        and value.__module__ == module.__name__
        and value.id
    }
    if not laws:
        raise ValueError(
            f"{path}: defines no law. A law is a class that derives from one of omnijax.laws' "
            "Abstract… ports and has an `id`."
        )
    for name, law in laws.items():
        if law.port not in PORTS:
            raise ValueError(f"{path}: law `{name}` has port {law.port!r}; ports are {PORTS}.")
    return laws
