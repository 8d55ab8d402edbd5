"""Steady states of many designs at once: RMS and supremum of |dR|, and their gradients.

For rigs whose contacts are independent of each other but for what drive forces couple: three
orthogonal normals, or the `paper` variant with any layout.
"""

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._root import root
from ...rig import Rig
from .._exact import drive_gain
from .period_rms import mean_square
from .periodic import Motion, Pairing, Shaken, motion
from .periodic_load import Grip, margins
from .periodic_peak import LENGTH
from .periodic_supremum import places, starts_needed, supremum
from .rig import Make, all_pairs, contact_obstacle, half_root, lanes, links_of, orthonormal
from .waveform import waveform, waves_needed

LANES = 128  # designs that pass through the kernel together
SAMPLES = (256, 4096)  # of the search on a piece: at least, at most
PER_CYCLE = 8  # samples a cycle of a mode that rings down, twice as many of one that hardly does
SHARE = 1e-3  # of the motion: amplitude above which a mode's cycles count


class SteadyPlan(NamedTuple):
    """A plan for many designs that differ in numbers only; hashable but for `gram`."""

    layout: Pairing
    load: Pairing  # every pair through which a wheel loads a contact
    model: str
    waves: int
    blocks: int  # of the search, a piece
    starts: int  # corners from which the supremum of coupled wheels is sought
    gram: Any  # normals' products where they are not orthonormal


def steady_bulk_obstacle(rig: Rig, model: str = "coupled") -> str | None:
    """Why the kernel does not give this rig's steady state, in words; None where it does."""
    reason = contact_obstacle(rig, model)
    if reason is not None:
        return reason
    for name, profile in zip(rig.names, rig.profiles, strict=True):
        if waves_needed(profile, 0.1) is None:
            return f"wheel {name}'s profile `{profile.id}` is no sum of sinusoids"
    return None


def _shaken(rig: Rig, speeds, angles, model: str, waves: int, layout: Pairing) -> Shaken:
    contact, own, coupling = links_of(rig, speeds, model, layout)
    shape = waveform(rig, speeds, angles, len(layout.waves), waves)
    return Shaken(contact, shape, own, coupling)


def _full(rig: Rig, model: str, ratio: float) -> tuple[Pairing, int]:
    """Every pair and every wave that a rig may have, and waves a piece."""
    needs = [waves_needed(profile, ratio) or 0 for profile in rig.profiles]
    counts = [{"rollers": 3, "continuous-sine": 1}.get(p.id, 2) for p in rig.profiles]
    axis, wheel = all_pairs(rig.size, model)
    n, waves = rig.size, max(needs)
    return Pairing(axis, wheel, n, n, tuple(range(n)), (waves,) * max(counts)), waves


@eqx.filter_jit
def _ratios(make: Make, values):
    return jax.vmap(lambda x: _ratio(make(x)[0]))(values)


@eqx.filter_jit
def _look(make: Make, values, model: str, waves: int, full: Pairing):
    """Drive gains, designs and motions of some designs, with every pair there may be."""

    def one(x):
        rig, speeds, angles = make(x)
        design = _shaken(rig, speeds, angles, model, waves, full)
        batch = jax.tree.map(lambda y: y[..., None], design)
        return drive_gain(rig, speeds), design, motion(batch, full)

    return jax.vmap(one)(values)


def plan_steady(make: Make, values, model: str = "coupled", stride: int = 1024) -> SteadyPlan:
    """What serves all designs `make(row)` of `values` (B, d), rows of numbers.

    Raises `ValueError` where the kernel does not take the rig.
    """
    rig, _, _ = make(jnp.asarray(values[0]))
    reason = steady_bulk_obstacle(rig, model)
    if reason is not None:
        raise ValueError(f"no steady state in bulk: {reason}.")
    ratios = _ratios(make, jnp.asarray(values))
    full, waves = _full(rig, model, float(jnp.max(ratios)))
    found = [
        jax.tree.map(
            np.asarray, _look(make, jnp.asarray(values[i : i + stride]), model, waves, full)
        )
        for i in range(0, len(values), stride)
    ]
    gains, designs, motions = jax.tree.map(lambda *xs: np.concatenate(xs), *found)
    coupled = np.abs(designs.coupling).max(0) > 1e-14
    pairs = zip(full.axis, full.wheel, strict=True)
    used = [p for p, (a, j) in enumerate(pairs) if coupled[p] or a == j]
    every = _full(rig, "coupled", 0.1)[0]
    gain = np.abs(gains).reshape(len(gains), -1).max(0) > 1e-14
    known = {(full.axis[p], full.wheel[p]) for p in used}
    loading = [
        p
        for p, pair in enumerate(zip(every.axis, every.wheel, strict=True))
        if gain[p] or pair in known
    ]
    shape = designs.shape
    live = (np.abs(shape.cosine) + np.abs(shape.sine)).max(axis=(0, -1)) > 0
    layout = full._replace(
        axis=tuple(full.axis[p] for p in used),
        wheel=tuple(full.wheel[p] for p in used),
        sets=(0,) * rig.size if _same(designs) else full.sets,
        waves=tuple(int(np.flatnonzero(row).max(initial=-1)) + 1 for row in live),
    )
    gram = None if orthonormal(rig) else np.asarray(rig.wheels.normal @ rig.wheels.normal.T)
    starts = starts_needed(_across(motions, full, used), rig.size)
    load = layout._replace(
        axis=tuple(every.axis[p] for p in loading), wheel=tuple(every.wheel[p] for p in loading)
    )
    return SteadyPlan(layout, load, model, waves, _blocks(motions), starts, gram)


