"""Figures of many designs by the modal core: programs depend on kinds of input alone."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._root import root
from ...laws import ContinuousSine, GatedSine, HalfSine, Rollers
from ...rig import Placed, Rig
from .._exact import exact_obstacle
from .poles import Eigen, eigen, modes_of
from .signals import series_needed
from .system import Design, Layout, Operating, designs_of
from .transient import LANES, Lanes, refined_peak, samples_of

METRICS = ("rms", "peak")


class Figures(NamedTuple):
    """Figures of a batch, and what says how a run would have ended."""

    values: Float[Array, "B m"]
    normal: Float[Array, " B"]  # N, least normal force of a contact, or a bound above 0
    slip: Float[Array, " B"]  # N, least mu N - |f|, or a bound not below 0


def modal_obstacle(
    rig: Rig, model: str = "coupled", metrics: Sequence[str] = METRICS
) -> str | None:
    """Why the modal core does not give these figures of the rig, in words; None where it does."""
    reason = exact_obstacle(rig, model)
    if reason is not None:
        return reason
    others = [name for name in metrics if name not in METRICS]
    if others:
        return f"the modal core does not give {', '.join(others)}"
    for name, profile in zip(rig.names, rig.profiles, strict=True):
        if not isinstance(profile, GatedSine | HalfSine | ContinuousSine | Rollers):
            return f"wheel {name}'s profile `{profile.id}` is no sum of sinusoids"
    return None


SIZES = (LANES, 8 * LANES)  # designs a call of the compiled programs
_PORTS = ("shape", "contact", "platform", "kinematics")  # whose laws enter the linear model


def modal_figures(
    make: Callable[[Array], Operating],
    rows: Float[Array, "B d"],
    metrics: Sequence[str] = METRICS,
    *,
    duration: float,
    step: float,
    model: str = "coupled",
) -> Figures:
    """Figures of the designs `make(row)` over the samples t = 0, step, ... , duration (s).

    `metrics` may hold `rms` and `peak`, as `vibration.METRICS` defines them.  The compiled
    programs depend on the rig's kinds of wheels and laws, not on numbers, paths or the closure
    `make`.  Raises `ValueError` where `modal_obstacle` names a reason.
    """
    count, parts = round(duration / step) + 1, []
    size = SIZES[0] if len(rows) <= SIZES[0] else SIZES[-1]
    for i in range(0, len(rows), size):
        some = np.asarray(rows[i : i + size], float)
        some = jnp.asarray(np.concatenate([some, np.repeat(some[-1:], size - len(some), axis=0)]))
        points = _points(make, some)
        if i == 0:
            reason = modal_obstacle(_one(points.rig), model, metrics)
            if reason is not None:
                raise ValueError(f"no figures from the modal form: {reason}.")
        force, series = bool(np.any(np.asarray(points.force))), _series(points.rig)
        design, layout = _designs(_plain(points), model, force, series)
        parts.append(np.asarray(_figures(design, layout, step, float(count))))
    rms, peak, normal, slip = np.concatenate(parts, axis=1)[:, : len(rows)]
    values = {"rms": rms, "peak": peak}
    return Figures(np.stack([values[name] for name in metrics], axis=1), normal, slip)


def _one(rigs: Rig) -> Rig:
    """The rig of a batch whose centre of mass is farthest off."""
    offset = np.abs(np.asarray(rigs.sphere.centre_of_mass)).sum(axis=1)
    return jax.tree.map(lambda x: np.asarray(x)[np.argmax(offset)], rigs)


@eqx.filter_jit
def _points(make, rows) -> Operating:
    return jax.vmap(make)(rows)


def _plain(points: Operating) -> Operating:
    """The points without names and laws that do not enter, so that rigs share their programs."""
    rig = points.rig
    effects = tuple(
        Placed(placed.law, "", placed.wheels) for placed in rig.effects if placed.law.port in _PORTS
    )
    names = tuple(str(i) for i in range(rig.size))
    plain = Rig(rig.sphere, rig.platform, rig.wheels, rig.profiles, effects, names)
    return points._replace(rig=plain)


def _series(rig: Rig) -> int:
    """Terms that `rollers` need anywhere in the batch; 1 where no wheel has them."""
    if not any(isinstance(profile, Rollers) for profile in rig.profiles):
        return 1
    return series_needed(float(jnp.max(rig.wheels.radius / rig.sphere.radius[:, None])))


@eqx.filter_jit
def _designs(points: Operating, model: str, force: bool, series: int) -> tuple[Design, Layout]:
    return designs_of(points, model, force, series)


@partial(jax.jit, static_argnames="layout")
def _figures(design: Design, layout: Layout, step, count):
    """RMS, peak, least normal force and slip margin, (4, B)."""
    groups = jax.tree.map(_grouped, lanes_of(design, eigen(design.system)))

    def some(g: Lanes):
        samples = samples_of(g, layout, step, count)
        squares = samples.total / count, refined_peak(g, layout, samples.best, step, count)
        return jnp.stack([*map(root, squares), samples.normal, samples.slip])

    return _flat(jax.lax.map(some, groups))


def _flat(x):
    """(groups, ..., lanes) as (..., B)."""
    x = jnp.moveaxis(x, 0, -2)
    return x.reshape(*x.shape[:-2], -1)


def lanes_of(design: Design, found: Eigen) -> Lanes:
    """Designs as the kernel takes them: batch last."""
    last = partial(jax.tree.map, lambda x: jnp.moveaxis(x, 0, -1))
    system = design.system
    return Lanes(
        modes_of(found),
        last(design.signals),
        *last((system.direct, system.rate, design.preload, design.friction)),
    )


def _grouped(x):
    """(..., B) as groups of lanes, (groups, ..., lanes)."""
    return jnp.moveaxis(x.reshape(*x.shape[:-1], -1, LANES), -2, 0)
