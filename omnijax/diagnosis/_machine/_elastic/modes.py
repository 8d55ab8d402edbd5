"""The elastic model as modes: exact propagation of inputs linear between fine samples."""

import dataclasses
import functools

import numpy as np

from ..._recursion import recursion

KEPT = 256  # of weights and of rows that are kept, each of its kind, the last used


@dataclasses.dataclass(frozen=True, eq=False)
class OutputModes:
    """dz/dt = rates z + gains u, y = Re(shapes z): one of each complex pair is kept.

    Equal to itself alone: tables of it, which every law asks for anew, are kept by that.
    """

    rates: np.ndarray  # (k,) 1/s
    gains: np.ndarray  # (k, u)
    shapes: np.ndarray  # (m, k)
    inverse: np.ndarray  # (k, m), z of a state y
    C: np.ndarray  # (o, m)
    D: np.ndarray  # (o, u)
    A: np.ndarray
    B: np.ndarray
    inputs: dict[str, slice]
    outputs: dict[str, slice]

    def out(self, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Rows of (C, D) of several outputs, one below the other."""
        return _output_rows(self, names)


@functools.lru_cache(KEPT)
def _output_rows(m: OutputModes, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    rows = np.concatenate([np.arange(m.C.shape[0])[m.outputs[n]] for n in names])
    return _constant(m.C[rows]), _constant(m.D[rows])


def _constant(table: np.ndarray) -> np.ndarray:
    """A table that is kept, not to be written to."""
    table.flags.writeable = False
    return table


def modes(A, B, C, D, size: int) -> OutputModes:
    """Eigenvalues and -vectors of the elastic model, whose states are positions, then speeds.

    A free direction has a double zero with one vector: its position and its speed get dampings of
    their own (1e-10 and twice that, of the largest rate), so that there are two.

    Beside the outputs of the model there is `contact_rate`, approach less mount, and beside its
    inputs `jumps`: drive forces that no output feels at once.
    """
    A, B, C, D = (np.asarray(x) for x in (A, B, C, D))
    if np.linalg.cond(A) > 1e14:  # a direction that no wheel holds
        A = A - 1e-10 * np.abs(A).max() * np.diag(np.repeat([1.0, 2.0], len(A) // 2))
    rates, shapes = np.linalg.eig(A)
    inverse = np.linalg.inv(shapes)
    keep = np.imag(rates) >= 0
    twice = np.where(np.imag(rates[keep]) > 0, 2.0, 1.0)
    parts = {"shape": size, "contact": size, "mount": size, "drive": size, "force": 3, "floor": 3}
    inputs = _slices(**parts, jumps=size)
    pushed = B[:, inputs["drive"]]
    B, D = np.concatenate([B, pushed], axis=1), np.pad(D, ((0, 0), (0, size)))
    outputs = _slices(
        displacement=3,
        velocity=3,
        approach=size,
        approach_rate=size,
        mount=size,
        mount_rate=size,
        deflection=size,
        platform=3,
        acceleration=3,
        contact_rate=size,
    )
    approach, mount = outputs["approach_rate"], outputs["mount_rate"]
    C, D = (np.concatenate([x, x[approach] - x[mount]]) for x in (C, D))
    return OutputModes(
        rates[keep],
        inverse[keep] @ B,
        shapes[:, keep] * twice,
        inverse[keep],
        C,
        D,
        A,
        B,
        inputs,
        outputs,
    )


def _slices(**sizes: int) -> dict[str, slice]:
    out, start = {}, 0
    for name, size in sizes.items():
        out[name] = slice(start, start + size)
        start += size
    return out


def hold_weights(rates: np.ndarray, step: float, parts: int) -> np.ndarray:
    """Weights w (parts + 1, k) with integral_0^step e^(rate (step - s)) u(s) ds = sum_j w_j u_j.

    u is linear between the `parts` + 1 equidistant points: phi functions of the sub-step.
    """
    return _hold_weights(np.asarray(rates, complex).tobytes(), step, parts)


@functools.lru_cache(KEPT)
def _hold_weights(rates: bytes, step: float, parts: int) -> np.ndarray:
    """`hold_weights` of a few models, which every law of theirs asks for; not to be written to."""
    h, every = step / parts, np.frombuffer(rates, complex)
    z = every * h
    small = np.abs(z) < 1e-3
    safe = np.where(small, 1.0, z)
    phi1 = np.where(small, 1 + z / 2 + z**2 / 6 + z**3 / 24, np.expm1(safe) / safe)
    series = 0.5 + z / 6 + z**2 / 24 + z**3 / 120
    phi2 = np.where(small, series, (np.expm1(safe) - safe) / safe**2)
    decay = h * np.exp(every * (step - h * np.arange(1, parts + 1)[:, None]))
    weights = np.zeros((parts + 1, len(every)), complex)
    weights[:-1] = decay * (phi1 - phi2)
    weights[1:] += decay * phi2
    return _constant(weights)


def acts(values: np.ndarray) -> bool:
    """Whether anything of a signal (points, ..) is not zero: mostly a few points say so."""
    return bool(values[:: max(1, len(values) // 64)].any() or values.any())


def forced(m: OutputModes, step: float, intervals: int, **inputs: np.ndarray) -> np.ndarray:
    """Modal forcing (intervals, k) of `inputs` by name, over intervals of `step` s.

    An input (points, c) is linear between its points; either an interval has several of them, or
    several intervals lie between two.
    """
    total = np.zeros((intervals, len(m.rates)), complex)
    for name, values in inputs.items():
        if not acts(values):
            continue
        used = tuple(c for c in range(values.shape[1]) if acts(values[:, c]))
        if used:
            some = np.ascontiguousarray(values[:, used] if len(used) < values.shape[1] else values)
            total += _pushed(m, name, used, some, step, intervals).view(complex)
    return total


def _pushed(
    m: OutputModes, name: str, used: tuple[int, ...], values, step: float, intervals: int
) -> np.ndarray:
    """Forcing (intervals, 2 k), real and imaginary parts in turn, of an input's `used` columns."""
    spans = len(values) - 1
    if spans >= intervals:
        weights = _push_weights(m, name, used, step, spans // intervals)
        return weighted(values, intervals, weights)
    begin, end = _push_weights(m, name, used, step, 1)
    at = np.linspace(0.0, 1.0, intervals // spans + 1)[:, None, None]
    before = begin * (1 - at[:-1]) + end * (1 - at[1:])  # of the point before every interval
    after = begin * at[:-1] + end * at[1:]
    before, after = (np.moveaxis(w, 1, 0).reshape(len(used), -1) for w in (before, after))
    return (values[:-1] @ before + values[1:] @ after).reshape(intervals, -1)


@functools.lru_cache(KEPT)
def _push_weights(m: OutputModes, name: str, used: tuple[int, ...], step: float, parts: int):
    """`hold_weights` (parts + 1, c, 2 k) of an input's `used` columns, times their gains."""
    gains = m.gains[:, m.inputs[name]][:, used].T
    return _constant(real_pairs(hold_weights(m.rates, step, parts)[:, None] * gains))


def weighted(values: np.ndarray, intervals: int, weights: np.ndarray) -> np.ndarray:
    """Sums (intervals, q) of a signal's points (points, c) in each interval by `weights`.

    These are (near points, c, q), of an interval's first points; where there is one more than it
    has, the last is the next one's first.
    """
    points, c = (len(values) - 1) // intervals, values.shape[1]
    near = min(len(weights), points)
    inner = values[:-1].reshape(intervals, points * c)[:, : near * c]
    out = inner @ weights[:near].reshape(near * c, -1)
    return out if near == len(weights) else out + values[points::points] @ weights[-1]


def real_pairs(weights: np.ndarray) -> np.ndarray:
    """Complex weights as pairs of numbers: a real signal needs no complex product."""
    return np.ascontiguousarray(weights).view(float)


def propagate(
    modes: OutputModes, step: float, forcing: np.ndarray, start: np.ndarray
) -> np.ndarray:
    """Modal states (n, k) after per-interval forcing (n - 1, k), from `start` (k,)."""
    z = np.empty((len(forcing) + 1, len(modes.rates)), complex)
    z[0], z[1:] = start, forcing
    recursion(np.exp(modes.rates * step).tolist(), z)
    return z


def static_state(modes: OutputModes, inputs: np.ndarray) -> np.ndarray:
    """Modal state in which nothing moves under constant `inputs` (u,)."""
    return -(modes.gains @ inputs) / modes.rates


def observe(
    modes: OutputModes, z: np.ndarray, names: tuple[str, ...], ahead: float = 0.0
) -> np.ndarray:
    """Outputs (n, o) of modal states, less what inputs add directly; `ahead` s after them."""
    return np.ascontiguousarray(z).view(float) @ real_rows(modes, names, ahead)


@functools.lru_cache(KEPT)
def real_rows(m: OutputModes, names: tuple[str, ...], ahead: float = 0.0) -> np.ndarray:
    """(2 k, o) from a modal state's real and imaginary parts in turn: the real part only.

    Of a state `ahead` s before: as the modes alone lead it on.
    """
    shapes = (m.out(names)[0] @ (m.shapes * np.exp(m.rates * ahead))).T
    rows = np.stack([np.real(shapes), -np.imag(shapes)], axis=1)
    return _constant(rows.reshape(2 * len(shapes), -1))


def direct(m: OutputModes, names: tuple[str, ...], part: str, values) -> np.ndarray | float:
    """What the input `part` adds directly to outputs (n, o); `values()` (n, c) where it does."""
    rows = _direct_rows(m, names, part)
    return 0.0 if rows is None else values() @ rows


@functools.lru_cache(KEPT)
def _direct_rows(m: OutputModes, names: tuple[str, ...], part: str) -> np.ndarray | None:
    """(c, o) of an input that adds to these outputs directly."""
    D = m.out(names)[1][:, m.inputs[part]]
    return _constant(D.T) if D.any() else None
