"""What the rig file leaves open: numbers, tilts of directions, gains and delays of sensors.

Values and tensors are scaled: value exp(sigma u).  A direction is tilted by two small angles about
the axes across it, a sensor has a gain 1 + g and a delay d; these are 0 as stated.
"""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ...laws import EFFECTS
from ...rig import Rig, get_parameter, parameter_info, put_parameter
from .._search import Prior, number

DIRECTIONS, SENSOR = ("normal", "drive"), "sensor"
ACROSS = ("first", "second")
UNITS = {"gain": "1", "delay": "s"}


def rig_priors(rig: Rig) -> list[Prior]:
    """The rig's uncertain parameters, one a wheel."""
    sigmas: dict[str, float] = {}
    for path, sigma in rig.uncertainty:
        parts = path.split(".")
        if parts[0] in ("contact", "mount", "closure"):
            keys = [f"wheel.{n}.{path}" for n in rig.names]
        elif parts[0] == "wheel" and parts[1] not in rig.names:
            keys = [f"wheel.{n}.{'.'.join(parts[1:])}" for n in rig.names]
        else:
            keys = [path]
        explicit = len(keys) == 1
        for key in keys:
            if explicit or key not in sigmas:
                sigmas[key] = sigma
    return [prior for key, sigma in sigmas.items() for prior in _priors(rig, key, sigma)]


def _priors(rig: Rig, key: str, sigma: float) -> list[Prior]:
    last = key.rpartition(".")[2]
    if key.split(".", maxsplit=1)[0] == SENSOR:
        return [Prior(key, 0.0, sigma, relative=False, unit=UNITS[last])]
    if last in DIRECTIONS:
        return [Prior(f"{key}.{a}", 0.0, sigma, relative=False, unit="rad") for a in ACROSS]
    value = np.asarray(get_parameter(rig, key))
    if value.ndim == 2:  # a tensor is scaled as a whole
        return [Prior(key, 1.0, sigma, unit="1")]
    if value.ndim or value <= 0:
        return []
    return [Prior(key, float(value), sigma, unit=parameter_info(rig, key).unit)]


@eqx.filter_jit
def with_parameters(rig: Rig, paths: tuple[str, ...], values) -> Rig:
    """The rig with `values` at `paths`; compiled, since it is asked for at every residual."""
    for path, value in zip(paths, values, strict=True):
        head, _, last = path.rpartition(".")
        if last in ACROSS:
            rig = _tilted(rig, head, ACROSS.index(last), value)
        elif path.split(".")[0] != SENSOR:
            old = get_parameter(rig, path)
            rig = put_parameter(rig, path, old * value if old.ndim == 2 else value)
    return rig


def _tilted(rig: Rig, path: str, which: int, angle) -> Rig:
    """A direction turned by `angle` towards one of two axes across it."""
    stated = jnp.asarray(get_parameter(rig, path))
    axis = jnp.eye(3)[jnp.argmin(jnp.abs(stated))]
    first = jnp.cross(stated, axis)
    first = first / jnp.linalg.norm(first)
    towards = first if which == 0 else jnp.cross(stated, first)
    return put_parameter(rig, path, jnp.cos(angle) * stated + jnp.sin(angle) * towards)


def with_sensors(rig: Rig, paths: Sequence[str], values) -> Rig:
    """The rig with the sensors' uncertain gains and delays as laws of theirs."""
    for path, value in zip(paths, values, strict=True):
        head, *middle, last = path.split(".")
        if head == SENSOR and value != 0:
            law = EFFECTS[f"sensor-{last}"](number(value))  # pyright: ignore[reportCallIssue]
            rig = rig.add(law, middle[0])
    return rig
