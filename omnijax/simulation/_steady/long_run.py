"""A rig at constant speeds in the long run: periodic solutions, their statistics and extremes.

Unlike `SteadyState` it computes only what is asked for, which saves time in searches over thousands
of designs.  Every output is linear in z, the elastic state beside the
forcing's terms, so its extremes over all phases are sums of extremes of each signal's own part.
A constant force P on the platform moves the stationary state in the frame of the centre of mass by
y_P = -A^-1 (dA y/dP) P; it stands in the constant term of the first signal.
"""

import copy
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..._root import root
from ..._status import Status
from ...dynamics import held
from ...rig import Rig
from .._exact import (
    ACCELERATIONS,
    GROWTH,
    ForcedSystem,
    Forcing,
    Passages,
    Piece,
    balanced,
    basis_generator,
    basis_row,
    forced_system,
    forcing_signals,
    like_groups,
    may_grow,
    passages,
    periodic_starts,
    points,
    second_moments,
    stacked,
)
from .filtered import OUTPUT, LinearFilter, with_filters
from .peak_search import Curves, PeakPlaces, largest, places, supremum
from .smooth_peak import PhasePlaces, smooth_peak

BITS = 7  # of the even places a piece where extremes are looked for
LEVELS = 24  # of the ladder: up to 2^22 time constants a piece


class Part(NamedTuple):
    """The periodic solutions of signals of like sizes."""

    system: ForcedSystem  # under these signals alone
    signals: Forcing
    cycles: Passages
    starts: Float[Array, "g k N"]

    @property
    def weight(self) -> Float[Array, "g k"]:
        """Share of every piece in its signal's phases."""
        return self.cycles.width / jnp.sum(self.cycles.width, axis=1, keepdims=True)


