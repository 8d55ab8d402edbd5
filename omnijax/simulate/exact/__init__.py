"""Exact propagation, steady states and their gradients: closed forms of the linear model."""

from ._bulk_rig import Bulk as Bulk
from ._bulk_rig import bulk_figures as bulk_figures
from ._bulk_rig import bulk_gradients as bulk_gradients
from ._bulk_rig import bulk_obstacle as bulk_obstacle
from ._bulk_rig import plan_bulk as plan_bulk
from ._propagate import propagate as propagate
from ._propagate import propagation_obstacle as propagation_obstacle
from ._steady import SteadyState as SteadyState
from ._steady import steady_state as steady_state
from ._system import exact_obstacle as exact_obstacle
