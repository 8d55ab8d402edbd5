"""Rigs as designs of the bulk kernel: whether they decouple, their arrays, and how time is cut."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._root import root
from ...laws import GatedSine, HalfSine
from ...rig import Rig
from .._exact import drive_gain, exact_obstacle
from .contact import Contact
from .design import CLIP, EDGE, Design, Layout, Wheel
from .gradient import orbit, square_at, stored_modes
from .load import samples_and_margins
from .periodic_load import Grip
from .sampled_rms import Gaps, count_edges, mean_square
from .samples import samples, samples_of

LENGTH = 25  # samples a block at most
BLOCKS = 40  # blocks a window at most
LANES = 64  # designs that pass through the kernel together

Make = Callable[[Any], tuple[Rig, Float[Array, " n"], Float[Array, " n"]]]


def bulk_obstacle(rig: Rig, model: str = "coupled") -> str | None:
    """Why the bulk kernel does not take this rig, in words; None where it does."""
    reason = contact_obstacle(rig, model)
    if reason is not None:
        return reason
    kinds = {type(profile) for profile in rig.profiles}
    if len(kinds) > 1 or not kinds <= {GatedSine, HalfSine}:
        return "the bulk kernel takes wheels of one profile, gated-sine or half-sine"
    return None


def contact_obstacle(rig: Rig, model: str) -> str | None:
    """Why the rig's contacts have no closed form one by one, in words; None where they do."""
    reason = exact_obstacle(rig, model)
    if reason is not None:
        return reason
    if any(placed.law.port in {"shape", "contact", "platform"} for placed in rig.effects):
        return "the bulk kernel takes no further laws at shapes, contacts and the platform"
    if model == "coupled" and not (rig.size == 3 and orthonormal(rig)):
        return "the contacts couple: their normals are not three orthogonal directions"
    return None


def orthonormal(rig: Rig) -> bool:
    normal = np.asarray(rig.wheels.normal)
    return bool(np.allclose(normal @ normal.T, np.eye(rig.size), atol=1e-12))


def contacts_of(rig: Rig, model: str) -> Contact:
    wheels, n = rig.wheels, rig.size
    behind = rig.platform.mass + jnp.sum(wheels.mass) - wheels.mass
    return Contact(
        jnp.full(n, 1 / rig.sphere.mass),
        1 / wheels.mass,
        jnp.zeros(n) if model == "paper" else 1 / behind,
        wheels.contact.stiffness,
        wheels.contact.damping,
        wheels.mount.stiffness,
        wheels.mount.damping,
        wheels.closure.stiffness,
    )


def _passages(rig: Rig, speeds, angles) -> Wheel:
    """Gaps as the wheels pass them; a wheel at rest shows the roller, as if no gap ever came."""
    gaps = rig.gaps
    back, rest = speeds < 0, speeds == 0
    mirrored = isinstance(rig.profiles[0], GatedSine)  # odd in the gap: backwards it rises first
    sign = jnp.where(back & mirrored, -1.0, 1.0)
    begin = jnp.where(back, gaps.pitch - gaps.width, 0.0)
    place = _off_edges(jnp.mod(jnp.where(back, -angles, angles) - begin, gaps.pitch), gaps)
    rate = jnp.where(rest, 1.0, jnp.abs(speeds))
    return Wheel(
        jnp.where(rest, 0.0, sign * gaps.depth),
        gaps.pitch / rate,
        gaps.width / rate,
        place / rate,
    )


def _off_edges(place, gaps):
    """A start on an edge is put just behind it, so that rounding cannot pass it twice or never."""
    near = 1e-12 * gaps.pitch
    place = jnp.where(jnp.abs(place - gaps.width) < near, gaps.width + near, place)
    return jnp.where(place > gaps.pitch - near, 0.0, place)


def design_of(rig: Rig, speeds, angles, model: str, layout: Layout) -> Design:
    """Arrays of one design (no batch axis)."""
    contact, own, coupling = links_of(rig, speeds, model, layout)
    return Design(contact, _passages(rig, speeds, angles), own, coupling)


