"""A sweep's arrays in memory, read and written as zarr's, which takes half a second to start."""

from collections.abc import Iterable
from typing import Any

import numpy as np


class HeldArray:
    """One array: its values and attributes."""

    def __init__(self, values: np.ndarray, attrs: dict[str, Any]):
        self._values, self.attrs = values, attrs
        self.shape, self.dtype = values.shape, values.dtype

    def __getitem__(self, part: slice) -> np.ndarray:
        return self._values[part].copy()

    def __setitem__(self, part: slice, values: np.ndarray) -> None:
        self._values[part] = values


class HeldGroup:
    """Arrays by name, and what is said about them all."""

    def __init__(self, attrs: dict[str, Any], arrays: dict[str, HeldArray]):
        self.attrs, self._arrays = attrs, arrays

    def __getitem__(self, name: str) -> HeldArray:
        return self._arrays[name]

    def arrays(self) -> Iterable[tuple[str, HeldArray]]:
        """Names and arrays."""
        return self._arrays.items()