class LongRun:
    """The periodic solution of every signal of a rig at constant speeds.

    The signals run independently of each other: means are over all their phases, and extremes are
    suprema over them, refined from 2^bits even places a piece and from graded ones.
    """

    def __init__(self, rig: Rig, speeds: Float[Array, " n"], angles: Float[Array, " n"], model: str,
                 bits: int = BITS, levels: int = LEVELS, force=None):  # fmt: skip
        self.rig, self.speeds, self.angles, self.model, self.bits = rig, speeds, angles, model, bits
        self._each, self.levels = forcing_signals(rig, speeds, angles), levels
        wheel = tuple(signal.wheel for signal in self._each)
        self._solve(forced_system(rig, model, speeds, wheel))
        self.pushed = None if force is None else self._constant(force)

    def _solve(self, system: ForcedSystem) -> None:
        """The periodic solutions of `system` under every signal."""
        self.system, _ = balanced(system)
        self.states = self.system.A.shape[0]
        groups = like_groups(self._each, self.states)
        self.parts = tuple(self._part(index, self.levels) for index in groups)
        self._moments = self._places = None

    def filtered(
        self, name: str, directions: Float[Array, "o 3"], filters: Sequence[LinearFilter]
    ) -> Float[Array, " o"]:
        """Mean square of an output along each direction behind a filter, over all phases."""
        behind = copy.copy(self)
        behind._solve(with_filters(self.system, name, directions, filters))
        behind.pushed = None
        return behind.mean_square(OUTPUT)

    def _part(self, index: np.ndarray, levels: int) -> Part:
        system, signals = self.system.of_signals(index), stacked([self._each[i] for i in index])
        cycles = passages(system, signals, self.bits, levels)
        return Part(system, signals, cycles, periodic_starts(cycles, self.states))

    @property
    def signals(self) -> Forcing:
        """All signals, beside each other."""
        return self.parts[0].signals if len(self.parts) == 1 else stacked(self._each)

    def _constant(self, force: Float[Array, "3"]) -> Float[Array, " m"]:
        """y_P: the state that a constant force on the platform (N) holds."""
        return -jnp.linalg.solve(self.system.A, self.system.force @ force)

    def curves(self, *names: str) -> tuple[Curves, ...]:
        """Outputs beside each other, of each part's signals."""
        rows = [jnp.concatenate(x, axis=-2) for x in zip(*map(self._rows, names), strict=True)]
        return tuple(Curves(p.cycles, p.starts, x) for p, x in zip(self.parts, rows, strict=True))

    def _rows(self, name: str) -> list[Float[Array, "g k o N"]]:
        """One output over z, with what the force on the platform adds to the first signal's."""
        rows = [output_rows(part, name) for part in self.parts]
        if self.pushed is not None:
            held = self.system.state[name] @ self.pushed
            rows[0] = rows[0].at[0, :, :, self.states].add(held)
        return rows

    @property
    def status(self) -> Int[Array, ""]:
        """`OK`, `UNHELD` where the sphere drifts off, or `NON_FINITE` where the motion grows.

        Of such a rig no periodic solution is what it does in the long run.
        """
        ended = jnp.where(held(self.rig, self.model), Status.OK, Status.UNHELD)
        if not may_grow(self.rig):
            return ended
        poles = jnp.linalg.eigvals(jax.lax.stop_gradient(self.system.A))
        grown = jnp.max(poles.real) > GROWTH * jnp.max(jnp.abs(poles))
        return jnp.where((ended == Status.OK) & grown, Status.NON_FINITE, ended)

    def statistics(self, name: str) -> tuple[Float[Array, " o"], Float[Array, " o"]]:
        """Mean and mean square of each component, over all phases."""
        if self._moments is None:
            each = jax.vmap(jax.vmap(second_moments))
            self._moments = [each(part.cycles.pieces, part.starts) for part in self.parts]
        return self._summed(self._rows(name), self._moments)

    def _acceleration_square(self, name: str) -> Float[Array, " o"]:
        """Mean square of each component of an acceleration, over all phases.

        By the states beside those of rest under rho, s + A^-1 column rho, which drho/dt alone
        moves: the parts of an acceleration in s and in rho cancel where rho is slow beside the
        poles, and their squares do so to no digit.
        """
        rows, moments = [], []
        for part, own in zip(self.parts, self._rows(name), strict=True):
            rest = jnp.linalg.solve(part.system.A, part.system.column.T).T  # (g, m)
            row = jax.vmap(jax.vmap(basis_row))(part.signals.cycle.pieces)  # (g, k, w)
            beside = rest[:, None, :, None] * row[:, :, None]
            moved = jax.vmap(jax.vmap(_beside_rest))(part.cycles.pieces, part.starts, beside)
            moments.append(jax.vmap(jax.vmap(second_moments))(*moved))
            less = own[..., : self.states] @ beside
            rows.append(own.at[..., self.states :].add(-less))
        return self._summed(rows, moments)[1]

    def _summed(
        self, each: list[Array], moments: list[Array]
    ) -> tuple[Float[Array, " o"], Float[Array, " o"]]:
        """Mean and mean square over all phases of outputs with these rows over z."""
        mean = square = jnp.zeros(())
        for part, rows, square_of in zip(self.parts, each, moments, strict=True):
            mean_of = square_of[..., self.states]  # times the constant term
            own = jnp.einsum("gk,gkoN,gkN->go", part.weight, rows, mean_of)
            whole = jnp.einsum("gk,gkoN,gkNM,gkoM->go", part.weight, rows, square_of, rows)
            mean, square = mean + jnp.sum(own, axis=0), square + jnp.sum(whole - own**2, axis=0)
        return mean, square + mean**2

    def mean_square(self, name: str) -> Float[Array, " o"]:
        """Mean square of each component, over all phases."""
        if name in ACCELERATIONS:
            return self._acceleration_square(name)
        return self.statistics(name)[1]

    def places(self) -> tuple[PeakPlaces, ...]:
        """Where extremes are looked for, in each part."""
        if self._places is None:
            self._places = tuple(places(p.cycles, p.starts, self.bits) for p in self.parts)
        return self._places

    def largest(self, curves: tuple[Curves, ...], rows: Float[Array, "r o"]) -> Float[Array, " r"]:
        """The largest value of each combination `rows` of the outputs."""
        return largest(curves, self.places(), rows, self.bits)

    def extremes(self, name: str) -> Float[Array, "2 o"]:
        """Largest value of each component, and of its negative."""
        curves = self.curves(name)
        eye = jnp.eye(curves[0].rows.shape[-2])
        return self.largest(curves, jnp.concatenate([eye, -eye])).reshape(2, -1)

    def suprema(self, *names: str) -> list[Float[Array, ""]]:
        """Largest length of outputs that are vectors, each by itself."""
        rows = [jnp.stack(x) for x in zip(*map(self._rows, names), strict=True)]

        def one(rows):
            parts = zip(self.parts, rows, strict=True)
            curves = tuple(Curves(part.cycles, part.starts, x) for part, x in parts)
            return supremum(curves, self.places(), self.bits)

        return [root(total @ total) for total in jax.vmap(one)(rows)]

    def smooth_peak(self, name: str, sharpness: float) -> Float[Array, ""]:
        """The smooth peak of an output, p = `sharpness`; see `smooth_peak.py`."""
        curves = self.curves(name)
        each = jax.vmap(jax.vmap(lambda piece, z: points(piece, z, self.bits)))

        def phases(part: Part, rows) -> PhasePlaces:
            Z = each(part.cycles.pieces, part.starts)
            x = jnp.einsum("gkoN,gkNp->gkpo", rows, Z)
            share = jnp.broadcast_to(part.weight[..., None], x.shape[:3]) / 2**self.bits
            return PhasePlaces(x.reshape(len(x), -1, x.shape[-1]), share.reshape(len(x), -1))

        parts = [phases(part, own.rows) for part, own in zip(self.parts, curves, strict=True)]
        return smooth_peak(parts, supremum(curves, self.places(), self.bits), sharpness)


def _beside_rest(
    piece: Piece, z: Float[Array, " N"], beside: Float[Array, "m w"]
) -> tuple[Piece, Float[Array, " N"]]:
    """A piece and its start of (s + beside w, w) in the place of (s, w)."""
    m = len(beside)

    def turned(E: Float[Array, "N N"]):
        return E.at[:m, m:].add(beside @ E[m:, m:] - E[:m, :m] @ beside)

    generator = piece.generator.at[:m, m:].set(beside @ piece.generator[m:, m:])
    levels = jax.vmap(turned)(piece.levels)
    return piece._replace(generator=generator, levels=levels), z.at[:m].add(beside @ z[m:])


def output_rows(part: Part, name: str) -> Float[Array, "g k o N"]:
    """One output as rows over z = (s, w): (C, direct row + rate row G/duration)."""
    system = part.system

    def one(direct, rate, pieces, duration):
        row, G = basis_row(pieces), basis_generator(pieces)
        moving = duration > 0
        slope = row @ G * jnp.where(moving, 1 / jnp.where(moving, duration, 1.0), 0.0)
        terms = jnp.outer(direct, row) + jnp.outer(rate, slope)
        return jnp.concatenate([system.state[name], terms], axis=1)

    per_signal = jax.vmap(one, in_axes=(None, None, 0, 0))
    return jax.vmap(per_signal)(
        system.direct[name], system.rate[name], part.signals.cycle.pieces, part.cycles.duration
    )
