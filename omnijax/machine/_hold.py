"""What a logged input does between its samples: told by how late it acts."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ._first_numbers import LogSignals
from ._low_pass import acceleration, low_passed, unspoilt

HELD_FROM = 0.5  # of the half sample by which a held input acts late: nearer to it than to linear
SURE, CLOSE = 0.12, 0.05  # half samples: error at most, and distance beside three errors
KNOTS = 7  # of the course of the acceleration over speed and over position
SHARP = 0.02  # width of dry friction over the typical speed
BLOCKS = 8  # parts of the rows, whose estimates scatter by the error of one
ROUNDING = 1e-9  # of the input, below which what holding adds to it is rounding


@dataclasses.dataclass(frozen=True)
class InputHold:
    """How an input is to be read, `linear` or `held`, and the half samples by which it acts late.

    A held input is 1 half sample late, one that is linear between samples 0; `sigma` is the error,
    infinite where the input does not change, so that nothing tells.
    """

    hold: str
    late: float
    sigma: float

    @property
    def sure(self) -> bool:
        """Whether the log leaves no doubt."""
        off = min(abs(self.late), abs(self.late - 1))
        return self.sigma < SURE and off < 3 * self.sigma + CLOSE

    @property
    def sentence(self) -> str:
        """The reading and what it is from."""
        if not np.isfinite(self.sigma):
            return f"{self.hold} between its samples (it changes too little to tell how it acts)"
        if self.late > 2:
            said = "far later than a sample"
        else:
            said = f"{self.late / 2:.2f} ± {self.sigma / 2:.2g} samples late"
        return f"{self.hold} between its samples (it acts {said}; held: 0.5, linear: 0)"


def acting(values: np.ndarray, hold: str) -> np.ndarray:
    """What a sampled input (t,) comes to at its samples, as slow parts of it act.

    A held input is a half sample late and weaker by (w h)^2/24, one that is linear between its
    samples weaker by (w h)^2/12, for a frequency w and a step h; both to the fourth order in w h.
    """
    if hold == "band-limited":
        return values
    padded = np.concatenate([values[:1], values[:1], values, values[-1:]])
    before, early, now, after = padded[1:-2], padded[:-3], padded[2:-1], padded[3:]
    if hold == "held":
        return (13 * (now + before) - (after + early)) / 24
    return (before + 10 * now + after) / 12


def input_hold(logs: Sequence[LogSignals], turns: bool) -> InputHold:
    """Whether the input of an axis of one inertia is held or linear between its samples.

    The low-passed acceleration is regressed on the input as it acts when linear, on what a held one
    adds to that, and on smooth functions of position and speed, which stand for all friction and
    springs.  Parts of the rows say how far the answer scatters.
    """
    parts = [_rows(log, turns) for log in logs]
    wide = max(p[0].shape[1] for p in parts)
    tables, wanted = [], []
    for i, (A, a) in enumerate(parts):
        ones = np.zeros((len(A), len(parts)))
        ones[:, i] = 1.0
        tables.append(np.concatenate([A, np.zeros((len(A), wide - A.shape[1])), ones], axis=1))
        wanted.append(a)
    table, wanted = np.concatenate(tables), np.concatenate(wanted)
    if np.linalg.norm(table[:, 1]) <= ROUNDING * np.linalg.norm(table[:, 0]):
        return InputHold("linear", 0.0, np.inf)
    late, slope, rest = _late(table, wanted)
    size = slope @ slope
    shares = [slope[k] @ rest[k] / size for k in np.array_split(np.arange(len(rest)), BLOCKS)]
    sigma = float(np.sqrt(np.sum(np.square(shares))))
    return InputHold("held" if late > HELD_FROM else "linear", late, sigma)


def _late(table: np.ndarray, wanted: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """(half samples late, the second column beside all others in units of it, what is left)."""
    size = np.linalg.norm(table, axis=0)
    size[size == 0] = 1.0
    x, *_ = np.linalg.lstsq(table / size, wanted, rcond=1e-10)
    x = x / size
    others = np.delete(table / size, 1, axis=1)
    beside = table[:, 1] - others @ np.linalg.lstsq(others, table[:, 1], rcond=1e-10)[0]
    strength = x[0] if x[0] else 1e-300
    return float(x[1] / strength), beside * strength, wanted - table @ x


def _rows(log: LogSignals, turns: bool) -> tuple[np.ndarray, np.ndarray]:
    """The table of one log, its first columns the input and what holding adds, and a (rows,)."""
    share = log.cutoff
    q = low_passed(log.position, share)
    v = np.gradient(q, log.step)
    linear, held = (acting(log.input, hold) for hold in ("linear", "held"))
    plain, more = low_passed(linear, share), low_passed(held - linear, share)
    speed = float(np.sqrt(np.mean(v**2))) or 1.0
    travel = float(np.std(q)) or 1.0
    about = (q - q.mean()) / travel
    columns = [plain, more, v, np.tanh(v / (SHARP * speed)), q, about**2, about**3]
    columns += [np.sin(q), np.cos(q)] if turns else []
    columns += list(_hats(v).T)
    inside = unspoilt(len(q), share)
    return np.stack(columns, 1)[inside], acceleration(q, log.step)[inside]


def _hats(x: np.ndarray) -> np.ndarray:
    """Piecewise-linear functions (t, knots) of x over its quantiles."""
    knots = np.unique(np.quantile(x, np.linspace(0, 1, KNOTS)))
    return np.stack([np.interp(x, knots, e) for e in np.eye(len(knots))], axis=1)[:, 1:-1]
