"""What a column may be measured in, and from where on a size is that of another unit."""

from collections.abc import Iterator

import numpy as np

from .._recording import Recording

Wrong = Iterator[tuple[tuple[str, ...], float]]  # columns, and how many times too large they are

FACTORS = {  # what a column may be in -> values in that unit over values in SI
    "theta": {"mrad": 1e3, "deg": 180 / np.pi, "turn": 1 / (2 * np.pi)},
    "Omega": {"mrad/s": 1e3, "deg/s": 180 / np.pi, "rpm": 30 / np.pi},
    "dR": {"mm": 1e3, "um": 1e6, "km": 1e-3},
    "a": {"mm/s^2": 1e3, "km/s^2": 1e-3},
    "torque": {"N mm": 1e3, "kN m": 1e-3},
    "force": {"mN": 1e3, "kN": 1e-3},
}
WRONG = 50.0  # times too large or too small: beyond every effect of a real machine
PIECE = 0.5  # s, over which what turned, moved or was pushed is compared


def pieces(run: Recording) -> int:
    """Samples in a piece."""
    return max(int(PIECE / run.step), 2)
