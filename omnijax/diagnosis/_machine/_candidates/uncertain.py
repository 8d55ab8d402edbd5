"""What the rig file leaves open: numbers, tilts of directions, angles, gains and delays of sensors.

Values, tensors and vectors of effects are scaled: value exp(sigma u).  A direction, gravity's too,
is tilted by two small angles about the axes across it; `zenith`, `azimuth` and `skew` of a wheel
are turned by an angle, the sphere's centre of mass is shifted along each axis, a sensor has a gain
1 + g and a delay d; these are 0 as stated.
"""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from ...._errors import InputError
from ...._programs import kept
from ....laws import EFFECTS
from ....rig import (
    ANGLES,
    CENTRE,
    DIRECTIONS,
    GRAVITY,
    SENSOR,
    Rig,
    closed_numbers,
    get_parameter,
    parameter_info,
    put_parameter,
    uncertain_numbers,
)
from ..._search import Prior, number

ACROSS = ("first", "second")
AXES = ("x", "y", "z")
UNITS = {"gain": "1", "delay": "s"}


def rig_priors(rig: Rig) -> list[Prior]:
    """The rig's uncertain parameters, one a wheel.

    Raises `InputError` for what is listed and cannot be open: a share of 0, a tilt of no gravity.
    """
    if wrong := closed_numbers(rig):
        raise InputError(wrong)
    return [
        prior for key, sigma in uncertain_numbers(rig).items() for prior in _priors(rig, key, sigma)
    ]


def _priors(rig: Rig, key: str, sigma: float) -> list[Prior]:
    last = key.rpartition(".")[2]
    if key.split(".", maxsplit=1)[0] == SENSOR:
        return [Prior(key, 0.0, sigma, relative=False, unit=UNITS[last])]
    if last in DIRECTIONS or key == GRAVITY:
        return [Prior(f"{key}.{a}", 0.0, sigma, relative=False, unit="rad") for a in ACROSS]
    if last in ANGLES:
        return [Prior(key, 0.0, sigma, relative=False, unit="rad")]
    value = np.asarray(get_parameter(rig, key))
    if key == CENTRE:
        pairs = zip(AXES, value.tolist(), strict=True)
        return [Prior(f"{key}.{a}", x, sigma, relative=False, unit="m") for a, x in pairs]
    if value.ndim:  # tensors, and vectors of effects, are scaled as a whole
        return [Prior(key, 1.0, sigma, unit="1")]
    return [Prior(key, float(value), sigma, unit=parameter_info(rig, key).unit)]


@kept
def with_parameters(rig: Rig, paths: tuple[str, ...], values) -> Rig:
    """The rig with `values` at `paths`; compiled, since it is asked for at every residual."""
    for path, value in zip(paths, values, strict=True):
        head, _, last = path.rpartition(".")
        if last in ACROSS:
            rig = _tilted(rig, head, ACROSS.index(last), value)
        elif head == CENTRE:
            centre = jnp.asarray(get_parameter(rig, CENTRE)).at[AXES.index(last)].set(value)
            rig = put_parameter(rig, CENTRE, centre)
        elif last in ANGLES:
            rig = _turned(rig, head, last, value)
        elif path.split(".")[0] != SENSOR:
            old = get_parameter(rig, path)
            rig = put_parameter(rig, path, old * value if old.ndim else value)
    return rig


def _tilted(rig: Rig, path: str, which: int, angle) -> Rig:
    """A vector turned by `angle` towards one of two axes across it."""
    stated = jnp.asarray(get_parameter(rig, path))
    size = jnp.linalg.norm(stated)
    along = stated / size
    axis = jnp.eye(3)[jnp.argmin(jnp.abs(along))]
    first = jnp.cross(along, axis)
    first = first / jnp.linalg.norm(first)
    towards = first if which == 0 else jnp.cross(along, first)
    return put_parameter(rig, path, size * (jnp.cos(angle) * along + jnp.sin(angle) * towards))


def _turned(rig: Rig, wheel: str, angle: str, by) -> Rig:
    """A wheel whose zenith, azimuth or skew is larger by `by` (rad); see `rig._directions`.

    At the poles, where a wheel has no azimuth, its zenith turns it about `drive`.
    """
    normal, drive = (jnp.asarray(get_parameter(rig, f"{wheel}.{key}")) for key in DIRECTIONS)
    up = jnp.array([0.0, 0.0, 1.0])
    level = jnp.cross(normal, up)  # along the circle of latitude, as the azimuth grows
    size = jnp.linalg.norm(level)
    level = jnp.where(size > POLE, level / jnp.where(size > POLE, size, 1.0), drive)
    axis = {"zenith": level, "azimuth": up, "skew": normal}[angle]
    for key, vector in zip(DIRECTIONS, (normal, drive), strict=True):
        rig = put_parameter(rig, f"{wheel}.{key}", _about(axis, vector, by))
    return rig


POLE = 1e-9  # of a wheel's distance from the axis of azimuths, over the sphere's radius


def _about(axis, vector, angle):
    """`vector` turned about the unit vector `axis` (Rodrigues)."""
    along = axis * (axis @ vector)
    return along + jnp.cos(angle) * (vector - along) + jnp.sin(angle) * jnp.cross(axis, vector)


def with_sensors(rig: Rig, paths: Sequence[str], values) -> Rig:
    """The rig with the sensors' uncertain gains and delays as laws of theirs."""
    for path, value in zip(paths, values, strict=True):
        head, *middle, last = path.split(".")
        if head == SENSOR and value != 0:
            law = EFFECTS[f"sensor-{last}"](number(value))  # pyright: ignore[reportCallIssue]
            rig = rig.add(law, middle[0])
    return rig
