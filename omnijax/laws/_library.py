"""The table of effects: id -> law, in the order of the file format; users' laws join it."""

import signal
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .._reading import TEXT, read_bytes
from .._users_module import run_module
from . import _actuators, _measurement, _ports, _rolling, _shape_effects, _springs, _torques
from ._base import AbstractLaw, Parameter, defaults_of, field_names
from ._generic import GENERIC

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

AXIS_EFFECTS = {**EFFECTS, **GENERIC}  # that an axis, or a model of the user's own, may have


def of_library(
    law: AbstractLaw | type[AbstractLaw], known: Mapping[str, type[AbstractLaw]] = AXIS_EFFECTS
) -> bool:
    """Whether a law, or a class of laws, is one of `known` itself; a user's below one is not."""
    kind = law if isinstance(law, type) else type(law)
    return known.get(kind.id) is kind


def in_words(effect: str, place: str, laws: Mapping[str, type[AbstractLaw]] = AXIS_EFFECTS) -> str:
    """An effect as a mechanic says it, "play in the mount at w2"; its id where it has no words.

    `laws` by id: a user's own beside those of the library, whose words hold where it has none.
    """
    law = laws.get(effect, AXIS_EFFECTS.get(effect))
    words = law.words if law is not None and law.words else f"`{effect}`"
    if place in ("sphere", "platform", "axis"):
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


LINEAR_PORTS = ("contact", "mount")  # whose laws may say that they are linear

RUN_LIMIT = 8  # s; a file that only declares is done in a fraction of one


def load_laws(path: str | Path) -> dict[str, type[AbstractLaw]]:
    """The user's own laws of a Python file: every final law class defined in it that has an `id`.

    The file is run.  Raises `ValueError` where it cannot be read or run, or defines no law.
    """
    path = Path(path)
    try:
        text = read_bytes(path, TEXT)
    except OSError:
        raise ValueError(f"{path}: no such Python file of laws.") from None
    return laws_of(text, path)


def laws_of(text: bytes, path: Path) -> dict[str, type[AbstractLaw]]:
    """The laws of a file's text, run as it is: no byte code that lies beside it is looked at.

    Raises `ValueError` where the text cannot be run or declares no law as laws are declared.
    """
    try:
        with _limited(RUN_LIMIT):
            module = run_module(text, path)
    except (Exception, SystemExit) as error:  # what the user's file does wrong is the user's
        said = f"{type(error).__name__}: {error}".strip(": ")
        raise ValueError(f"{path}: cannot be run: {said}") from None
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
        formula = law.__call__ is not AbstractLaw.__call__
        own = (law.port, law.places, law.parameters, field_names(law), defaults_of(law))
        said = vars(law).get("linear", False)
        wrong = declaration_problem(name, *own, formula) or linear_problem(
            name, law.port, said, field_names(law)
        )
        if wrong is not None:
            raise ValueError(f"{path}: {wrong}")
    return laws


def declaration_problem(
    name: Any,
    port: Any,
    places: Any,
    parameters: Any,
    fields: Iterable[str],
    defaults: Iterable[str],
    formula: bool,
) -> str | None:
    """What of a class's declarations is not as a law's are.

    `fields` are its fields, `defaults` those that have one; `formula`: has it a `__call__`.
    """
    if not isinstance(name, str):
        return f"the `id` of a law must be text, but is {name!r}."
    if port not in PORTS:
        return f"law `{name}` has port {port!r}; ports are {PORTS}."
    if not formula:
        return f"law `{name}` has no formula: give it `__call__(self, signal)`."
    if not isinstance(places, tuple) or not all(isinstance(p, str) for p in places):
        return f"law `{name}`: `places` must be a tuple of texts."
    if not isinstance(parameters, dict) or not all(
        isinstance(k, str) and isinstance(v, Parameter) for k, v in parameters.items()
    ):
        return f"law `{name}`: `parameters` must map names to Parameter(...)."
    return _fields_problem(name, parameters, fields, defaults)


def linear_problem(name: str, port: str, linear: Any, fields: Iterable[str]) -> str | None:
    """What is wrong with `linear`, as a class says it; a field of that name is a parameter."""
    if "linear" in fields or linear is False:
        return None
    if linear is not True:
        return f"law `{name}`: `linear` must be True or False, but is {linear!r}."
    if port in LINEAR_PORTS:
        return None
    return (
        f"law `{name}` says `linear = True`, which means something at {' and '.join(LINEAR_PORTS)} "
        f"alone, but its port is `{port}`."
    )


def _fields_problem(
    name: str, parameters: dict[str, Parameter], fields: Iterable[str], defaults: Iterable[str]
) -> str | None:
    differ = ", ".join(sorted(set(parameters) ^ set(fields)))
    if differ:
        return f"law `{name}`: its fields and `parameters` differ: {differ}."
    bare = [key for key, known in parameters.items() if known.optional and key not in defaults]
    return f"law `{name}`: optional, but its field has no default: {bare[0]}." if bare else None


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """`TimeoutError` after `seconds`, where signals can be had (the main thread of a Unix)."""
    main = threading.current_thread() is threading.main_thread()
    if not (hasattr(signal, "setitimer") and main):
        yield
        return

    def stop(*_: object) -> None:
        raise TimeoutError(f"it did not end within {seconds:g} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
