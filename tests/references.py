"""The independent program's trajectories of `data/reference`: machine, inputs and every output."""

import csv
import gzip
from pathlib import Path
from typing import NamedTuple

import numpy as np

from omnijax.rig import Rig, load_rig

REFERENCES = Path(__file__).parent / "data" / "reference"


class Reference(NamedTuple):
    """One noise-free run and its machine; rows are samples, read as they stand in the file."""

    rig: Rig
    time: np.ndarray
    torque: np.ndarray  # N m, a column a wheel
    force: np.ndarray  # N, on the platform
    outputs: dict[str, np.ndarray]  # by column: dR_x, theta_1, ...

    @property
    def angles(self) -> np.ndarray:
        """Wheel angles at the start, rad."""
        return np.array([self.outputs[f"theta_{i + 1}"][0] for i in range(self.torque.shape[1])])


def reference(name: str) -> Reference:
    """`ref-1` (three orthogonal wheels) or `ref-2` (tripod; rolling and spin resistance)."""
    with gzip.open(REFERENCES / name / "run-1.csv.gz", "rt") as file:
        header, *rows = csv.reader(file)
    column = dict(zip(header, np.array(rows, float).T, strict=True))
    time = column.pop("t")
    torque = np.stack([column.pop(f"torque_{i}") for i in (1, 2, 3)], axis=1)
    force = [column.pop(f"force_{axis}", np.zeros_like(time)) for axis in "xyz"]
    rig = load_rig(REFERENCES / name / "rig.toml")
    return Reference(rig, time, torque, np.stack(force, axis=1), column)
