"""Exact propagation, steady states and their gradients: closed forms of the linear model."""

from ._propagate import propagate as propagate
from ._steady import SteadyState as SteadyState
from ._steady import steady_state as steady_state
from ._system import exact_obstacle as exact_obstacle
