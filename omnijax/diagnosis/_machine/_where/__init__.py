"""What the residual of a run is asked: where a rig's prediction and the run disagree."""

from .locate import locate as locate
from .orders import estimated as estimated
from .orders import order_grid as order_grid
from .orders import promising as promising
from .orders import strongest_orders as strongest_orders
from .sets_of_lines import LineSet as LineSet
from .sets_of_lines import line_sets as line_sets
from .shaft_lines import LAWS as LAWS
from .shaft_lines import shaft_runs as shaft_runs
