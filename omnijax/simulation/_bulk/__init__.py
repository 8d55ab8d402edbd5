"""Closed forms by pole pairs, for many designs at once."""

from .rig import Bulk as Bulk
from .rig import bulk_checked as bulk_checked
from .rig import bulk_figures as bulk_figures
from .rig import bulk_gradients as bulk_gradients
from .rig import bulk_obstacle as bulk_obstacle
from .rig import plan_bulk as plan_bulk
from .steady import SteadyPlan as SteadyPlan
from .steady import plan_steady as plan_steady
from .steady import steady_bulk_obstacle as steady_bulk_obstacle
from .steady import steady_figures as steady_figures
from .steady import steady_gradients as steady_gradients
from .steady import steady_margins as steady_margins
