"""Passing through a signal's period: pieces one after the other, and maps from start to start."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from ..._programs import kept
from ...rig import Rig
from .expm import Piece, make_piece
from .forcing import Forcing, forcing
from .system import ForcedSystem, balanced, forced_system


class Passages(NamedTuple):
    """Every piece of every signal (leading axes g, k), ready to be passed through."""

    pieces: Piece
    duration: Float[Array, "g k"]  # s
    width: Float[Array, "g k"]  # rad


def passages(system: ForcedSystem, forcing: Forcing, least: int, levels: int) -> Passages:
    """Generators and ladders of all pieces."""
    cycle = forcing.cycle
    duration = cycle.duration

    def one(column, pieces, duration):
        return make_piece(system.A, column, pieces, duration, least, levels)

    per_signal = jax.vmap(one, in_axes=(None, 0, 0))
    pieces = jax.vmap(per_signal)(system.column, cycle.pieces, duration)
    return Passages(pieces, duration, cycle.pieces.width)


@kept
def longest_passage(rig: Rig, speeds, angles, model: str, least: ArrayLike = 0.0):
    """The system's matrix A times the duration of its longest piece (or `least` s), (m, m).

    Sizes are counted from it: what is not finite counts as 0, the figures tell.
    """
    signals = forcing(rig, speeds, angles)
    system, _ = balanced(forced_system(rig, model, speeds, signals.wheel))
    passage = system.A * jnp.maximum(jnp.max(signals.cycle.duration), least)
    return jnp.where(jnp.isfinite(passage), passage, 0.0)


def piece_maps(pieces: Piece, m: int) -> Float[Array, "... size size"]:
    """Affine maps of (s, 1) over whole pieces: s -> exp(F)_ss s + exp(F)_sw w(0)."""
    E = whole_all(pieces)
    top = jnp.concatenate(
        [E[..., :m, :m], jnp.einsum("...mw,...w->...m", E[..., :m, m:], pieces.start)[..., None]],
        -1,
    )
    last = jnp.zeros((*top.shape[:-2], 1, m + 1)).at[..., 0, m].set(1.0)
    return jnp.concatenate([top, last], axis=-2)


def whole_all(pieces: Piece) -> Float[Array, "... N N"]:
    """exp(F) of each piece of a stack."""
    return pieces.levels[..., -1, :, :]


def prefix_maps(maps: Float[Array, "k a a"]) -> tuple[Array, Array]:
    """Maps from the period's start to each piece's start (k), and over the whole period."""

    def on(total, M):
        return M @ total, total

    period, before = jax.lax.scan(on, jnp.eye(maps.shape[-1]), maps)
    return before, period


def with_terms(s: Float[Array, "... m"], pieces: Piece) -> Float[Array, "... N"]:
    """State at the start of each piece together with the forcing's terms there."""
    return jnp.concatenate([s, pieces.start], axis=-1)


def periodic_starts(cycles: Passages, m: int) -> Float[Array, "g k N"]:
    """z at the start of every piece of the periodic solution: s = (1 - E)^-1 e over one period."""

    def one(pieces):
        before, period = prefix_maps(piece_maps(pieces, m))
        s = jnp.linalg.solve(jnp.eye(m) - period[:m, :m], period[:m, m])
        return with_terms(jnp.einsum("kab,b->ka", before, jnp.append(s, 1.0))[:, :m], pieces)

    return jax.vmap(one)(cycles.pieces)
