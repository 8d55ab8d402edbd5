"""Runge-Kutta steps of a free run: chosen by the slopes that it meets, proved by the run itself."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._field import vector_field

STABLE = 2.2  # decay of a mode within a Runge-Kutta step that is surely stable
EXACT = 0.3  # rad of a mode within a step, at most: its frequency is right to 1e-4
PHASE = 1e-3  # rad by which a mode may be late at the end of a run, or when it has died away
LONGEST = 10**7  # steps of a whole run
MOST = 256  # steps between two places, of a run however long
MORE = 8  # times as many steps at a time: states of a run that fell apart say too much
TRIES = 3  # times that a run which is not finite is made anew with more steps
PICKED = 16  # slopes of a run that are looked at closely
SURELY = 1e100  # slopes above, of which no step is small enough
NEVER = 10**9  # steps


def slopes_of(machine, placed, states, inputs) -> Float[Array, "m n n"]:
    """Slopes of the rate at some `states` (m, n) under `inputs` (m,): what steps must follow."""
    rate, join, _ = vector_field(machine, placed)
    return jax.vmap(lambda x, u: jax.jacfwd(rate)(join(x), u))(states, inputs)


def steepest_slopes(machine, placed, states, inputs) -> tuple[Array, Array, Array]:
    """The `PICKED` steepest slopes (k, n, n) at some `states`, which, and whether all are finite.

    Steep is what decays fast or swings fast, by the largest of the two-number loops of a slope;
    states and slopes that are not finite are left out.
    """
    slopes = slopes_of(machine, placed, states, inputs)
    loops = jnp.sqrt(jnp.abs(slopes)) * jnp.sqrt(jnp.abs(jnp.swapaxes(slopes, 1, 2)))
    weight = jnp.full(slopes.shape[1:], 1 / EXACT)
    weight = weight + jnp.eye(len(weight)) * (1 / STABLE - 1 / EXACT)
    size = jnp.max(weight * loops, axis=(1, 2))
    fine = jnp.all(jnp.isfinite(states), axis=1) & jnp.isfinite(size)
    _, which = jax.lax.top_k(jnp.where(fine, size, -1.0), min(PICKED, len(size)))
    picked = jnp.where(fine[which, None, None], slopes[which], 0.0)
    return picked, which, jnp.all(jnp.isfinite(states))


def steps_for(slopes: np.ndarray, step: float, time: float = 0.0) -> int:
    """Runge-Kutta steps within `step` s that follow every mode of `slopes` (m, n, n).

    A mode that goes on for most of a run of `time` s is followed the more exactly: a step of an
    angle a is late by a^5 / 120.
    """
    if not np.all(np.abs(slopes) < SURELY):
        return NEVER
    modes = np.linalg.eigvals(slopes)
    decay, speed = np.abs(modes.real), np.abs(modes.imag)
    turned = speed * np.minimum(time, 1 / np.maximum(decay, 1e-300))
    angle = np.minimum(EXACT, (120 * PHASE / np.maximum(turned, 1e-300)) ** 0.25)
    need = step * max(np.max(decay, initial=0.0) / STABLE, np.max(speed / angle, initial=0.0))
    return int(np.clip(math.ceil(need), 1, NEVER))


def most_steps(places: int) -> int:
    """Steps between two places that a free run over `places` takes at most."""
    return max(MOST, LONGEST // max(1, places))


class Tried(NamedTuple):
    """A run with some steps: what it gave, the steps that its own states need, and all finite."""

    made: Any
    needs: int
    finite: bool


def settled(
    run: Callable[[np.ndarray, np.ndarray], Sequence[Tried]], least: Sequence[int], most: int
) -> tuple[list[Any], np.ndarray]:
    """What runs give with as many steps as the states need that come out, and those steps.

    `run(which, steps)` makes some of them; `least` are the steps that their starts need: a run that
    chatters about a narrow law steps over it.  A run that is not finite is made anew with more
    steps: where it stays so, it is the motion that leaves all bounds.  One that needs more than
    `most` steps gives None.
    """
    steps = np.asarray(least, int)
    made: list[Any] = [None] * len(steps)
    left, failed = np.flatnonzero(steps <= most), np.zeros(len(steps), int)
    while len(left):
        again = []
        for k, tried in zip(left, run(left, steps[left]), strict=True):
            failed[k] += not tried.finite
            lost = not tried.finite and failed[k] <= TRIES and steps[k] < most
            if tried.needs <= steps[k] and not lost:
                made[k] = tried.made
            elif steps[k] < most:
                more = MORE * int(steps[k])
                steps[k] = min(most, more if lost else min(tried.needs, more))
                again.append(k)
            else:
                steps[k] = NEVER
        left = np.array(again, int)
    return made, steps
