"""The machine of `_problem` as a rig."""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

import omnijax
from omnijax import laws
from omnijax.rig import Closure, Contact, Mount, Platform, Rig, Sphere, Wheels
from omnijax.simulation import Operating

from . import _general
from . import _problem as problem
from ._clock import Tool

SIDE = 64  # designs along each side of a grid


def rig(row, torque_driven: bool = False) -> Rig:
    """Orthogonal rig with (eta, K, k, C) the same at all wheels."""
    eta, K, k, C = (x * jnp.ones(3) for x in row)
    one = jnp.ones(3)
    wheels = Wheels(
        normal=jnp.eye(3),
        drive=jnp.roll(jnp.eye(3), 1, axis=1),
        radius=problem.RB * one,
        mass=problem.MW * one,
        inertia=7.2e-4 * one,
        rollers=float(problem.N) * one,
        roundness=eta,
        contact=Contact(K, C, 0.9 * one),
        mount=Mount(k, problem.CM * one),
        closure=Closure(problem.KP * one, 20.0 * one),
    )
    inertia = jnp.diag(jnp.array([4.96, 4.5, 5.4]))
    sphere = Sphere(jnp.asarray(problem.R), jnp.asarray(problem.M), inertia, jnp.zeros(3))
    platform = Platform(jnp.asarray(5.0), jnp.zeros(3))
    made = Rig(sphere, platform, wheels, (laws.GatedSine(),) * 3, (), ("w1", "w2", "w3"))
    if torque_driven:
        made = made.add(laws.SpinResistance(jnp.asarray(4e-5), jnp.asarray(0.01)), "all")
    return made


def general_rig(count: int, row, effects: bool = False) -> Rig:
    """The rig of `_general`: unlike wheels in that layout; `effects` adds three linear laws."""
    one, (normal, drive) = jnp.ones(count), _general.layout(count)
    K, C = _general.stiffness(count, row)
    wheels = Wheels(
        normal=jnp.asarray(normal),
        drive=jnp.asarray(drive),
        radius=problem.RB * one,
        mass=problem.MW * one,
        inertia=7.2e-4 * one,
        rollers=float(problem.N) * one,
        roundness=row[0] * one,
        contact=Contact(K, C, 0.9 * one),
        mount=Mount(row[2] * one, problem.CM * one),
        closure=Closure(problem.KP * one, 20.0 * one),
    )
    sphere = Sphere(
        jnp.asarray(problem.R),
        jnp.asarray(problem.M),
        _general.INERTIA * jnp.eye(3),
        jnp.zeros(3),
    )
    platform = Platform(jnp.asarray(_general.PLATFORM), jnp.zeros(3))
    names = tuple(f"w{i + 1}" for i in range(count))
    made = Rig(sphere, platform, wheels, (laws.GatedSine(),) * count, (), names)
    if effects:
        made = made.add(laws.WheelRunout(jnp.asarray(4e-5), jnp.asarray(0.7)), "w2")
        made = made.add(laws.ContactRelaxation(jnp.asarray(2e4), jnp.asarray(0.02)), "w1")
        numbers = (0.05, 17.0, 0.3)
        floor = laws.FloorVibration(*map(jnp.asarray, numbers), jnp.asarray([0.36, 0.48, 0.8]))
        made = made.add(floor, "platform")
    return made


@functools.cache
def design(count: int, effects: bool = False):
    """The rig of a row at constant speeds, of `count` wheels or, 0, the orthogonal one.

    One function each: another one would be compiled anew.
    """
    speeds = jnp.asarray(_general.SPEEDS[:count] if count else problem.SPEEDS)

    def make(row) -> Operating:
        one = general_rig(count, row, effects) if count else rig(row)
        return Operating(one, speeds, jnp.zeros(3), jnp.zeros(len(speeds)))

    return make


def rigs(rows, torque_driven: bool = False) -> Rig:
    """All designs stacked."""
    return jax.vmap(lambda row: rig(row, torque_driven))(jnp.asarray(rows))


def figures(dR):
    """RMS and peak of |dR|; dR (..., t, 3) without the start."""
    square = jnp.sum(dR**2, axis=-1)
    return jnp.stack([jnp.sqrt(square.mean(-1)), jnp.sqrt(square.max(-1))], axis=-1)


def sweep_tool(one: Rig, row, speeds, model: str, error: Callable) -> Tool:
    """The whole `omnijax.sweep` of the rig of a row over roundness and mount stiffness, in memory.

    error(rows (b, 4), RMS and peak (b, 2)) of some of its designs.
    """
    roundness, stiffness = np.linspace(0.2, 0.6, SIDE), np.geomspace(3e5, 3e6, SIDE)
    vary = {"wheel.roundness": roundness, "mount.stiffness": stiffness}
    rows = np.array([(eta, row[1], k, row[3]) for eta in roundness for k in stiffness])
    run = functools.partial(
        omnijax.sweep, one, vary, ("rms", "peak"), speeds=list(speeds),
        duration=problem.DURATION, rate=1 / problem.STEP, model=model,
    )  # fmt: skip

    def missed(result) -> float:
        figures = np.stack([result["rms"].ravel(), result["peak"].ravel()], axis=1)
        return error(rows[::512], figures[::512])

    note = f"{len(rows)} designs by `omnijax.sweep` in memory, with statuses"
    return Tool("omnijax sweep", run, len(rows), missed, 5, note)
