"""Scrambled Sobol points; SciPy's statistics, slow to import, wait for the first of them."""

import numpy as np


def sobol_points(size: int, count: int, seed: int) -> np.ndarray:
    """The first `count` points of a scrambled Sobol sequence in the unit cube, (count, size)."""
    from scipy.stats import qmc

    engine = qmc.Sobol(size, scramble=True, rng=seed)
    return engine.random_base2(int(np.ceil(np.log2(count))))[:count]
