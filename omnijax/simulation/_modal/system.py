"""One design as arrays: the forced linear system, its outputs and what forces it."""

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...rig import Rig, upright
from .._exact import ForcedSystem, forced_system
from .signals import Kind, Signals, signals_of, wheels_with_tables


class Operating(NamedTuple):
    """A rig at constant speeds: one design, or many with a leading axis on every array."""

    rig: Rig
    speeds: Float[Array, " n"]  # rad/s
    force: Float[Array, "3"]  # N, on the platform
    angles: Float[Array, " n"]  # rad, of the wheels at the start


class System(NamedTuple):
    """ds/dt = A s + sum_l column_l rho_l, out = C s + direct rho + rate drho/dt, s(0) = start."""

    A: Float[Array, "m m"]
    column: Float[Array, "l m"]
    C: Float[Array, "o m"]
    direct: Float[Array, "l o"]
    rate: Float[Array, "l o"]
    start: Float[Array, " m"]


class LinearDesign(NamedTuple):
    """What the kernel needs to know of a design."""

    system: System
    signals: Signals
    preload: Float[Array, " n"]  # N
    friction: Float[Array, " n"]


class Layout(NamedTuple):
    """What is static about a design: wheels, signals, outputs, and what of it decouples."""

    wheels: int
    kinds: tuple[Kind, ...]
    outputs: tuple[str, ...]
    blocks: tuple[tuple[int, ...], ...] = ()  # see `decoupling`
    same: tuple[int, ...] = ()  # number of the first block that each is equal to
    rows: int = 3  # outputs that figures are made of, the first ones
    live: tuple[tuple[int, ...], ...] = ()  # pairs of poles that each row of the outputs shows
    waves: tuple[tuple[int, ...], ...] = ()  # sinusoids that each row of the outputs shows
    together: int = 4  # samples that one loop over designs works out beside each other, at least
    in_step: bool = False  # whether blocks without a closed form are done by `shifted_qr`
    short: bool = False  # whether unlike phases that take about as long pass through one program
    tables: tuple[int, ...] = ()  # number of the input column that each table drives
    tabled: tuple[tuple[int, ...], ...] = ()  # tables that each row of the outputs shows

    def place(self, output: str) -> np.ndarray:
        """The rows of an output."""
        rows = output_rows(self.outputs, self.wheels)[output]
        return np.arange(rows.start, rows.stop)

    @property
    def signal_of(self) -> np.ndarray:
        """Number of the signal that each sinusoid belongs to."""
        return np.repeat(np.arange(len(self.kinds)), [kind.waves for kind in self.kinds])

    @property
    def column_of(self) -> list[int]:
        """Number of the input column that each sinusoid drives."""
        return [self.kinds[i].column for i in self.signal_of]

    @property
    def columns(self) -> tuple[int, ...]:
        """Number of the input column that each signal drives, those of tables last."""
        return (*(kind.column for kind in self.kinds), *self.tables)

    @property
    def poles(self) -> tuple[int, ...]:
        """One pair of each set of pairs that have their poles in common, as equal blocks do."""
        return tuple(p for i, pairs in enumerate(self._pairs) if self.same[i] == i for p in pairs)

    @property
    def pole(self) -> tuple[int, ...]:
        """Number in `poles` of each pair's poles."""
        number = {p: q for q, p in enumerate(self.poles)}
        return tuple(number[p] for i in self.same for p in self._pairs[i])

    @property
    def _pairs(self) -> list[range]:
        """Pairs of each block."""
        ends = np.cumsum([len(block) // 2 for block in self.blocks]).tolist()
        return [range(b - len(x) // 2, b) for x, b in zip(self.blocks, ends, strict=True)]


OUTPUTS = ("dR", "normal_force", "drive_force")
UPRIGHT = "a_sphere_upright"  # `a_sphere` along gravity and across it


def output_rows(outputs: Sequence[str], wheels: int) -> dict[str, slice]:
    """The rows of each of some outputs below each other."""
    sizes = [wheels if name.endswith("_force") else 3 for name in outputs]
    ends = np.cumsum([0, *sizes]).tolist()
    return dict(zip(outputs, itertools.starmap(slice, itertools.pairwise(ends)), strict=True))


class How(NamedTuple):
    """What is static about the arrays of designs; see `signals_of` for `force` and `series`."""

    model: str
    force: bool
    series: int
    outputs: tuple[str, ...] = OUTPUTS


def design_of(point: Operating, how: How, turn: Array | None = None) -> tuple[LinearDesign, Layout]:
    """Arrays and layout of one design.

    `turn`: directions of the states in the columns, where those are not the model's own.
    """
    rig, speeds, push, angles = point
    signals, kinds = signals_of(rig, speeds, angles, how.force, how.series)
    floors = len(rig.at("platform"))
    sources = (*range(rig.size), *(-1 for _ in range(floors)))
    forced = _turned(forced_system(rig, how.model, speeds, sources), turn)
    level = jnp.zeros(len(sources))  # rho at the start; a floor does not deflect a rig at rest
    first = 0
    for g, kind in enumerate(kinds):
        piece = signals.piece[g].astype(int) if kind.pieces > 1 else 0
        since = signals.since[g] if kind.pieces > 1 else 0.0
        v = slice(first, first + kind.waves)
        phase = signals.rate[v] * since
        cosine, sine = signals.cosine[v, piece], signals.sine[v, piece]
        value = jnp.sum(cosine * jnp.cos(phase) + sine * jnp.sin(phase))
        level = level.at[kind.column].add(value) if kind.column < rig.size else level
        first += kind.waves
    tables = wheels_with_tables(rig)
    if signals.tables is not None:
        level = level.at[np.array(tables)].add(signals.tables.rho[:, 0, 0])
    start = forced.rest @ level - forced.shift.T @ level
    unit = _units(forced.A)

    frame = upright(rig) if UPRIGHT in how.outputs else None

    def rows(parts: dict[str, Any], axis: int):
        if frame is not None:
            sphere = jnp.moveaxis(parts["a_sphere"], axis, 0)
            turned = jnp.moveaxis(jnp.tensordot(frame, sphere, 1), 0, axis)
            parts = parts | {UPRIGHT: turned}
        return jnp.concatenate([parts[name] for name in how.outputs], axis=axis)

    column, direct, rate = forced.column, rows(forced.direct, 1), rows(forced.rate, 1)
    if how.force:
        column = jnp.concatenate([column, (forced.force @ push)[None]])
        direct = jnp.concatenate([direct, (rows(forced.push, 0) @ push)[None]])
        rate = jnp.pad(rate, ((0, 1), (0, 0)))
    system = System(
        forced.A * unit[None, :] / unit[:, None],
        column / unit,
        rows(forced.state, 0) * unit,
        direct,
        rate,
        start / unit,
    )
    wheels = rig.wheels
    design = LinearDesign(system, signals, wheels.closure.preload, wheels.contact.friction)
    return design, Layout(rig.size, kinds, how.outputs, tables=tables)


def _turned(system: ForcedSystem, turn: Array | None) -> ForcedSystem:
    """The same system with its states along the columns of `turn`, orthonormal."""
    if turn is None:
        return system
    return system._replace(
        A=turn.T @ system.A @ turn,
        column=system.column @ turn,
        shift=system.shift @ turn,
        state={name: rows @ turn for name, rows in system.state.items()},
        force=turn.T @ system.force,
        rest=turn.T @ system.rest,
    )


def _units(A: Float[Array, "m m"]) -> Float[Array, " m"]:
    """Units of the states in which the rows and columns of A are of like size; no derivative."""
    size = jax.lax.stop_gradient(jnp.abs(A))
    size = size - jnp.diag(jnp.diag(size))
    unit = jnp.ones(len(size))
    for _ in range(4):  # eigenvectors are as good as after thirty
        rows = jnp.sum(size * unit, axis=1) / unit
        cols = jnp.sum(size / unit[:, None], axis=0) * unit
        good = (rows > 0) & (cols > 0)
        ratio = jnp.where(good, rows, 1.0) / jnp.where(good, cols, 1.0)
        unit = unit * jnp.sqrt(jnp.sqrt(ratio))
    return unit


def designs_of(
    points: Operating, how: How, turn: Array | None = None
) -> tuple[LinearDesign, Layout]:
    """Designs of many operating points, batch first."""
    layout: list[Layout] = []

    def one(point):
        design, kinds = design_of(point, how, turn)
        layout.append(kinds)
        return design

    return jax.vmap(one)(points), layout[0]