def links_of(rig: Rig, speeds, model: str, layout) -> tuple[Contact, Array, Array]:
    """Contacts by sets of parameters, and what each pair of `layout` is: own, and coupling."""
    axis, wheel = np.array(layout.axis), np.array(layout.wheel)
    coupling = jnp.zeros((rig.size, rig.size))
    if model == "coupled":
        coupling = rig.wheels.normal @ rig.wheels.drive.T @ drive_gain(rig, speeds)
    rows = [layout.sets.index(s) for s in range(max(layout.sets) + 1)]
    contact = Contact(*(x[np.array(rows)] for x in contacts_of(rig, model)))
    return contact, jnp.asarray(np.where(axis == wheel, 1.0, 0.0)), coupling[axis, wheel]


class Bulk(NamedTuple):
    """A plan for many designs that differ in numbers only; hashable but for `gram`."""

    layout: Layout
    model: str
    gaps: Gaps
    gram: Any  # normals' products where they are not orthonormal


def plan_bulk(
    make: Make, values, duration: float, step: float, model: str = "coupled", stride: int = 4096
) -> Bulk:
    """The cut of time that serves all designs `make(row)` of `values` (B, d), rows of numbers.

    Samples lie at step, 2 step, ... to `duration`; the start counts for itself.  Raises
    `ValueError` where the kernel does not take the rig.
    """
    rig, _, _ = make(jnp.asarray(values[0]))
    reason = bulk_obstacle(rig, model)
    if reason is not None:
        raise ValueError(f"no bulk propagation: {reason}.")
    n = rig.size
    full = Layout(
        *all_pairs(n, model), n, tuple(range(n)), False, step, 1, 1, 1, 1, (1,) * n, 1, True
    )
    look = jax.jit(jax.vmap(lambda x: design_of(*make(x), model, full)))
    found = [
        jax.tree.map(np.asarray, look(jnp.asarray(values[i : i + stride])))
        for i in range(0, len(values), stride)
    ]
    designs = jax.tree.map(lambda *xs: np.concatenate(xs), *found)
    return _cut(rig, designs, round(duration / step), step, model)


def all_pairs(n: int, model: str) -> tuple[tuple[int, ...], tuple[int, ...]]:
    if model == "paper":
        return tuple(range(n)), tuple(range(n))
    return tuple(a for a in range(n) for _ in range(n)), tuple(range(n)) * n


