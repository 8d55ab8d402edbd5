"""What the residual of a run is asked: where a rig's prediction and the run disagree."""

from .locate import locate as locate
from .orders import strongest_orders as strongest_orders
