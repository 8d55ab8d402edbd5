"""Steady states of many designs at once, by pole pairs, where contacts decouple."""

from .steady import SteadyPlan as SteadyPlan
from .steady import plan_steady as plan_steady
from .steady import steady_bulk_obstacle as steady_bulk_obstacle
from .steady import steady_figures as steady_figures
from .steady import steady_gradients as steady_gradients
from .steady import steady_margins as steady_margins
