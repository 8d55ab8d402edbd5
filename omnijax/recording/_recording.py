"""A measured run in memory, and what was found wrong with it."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ._columns import INPUTS, OUTPUTS, channels, group_of
from ._grid import grid_of, longer_than_bridged, on_even_times

SHOWN = 3  # stretches of rows that a message lists before it says how many more there are


@dataclasses.dataclass(frozen=True)
class Fault:
    """Something wrong with the data: where, what, and what was done about it.

    `rows` holds pairs (first, last), both included, counted from 1 below the header, as in the
    file; empty where the fault is not about rows.  `column` is empty where it is about the file.
    """

    file: str
    column: str
    rows: tuple[tuple[int, int], ...]
    kind: str
    what: str
    consequence: str

    def __str__(self) -> str:
        column = f", column `{self.column}`" if self.column else ""
        rows = f", {say_rows(self.rows)}" if self.rows else ""
        return f"{self.file}{column}{rows}: {self.what}; {self.consequence}."


@dataclasses.dataclass
class Recording:
    """One run of t samples; NaN where a value cannot be used.

    `time` (t,) in s; `channels` by column name, each (t,) in SI: dR in m, theta in rad, Omega in
    rad/s, a in m/s^2, torque in N m, force in N.  `noise` is the declared 1-sigma by column or
    group in the same units, `rows` (t,) the row of the file (from 1 below the header) of each
    sample (0 where `filled` made it), `faults` everything found wrong.  `lost` (t,) says where an
    input was not measured for longer than a straight line bridges: what stands there is invented.
    """

    name: str
    path: Path
    time: np.ndarray
    channels: dict[str, np.ndarray]
    wheels: int
    role: str = "train"
    noise: dict[str, float] = dataclasses.field(default_factory=dict)
    rig_path: Path | None = None
    faults: list[Fault] = dataclasses.field(default_factory=list)
    rows: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(0, int))
    lost: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(0, bool))

    def __post_init__(self):
        if len(self.rows) != len(self.time):
            self.rows = np.arange(1, len(self.time) + 1)
        if len(self.lost) != len(self.time):
            self.lost = np.zeros(len(self.time), bool)

    def __len__(self) -> int:
        return len(self.time)

    def group(self, name: str) -> np.ndarray:
        """Channels of one group as (samples, channels); NaN where nothing usable was measured."""
        return self.table(channels(name, self.wheels))

    def table(self, names: Sequence[str]) -> np.ndarray:
        """Channels as (samples, names); NaN where nothing usable was measured."""
        missing = np.full(len(self.time), np.nan)
        return np.stack([self.channels.get(c, missing) for c in names], axis=1)

    def measures(self, column: str) -> bool:
        """Whether a column has a usable value."""
        return column in self.channels and bool(np.isfinite(self.channels[column]).any())

    def mask(self, name: str) -> np.ndarray:
        """Where a group's values can be used, (samples, channels)."""
        return np.isfinite(self.group(name))

    @property
    def groups(self) -> tuple[str, ...]:
        """Output groups with at least one usable value."""
        return tuple(g for g in OUTPUTS if any(self.measures(c) for c in channels(g, self.wheels)))

    @property
    def torque(self) -> np.ndarray:
        """Commanded motor torques, N m, (samples, wheels)."""
        return self.group("torque")

    @property
    def force(self) -> np.ndarray:
        """Force on the platform, N, (samples, 3)."""
        return self.group("force")

    @property
    def inputs(self) -> np.ndarray:
        """Torques and force side by side, (samples, wheels + 3)."""
        return np.concatenate([self.group(g) for g in INPUTS], axis=1)

    @property
    def step(self) -> float:
        """Sampling step in s: that of an even clock, else the mean of the usual ones."""
        return grid_of(self.time).step

    @property
    def duration(self) -> float:
        """From the first to the last sample, s."""
        return float(self.time[-1] - self.time[0])

    @property
    def held_out(self) -> bool:
        """Whether this run must never be fitted."""
        return self.role == "held-out"

    def declared_noise(self, column: str) -> float | None:
        """Declared 1-sigma of a column or group; a column's own entry counts before its group's."""
        return self.noise.get(column, self.noise.get(group_of(column)))

    def filled(self) -> "Recording":
        """This run at even times: inputs linear between samples, outputs NaN where none was taken.

        Outputs of an uneven clock are moved there (`on_even_times`); `lost` holds stretches without
        samples too, where these are too long to be bridged.
        """
        grid = grid_of(self.time)
        at, (sample, stands) = np.arange(grid.size), grid.nearest
        outputs = [c for c in self.channels if group_of(c) not in INPUTS]
        moved = on_even_times(
            grid, np.reshape([self.channels[c] for c in outputs], (len(outputs), len(self))).T
        )
        values = dict(zip(outputs, moved.T, strict=True)) | {
            c: np.interp(at, grid.place, x) for c, x in self.channels.items() if c not in outputs
        }
        return dataclasses.replace(
            self, time=self.time[0] + grid.step * at,
            channels={c: values[c] for c in self.channels},
            rows=np.where(stands, self.rows[sample], 0),
            lost=(stands & self.lost[sample]) | longer_than_bridged(~stands),
        )  # fmt: skip

    def __repr__(self) -> str:
        faults = f", {len(self.faults)} faults" if self.faults else ""
        return (
            f"Recording({self.name}: {len(self)} samples at {1 / self.step:g} Hz, {self.wheels} "
            f"wheels, {', '.join(self.groups) or 'no outputs'}, {self.role}{faults})"
        )


def spans(bad: np.ndarray, rows: np.ndarray | None = None) -> tuple[tuple[int, int], ...]:
    """Stretches of true values as (first, last) row, counted from 1, or numbered by `rows`."""
    edge = np.flatnonzero(np.diff(np.concatenate([[False], bad, [False]]).astype(int)))
    number = np.arange(1, len(bad) + 1) if rows is None else rows
    return tuple((int(number[a]), int(number[b - 1])) for a, b in edge.reshape(-1, 2))


def say_rows(rows: tuple[tuple[int, int], ...]) -> str:
    """`rows 5-9, 20 and 12 more places`."""
    shown = [str(a) if a == b else f"{a}-{b}" for a, b in rows[:SHOWN]]
    more = f" and {len(rows) - SHOWN} more places" if len(rows) > SHOWN else ""
    plural = "s" if len(rows) > 1 or any(a != b for a, b in rows) else ""
    return f"row{plural} {', '.join(shown)}{more}"
