"""What a row of a run weighs: the noise of its sensor, and what no law explains."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from .._rows import Measured, Rows
from .floor import inflation


@dataclasses.dataclass(frozen=True)
class RowNoise:
    """1-sigma (runs,) of the rows of each run, of which `inflation` say as much as one.

    `floor` is what no law explains, in the sensor's noise.
    """

    sigma: np.ndarray
    inflation: float = 1.0
    floor: float = 1.0

    @staticmethod
    def of_sensor(noise: np.ndarray, rows: Sequence[Rows]) -> "RowNoise":
        """By white noise of 1-sigma `noise` (runs,) in what is measured."""
        gains = np.array([r.gain() for r in rows])
        return RowNoise(np.maximum(noise, 1e-300) * gains)

    def weights(self, measured: Measured, split: str) -> np.ndarray:
        """1/sigma (rows,) of a split, as if `inflation` rows said as much as one."""
        sigma = self.sigma * np.sqrt(self.inflation)
        return np.concatenate([
            np.full(measured.rows[i].count, 1 / sigma[i]) for i in measured.splits[split]
        ])  # fmt: skip

    def raised(self, left: Sequence[np.ndarray], used: int) -> "RowNoise":
        """That of rows of which the best laws leave so much, by run, with `used` free numbers."""
        whole, repeated = np.concatenate(left), inflation(left)
        independent = max(len(whole) / repeated - used, 1.0)
        spread = float(whole @ whole) / len(whole) * (1 + used / independent)
        floor = max(1.0, float(np.sqrt(spread)))
        return RowNoise(self.sigma * floor, repeated, floor)

    def said(self) -> str:
        """The floor in words."""
        return (
            f"What no law of the library explains on the train runs is {self.floor:.3g} times the "
            f"sensor's noise, and {self.inflation:.3g} of its rows say as much as one: each effect "
            "had to stand against that."
        )
