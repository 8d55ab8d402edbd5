"""Exact propagation, steady states and their gradients: closed forms of the linear model."""

from ._bulk_rig import Bulk as Bulk
from ._bulk_rig import bulk_checked as bulk_checked
from ._bulk_rig import bulk_figures as bulk_figures
from ._bulk_rig import bulk_gradients as bulk_gradients
from ._bulk_rig import bulk_obstacle as bulk_obstacle
from ._bulk_rig import plan_bulk as plan_bulk
from ._propagate import propagate as propagate
from ._propagate import propagation_obstacle as propagation_obstacle
from ._steady import SteadyState as SteadyState
from ._steady import steady_state as steady_state
from ._steady_bulk import SteadyPlan as SteadyPlan
from ._steady_bulk import plan_steady as plan_steady
from ._steady_bulk import steady_bulk_obstacle as steady_bulk_obstacle
from ._steady_bulk import steady_figures as steady_figures
from ._steady_bulk import steady_gradients as steady_gradients
from ._steady_bulk import steady_margins as steady_margins
from ._system import exact_obstacle as exact_obstacle