def _across(m: Motion, layout: Pairing, used: list[int]) -> float:
    """Largest share that a pair of two different directions has in the motion."""
    size = _sizes(m)[1]
    own = np.array([a == j for a, j in zip(layout.axis, layout.wheel, strict=True)])
    used_across = np.array([p in used for p in range(len(own))]) & ~own
    whole = size[:, own].max(axis=1, keepdims=True)
    share = size[:, used_across] / np.where(whole > 0, whole, 1.0)
    return float(share.max(initial=0.0))


def _sizes(m: Motion):
    """Amplitudes (design, piece, mode, pair) of the modes, and of everything (design, pair)."""
    rate = np.sqrt(np.maximum(-m.lam.D[:, None, ..., 0], 0.0))
    y = [x[..., 0] for x in m.free]
    modes = np.hypot(y[1], y[0] / np.where(rate > 0, rate, np.inf))
    waves = [np.abs(x[..., 0]) for part in (*m.across, *m.along) for x in part]
    return modes, sum(waves) + modes.sum(axis=(1, 2)) + np.abs(m.still[..., 0]).sum(1)


def _ratio(rig: Rig):
    return jnp.max(rig.wheel_radius) / rig.sphere.radius


def _same(designs: Shaken) -> bool:
    return all(np.all(x == x[:, :1]) for x in designs.contact)


def _blocks(m: Motion) -> int:
    """Blocks a piece, so that every mode that counts is seen often enough in each of its cycles."""
    u, D = m.lam.u[:, None, ..., 0], m.lam.D[:, None, ..., 0]  # (design, piece, mode, pair)
    rate = np.sqrt(np.maximum(-D, 0.0))
    duration, (size, whole) = m.duration[:, :, None, :, 0], _sizes(m)
    counts = (size > SHARE * whole[:, None, None]) & (rate > 0)
    ringing = np.where(-u * 2 * math.pi < 0.1 * rate, 2, 1)
    need = np.where(counts, ringing * PER_CYCLE * rate * duration / (2 * math.pi), 0.0).max()
    samples = min(max(need, SAMPLES[0]), SAMPLES[1])
    return 1 << math.ceil(math.log2(samples / LENGTH))


def _designs(make: Make, plan: SteadyPlan, rows) -> Shaken:
    return jax.vmap(lambda x: _shaken(*make(x), plan.model, plan.waves, plan.layout), out_axes=-1)(
        rows
    )


def _square_of(m: Motion, plan: SteadyPlan):
    """Mean of |dR|^2, wheels' phases independent: variances add up, means add up first."""
    layout = plan.layout
    axis = np.array(layout.axis)
    square = mean_square(m, layout)
    means = [sum(m.mean[p] for p in np.flatnonzero(axis == a)) for a in range(layout.directions)]
    total = jnp.sum(square - m.mean**2, axis=0)
    for a in range(layout.directions):
        for b in range(layout.directions):
            weight = (a == b) if plan.gram is None else plan.gram[a, b]
            total = total + weight * means[a] * means[b]
    return total


@eqx.filter_jit
def steady_figures(make: Make, values: Float[Array, "B d"], plan: SteadyPlan):
    """Long-run RMS and supremum of |dR| in m, (B,) each, of the designs in the rows."""

    def some(rows):
        m = motion(_designs(make, plan, rows), plan.layout)
        spots = places(m, plan.layout, plan.blocks, plan.starts)
        top = supremum(m, plan.layout, spots, plan.gram)
        return root(_square_of(m, plan)), root(top)

    rms, peak = jax.lax.map(some, lanes(values, LANES))
    return rms.reshape(-1)[: len(values)], peak.reshape(-1)[: len(values)]


@eqx.filter_jit
def steady_margins(make: Make, values: Float[Array, "B d"], plan: SteadyPlan):
    """Least normal force and least slip margin of any contact, N, (B,) each.

    From parabolas through samples, good to some 1e-4 of the forces: for statuses.
    """

    def one(x):
        rig, speeds, angles = make(x)
        design = _shaken(rig, speeds, angles, plan.model, plan.waves, plan.load)
        gain = drive_gain(rig, speeds)[np.array(plan.load.axis), np.array(plan.load.wheel)]
        return design, Grip(gain, rig.wheels.closure.preload, rig.wheels.contact.friction)

    def some(rows):
        design, grip = jax.vmap(one, out_axes=-1)(rows)
        return margins(design, grip, plan.load, plan.blocks)

    normal, slip = jax.lax.map(some, lanes(values, LANES))
    return normal.reshape(-1)[: len(values)], slip.reshape(-1)[: len(values)]


@eqx.filter_jit
def steady_gradients(make: Make, values: Float[Array, "B d"], plan: SteadyPlan):
    """Figures as `steady_figures`, and their gradients (B, d) in the rows' numbers, by metric."""

    def some(rows):
        design, pull = jax.vjp(lambda x: _designs(make, plan, x), rows)
        whole, back = jax.vjp(lambda d: motion(d, plan.layout), design)
        spots = places(whole, plan.layout, plan.blocks, plan.starts)

        def squares(m):
            top = supremum(m, plan.layout, spots, plan.gram)
            return {"rms": _square_of(m, plan), "peak": top}

        found, down = jax.vjp(squares, whole)
        zero = jax.tree.map(jnp.zeros_like, found)
        slopes = {
            name: pull(back(down({**zero, name: half_root(x)})[0])[0])[0]
            for name, x in found.items()
        }
        return {name: root(x) for name, x in found.items()}, slopes

    found = jax.lax.map(some, lanes(values, LANES))
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:])[: len(values)], found)
