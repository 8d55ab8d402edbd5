"""What poles make of a measured table that a wheel passes at constant speed."""

from .outputs import TableLanes as TableLanes
from .outputs import table_lanes as table_lanes
from .outputs import table_outputs as table_outputs
from .response import forced_on as forced_on
from .response import moved as moved
from .response import phis as phis
from .response import rate_of as rate_of
from .response import unit_moves as unit_moves
from .slopes import TableSums as TableSums
from .slopes import table_slopes as table_slopes
from .slopes import table_sums as table_sums
