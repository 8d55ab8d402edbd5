"""The type checker of the tests: annotated shapes are checked at every call; an int is a float."""

from typing import Any, Self

import jax
import numpy as np
from beartype import BeartypeConf, FrozenDict, beartype
from numpy.typing import ArrayLike

ARRAYS = np.ndarray | np.generic | jax.Array  # where no shape is annotated, one is as good
# as another; a function alone does not show its class, and NumPy makes an array of nearly all
OVERRIDES = FrozenDict(
    {ArrayLike: Any, np.ndarray: ARRAYS, Self: Any, int: int | np.integer}  # as an index, say
)
checked = beartype(conf=BeartypeConf(is_pep484_tower=True, hint_overrides=OVERRIDES))
