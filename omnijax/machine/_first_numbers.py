"""Numbers of an axis to begin a calibration with: a regression of the accelerations of its logs."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import nnls

from ._low_pass import acceleration, cutoff_of, low_passed, unspoilt
from ._rectified import loses_sign, rectified_numbers

EDGE = 10  # samples at both ends of a log that the low pass spoils
PULLS = 0.03  # share of what is left of the acceleration that a term must explain to be there
SPRING = 0.3  # of the input's size: what a spring or gravity takes of it where it is there
BOUNDLESS = 1e9  # limit of a controller that had nothing to do
REACHED = 0.95  # of the largest error of a controller that shows no limit: where one may begin
CLIPPED = 0.85  # ratio of the limits of a controller that are tried, one to the next
LIMITS = 14
STEEP = 0.03  # width of dry friction over the typical speed
WIDE = 0.2  # of half the sampling rate: low pass of a servo's log
LEAST = 0.05  # of the acceleration's size: damping of an axis of which the log shows none


@dataclasses.dataclass(frozen=True)
class LogSignals:
    """One log in SI units: position and input (t,), step in s, a servo's gain and enable by name.

    `rates` are position, speed and acceleration, low-passed.  Where the `velocity` (t,) was
    measured, the position is its integral.  `second` (t,) is the position of a load behind a drive.
    """

    position: np.ndarray
    input: np.ndarray
    step: float
    beside: Mapping[str, np.ndarray]
    velocity: np.ndarray | None = None
    second: np.ndarray | None = None

    @property
    def cutoff(self) -> float:
        """The low pass, of half the sampling rate, that leaves little noise of acceleration."""
        return cutoff_of(self.position, self.step, self.velocity)

    @property
    def rates(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        smooth = low_passed(self.position, WIDE)
        v = np.gradient(smooth, self.step)
        return smooth, v, np.gradient(v, self.step)


def _joined(parts: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate([x[EDGE:-EDGE] for x in parts])


def servo_numbers(logs: Sequence[LogSignals]) -> dict[str, float]:
    """Numbers of a servo for an inertia of 1, over all its logs at once.

    a = on clip(p k (u - q), -L, L) - on e v - d v - g sin(q) - c tanh(v/w): a term is there where
    it explains a part of the acceleration that the others do not.  The dry friction c is left to
    the diagnosis, which tells it from its kin: here it only keeps the other numbers right.
    Of a servo that is always on, e and d are told apart only by what grows with its torque, as
    friction of a loaded gear does: each takes half of their sum.
    """
    rates = [log.rates for log in logs]
    q, v, a = (_joined([r[k] for r in rates]) for k in range(3))
    gain = _joined([log.beside.get("gain", np.ones(len(log.input))) for log in logs])
    on = _joined([log.beside.get("enable", np.ones(len(log.input))) for log in logs]) > 0
    error = gain * (_joined([log.input for log in logs]) - q)
    width = STEEP * float(np.sqrt(np.mean(v**2)))
    columns = {"gain": on * error, "damping": -v}
    least = LEAST * float(np.std(a) / max(np.std(v), 1e-300))
    extra = {"gravity": -np.sin(q), "coulomb": -np.tanh(v / width)}
    switched = 0.05 < on.mean() < 0.95  # else the back EMF is one with the damping
    if switched:
        extra["back_emf"] = -v * on
    numbers, left = _least(columns, a)
    limits = np.abs(error[on]).max(initial=0.0) * CLIPPED ** np.arange(1, LIMITS)
    clipped = None
    while extra or clipped is None:
        tried = [(_least(columns | {k: x}, a), k, x) for k, x in extra.items()]
        for limit in limits if clipped is None else ():
            held = on * np.clip(error, -limit, limit)
            tried.append((_least(columns | {"gain": held}, a), "limit", held))
        (new, less), name, column = min(tried, key=lambda t: t[0][1])
        if not less < (1 - PULLS) * left:
            break
        numbers, left = new, less
        columns["gain" if name == "limit" else name] = column
        extra.pop(name, None)
        if name == "limit":
            clipped = float(np.max(np.abs(column)))
    out = {"inertia": 1.0} | numbers
    out["gain"] = max(out["gain"], 1e-3)
    out["damping"] = max(out["damping"], least)
    if not switched:
        out["damping"] = out["back_emf"] = out["damping"] / 2
    if clipped is None:  # reached at the top of a jump or two it is not seen here: left open
        clipped = REACHED * float(np.abs(error[on]).max(initial=0.0))
    out["limit"] = clipped * out["gain"] or BOUNDLESS
    out.pop("coulomb", None)
    return out


def _least(columns: Mapping[str, np.ndarray], wanted) -> tuple[dict[str, float], float]:
    """Numbers not below 0 of the columns, and the squares that they leave."""
    A = np.stack(list(columns.values()), 1)
    size = np.linalg.norm(A, axis=0)
    size[size == 0] = 1.0
    x, left = nnls(A / size, wanted)
    return dict(zip(columns, map(float, x / size), strict=True)), left**2


def driven_numbers(logs: Sequence[LogSignals], turns: bool) -> dict[str, float]:
    """Inertia, damping and what pulls the axis back, over all logs at once.

    u = J a + d v + (k q or, where the axis `turns`, g sin(q)) - offset, a log each its offset.
    Both sides are low-passed as far as the acceleration asks for: noise in it makes J too small.
    Speeds that have lost their sign tell J and d alone.
    """
    speeds = [log.velocity for log in logs if log.velocity is not None]
    inputs = [log.input for log in logs]
    if speeds and all(map(loses_sign, speeds, inputs)):
        return rectified_numbers(speeds, inputs, logs[0].step)
    share = min(log.cutoff for log in logs)
    parts = [driven(log, share) for log in logs]
    q, v, a, given = (np.concatenate([p[k] for p in parts]) for k in range(4))
    ones = ones_of([len(p[0]) for p in parts])
    (J, d, *rest), best = pulled([a, v], q, given, ones, turns)
    if J <= 0:
        J = np.std(given) / max(np.std(a), 1e-300)
    out = {"inertia": float(J), "damping": float(at_least_damped(d, v, given))}
    return out | ({best: float(rest[0])} if best else {})


def at_least_damped(damping, v, given):
    """A damping, no less than takes a thousandth of the torque `given` at the speeds `v`."""
    return max(damping, 1e-3 * np.std(given) / max(np.std(v), 1e-300))


def pulled(
    columns: Sequence[np.ndarray], q, given, ones: Sequence[np.ndarray], turns: bool
) -> tuple[np.ndarray, str]:
    """(numbers of the columns and of what pulls back, its field or nothing): the torque `given`.

    What pulls an axis back at q, a spring or, where it `turns`, gravity, is there where it takes a
    large part of the torque.  The last numbers are the offsets of the logs, 1 in their `ones`.
    """
    pulls = {"": [], "stiffness": [q]} | ({"gravity": [np.sin(q)]} if turns else {})
    fits, at = {}, len(columns)
    for name, column in pulls.items():
        x, left = solved([*columns, *column, *ones], given)
        fits[name] = x, float(left @ left), column
    names = [
        k for k, (x, _, column) in fits.items()
        if column and x[at] > 0 and x[at] * np.std(column[0]) > SPRING * np.std(given)
    ]  # fmt: skip
    best = names[0] if names else ""
    if names == ["stiffness", "gravity"] and fits["gravity"][1] < (1 - PULLS) * fits[best][1]:
        best = "gravity"
    return fits[best][0], best


def ones_of(counts: Sequence[int]) -> list[np.ndarray]:
    """A column of ones for the samples of each log."""
    which = np.repeat(np.arange(len(counts)), counts)
    return [(which == i).astype(float) for i in range(len(counts))]


def solved(columns: Sequence[np.ndarray], wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(numbers of the columns, what they leave of what is wanted): least squares, scaled."""
    A = np.stack(columns, 1)
    size = np.linalg.norm(A, axis=0)
    size[size == 0] = 1.0
    x = np.linalg.lstsq(A / size, wanted, rcond=None)[0] / size
    return x, wanted - A @ x


def driven(log: LogSignals, share: float) -> tuple[np.ndarray, ...]:
    """Position, speed, acceleration and input of a log, low-passed; its spoilt ends cut off."""
    q, given = low_passed(log.position, share), low_passed(log.input, share)
    parts = q, np.gradient(q, log.step), acceleration(q, log.step), given
    return tuple(x[unspoilt(len(q), share)] for x in parts)
