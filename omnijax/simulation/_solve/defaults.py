"""What a run by a solver takes where nothing else is said: `simulate`, commands and studies."""

RTOL = 1e-8  # relative tolerance a step
MAX_STEPS = 200_000  # a run is given up beyond