def _cut(rig: Rig, designs: Design, count: int, step: float, model: str) -> Bulk:
    wheel, n = designs.wheel, rig.size
    axis, turning = all_pairs(n, model)
    needed = np.abs(np.concatenate([designs.own + designs.coupling * 0, designs.coupling])).max(0)
    used = [p for p in range(len(axis)) if needed[p] > 1e-14 or axis[p] == turning[p]]
    moving = (wheel.depth != 0) & (wheel.passage > 0)
    over = wheel.period - wheel.passage
    spans = np.where(moving & (over > 1e-9 * wheel.period), np.minimum(wheel.passage, over), np.inf)
    single = _blocks(spans.min(initial=np.inf), step)
    double = _blocks(np.where(moving, wheel.period, np.inf).min(initial=np.inf), step)
    if double < 1:
        raise ValueError("no bulk propagation: gaps pass faster than samples are taken.")
    slots, length = (1, single) if single >= 10 else (2, double)
    half = isinstance(rig.profiles[0], HalfSine)
    total = -(-count // length)
    windows = -(-total // BLOCKS)
    blocks = -(-total // windows)
    period = wheel.period.min(axis=0)

    def gaps(time):
        return tuple(int(np.ceil(time / p + 2 * EDGE)) + 1 for p in period)

    contact = designs.contact
    same = all(np.all(x == x[:, :1]) for x in contact)
    fastest = (contact.sphere + contact.wheel) * contact.damping
    fastest = fastest + (contact.wheel + contact.platform) * contact.mount_damping
    layout = Layout(
        tuple(axis[p] for p in used),
        tuple(turning[p] for p in used),
        n,
        (0,) * n if same else tuple(range(n)),
        half,
        step,
        length,
        blocks,
        windows,
        count,
        gaps(blocks * length * step),
        slots,
        bool(fastest.max() * length * step > CLIP),
    )
    gram = None if orthonormal(rig) else np.asarray(rig.wheels.normal @ rig.wheels.normal.T)
    return Bulk(layout, model, count_edges(wheel, moving, count * step), gram)


def _blocks(span: float, step: float) -> int:
    """Samples a block that is shorter than `span`."""
    return int(min(LENGTH, math.ceil(span / step) - 1)) if np.isfinite(span) else LENGTH


def lanes(values, width: int):
    """Rows in groups of `width`, the last one filled up with the last row; (groups, width, d)."""
    groups = -(-len(values) // width)
    filled = jnp.concatenate([values, jnp.repeat(values[-1:], groups * width - len(values), 0)])
    return filled.reshape(groups, width, values.shape[1])


def _designs(make: Make, plan: Bulk, rows) -> Design:
    return jax.vmap(lambda x: design_of(*make(x), plan.model, plan.layout), out_axes=-1)(rows)


@eqx.filter_jit
def bulk_figures(make: Make, values: Float[Array, "B d"], plan: Bulk):
    """RMS and peak of |dR| in m over the samples, (B,) each, of the designs in the rows."""

    def some(rows):
        total, best, _ = samples(_designs(make, plan, rows), plan.layout, plan.gram, tag=False)
        return root(total / plan.layout.samples), root(best)

    rms, peak = jax.lax.map(some, lanes(values, LANES))
    return rms.reshape(-1)[: len(values)], peak.reshape(-1)[: len(values)]


@eqx.filter_jit
def bulk_checked(make: Make, values: Float[Array, "B d"], plan: Bulk):
    """Figures as `bulk_figures`, and the least normal force and the least slip margin, N, of any
    contact over the same samples; (B,) each."""

    def grip(x):
        rig, speeds, _ = make(x)
        gain = drive_gain(rig, speeds).reshape(-1)
        return Grip(gain, rig.wheels.closure.preload, rig.wheels.contact.friction)

    def some(rows):
        hold, design = jax.vmap(grip, out_axes=-1)(rows), _designs(make, plan, rows)
        total, best, *low = samples_and_margins(design, hold, plan.layout, plan.gram)
        return root(total / plan.layout.samples), root(best), *low

    found = jax.lax.map(some, lanes(values, LANES))
    return tuple(x.reshape(-1)[: len(values)] for x in found)


@eqx.filter_jit
def bulk_gradients(make: Make, values: Float[Array, "B d"], plan: Bulk, metrics=("rms", "peak")):
    """Figures as `bulk_figures`, and their gradients (B, d) in the rows' numbers, by metric.

    Neither differentiates the samples' loop: see `_bulk_gradient`.  Contacts that drive each
    other's directions have no closed RMS; there the loop itself is differentiated.
    """
    layout, count = plan.layout, len(values)
    closed = layout.axis == tuple(range(layout.directions)) and plan.gram is None

    def some(rows):
        design, pull = jax.vjp(lambda x: _designs(make, plan, x), rows)
        m, back = jax.vjp(lambda d: stored_modes(d, layout), design)
        whole, out = jax.vjp(lambda m, wheel: orbit(m, wheel, layout), m, design.wheel)
        total, _, number = samples_of(m, design.wheel, layout, plan.gram, "peak" in metrics)

        def from_orbit(bar):
            modes_bar, wheel_bar = out(bar)
            bar = back(modes_bar)[0]
            return pull(bar._replace(wheel=jax.tree.map(jnp.add, bar.wheel, wheel_bar)))[0]

        found: dict[str, Any] = {"rms": total / layout.samples}
        bars, slopes = {}, {}
        if "peak" in metrics:
            time = (number.astype(float) + 1) * layout.step
            found["peak"], down = jax.vjp(lambda o: square_at(o, layout, time, plan.gram), whole)
            bars["peak"] = down(half_root(found["peak"]))[0]
        if "rms" in metrics and closed:
            down = jax.vjp(lambda o: mean_square(o, layout, plan.gaps), whole)[1]
            bars["rms"] = down(half_root(found["rms"]))[0]
        elif "rms" in metrics:

            def mean_of(d):
                return samples(d, layout, plan.gram, tag=False)[0] / layout.samples

            mean, down = jax.vjp(mean_of, design)
            slopes["rms"] = pull(down(half_root(mean))[0])[0]
        if bars:  # together, so that what they share is computed once
            both = jax.tree.map(lambda *x: jnp.stack(x), *bars.values())
            slopes |= dict(zip(bars, jax.vmap(from_orbit)(both), strict=True))
        return {name: (root(found[name]), slopes[name]) for name in metrics}

    found = jax.lax.map(some, lanes(values, LANES))
    flat = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:])[:count], found)
    return {name: flat[name][0] for name in flat}, {name: flat[name][1] for name in flat}


def half_root(x):
    """d sqrt(x)/dx, zero where nothing moves."""
    return jnp.where(x > 0, 0.5 / jnp.sqrt(jnp.where(x > 0, x, 1.0)), 0.0)
