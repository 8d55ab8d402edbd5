"""Numbers of a coupled drive to begin with: motor and load both measured, a spring between them."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ._first_numbers import STEEP, LogSignals, at_least_damped, driven, ones_of, pulled, solved
from ._low_pass import cutoff_of

TOLD = 0.5  # share of the twist's squares that the motor's equation must explain
BENT = 0.5  # of the twist's size, what the input alone bends the drive by
LIGHT = 0.02  # of both inertias, below which the motor's is none: a goal that the axis follows
DIRECT = 0.1  # from a ratio of 1, within which it is 1: elastic drives differ by little
DAMPED = 0.01  # damping ratio of a drive of which the log shows less


@dataclasses.dataclass(frozen=True)
class CoupledDrive:
    """Fields of `Axis` of a coupled drive, and the ratio by which its load turns slower.

    `told` is the share of the twist's squares that the motor's equation explains.
    """

    numbers: dict[str, float]
    ratio: float
    told: float


def coupled(logs: Sequence[LogSignals], turns: bool) -> CoupledDrive | None:
    """A coupled drive over all logs at once; None where the relative motion is that of no drive.

    Motor q and load q2, by the `ratio` in the motor's turns, with the twist w = q - q2:
    k w = u - J q'' - d q' - c w' - dry friction + offset (a log each), and J2 q2'' = k w + c w'
    less what pulls the load back.  The first is solved for the twist, which its encoders' noise is
    in; taken for one of the causes, noise would make the drive too soft.  Dry friction is left to
    the diagnosis: here it only keeps the other numbers right.
    """
    if any(log.second is None for log in logs):
        return None
    sides = [log.position for log in logs], [np.asarray(log.second) for log in logs]
    share = min(cutoff_of(q, log.step) for side in sides for q, log in zip(side, logs, strict=True))
    first, second = (
        [
            driven(dataclasses.replace(log, position=q), share)
            for q, log in zip(side, logs, strict=True)
        ]
        for side in sides
    )
    ones = ones_of([len(part[0]) for part in first])
    q, v, a, given = (np.concatenate([p[k] for p in first]) for k in range(4))
    q2, v2, a2, _ = (np.concatenate([p[k] for p in second]) for k in range(4))
    ratio = float(solved([q2, v2, a2, *ones], q)[0][0])
    if abs(ratio - 1) < DIRECT:
        ratio = 1.0
    q2, v2, a2 = ratio * q2, ratio * v2, ratio * a2
    twist = q - q2
    dry = np.tanh(v / (STEEP * np.sqrt(np.mean(v**2)) or 1.0))
    (soft, light, *rest), left = solved([given, -a, -v, v2 - v, -dry, *ones], twist)
    bent = solved(ones, twist)[1]
    told = 1 - float(left @ left) / max(float(bent @ bent), 1e-300)
    if told < TOLD or soft <= 0 or soft * np.std(given) < BENT * np.std(bent):
        return None
    k, J = 1 / soft, light / soft
    d, c, rubs = (max(0.0, x / soft) for x in rest[:3])
    (J2, *pull), name = pulled([a2], q2, given - J * a - d * v - rubs * dry, ones, turns)
    if J2 <= 0 or J < LIGHT * (J + J2):
        return None
    numbers = {
        "inertia": J, "damping": at_least_damped(d, v, given),
        "second_inertia": J2, "second_stiffness": k,
        "second_damping": max(c, 2 * DAMPED * np.sqrt(k * J * J2 / (J + J2))),
    } | ({name: pull[0]} if name else {})  # fmt: skip
    return CoupledDrive({key: float(x) for key, x in numbers.items()}, ratio, told)
