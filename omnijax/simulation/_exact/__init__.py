"""Exact propagation: closed forms of the linear model, piece by piece."""

from .expm import Piece as Piece
from .expm import advance as advance
from .expm import basis_generator as basis_generator
from .expm import basis_row as basis_row
from .expm import levels_needed as levels_needed
from .expm import points as points
from .expm import second_moments as second_moments
from .forcing import Forcing as Forcing
from .forcing import directed as directed
from .forcing import forcing as forcing
from .forcing import forcing_signals as forcing_signals
from .forcing import like_groups as like_groups
from .forcing import stacked as stacked
from .period_map import Passages as Passages
from .period_map import longest_passage as longest_passage
from .period_map import passages as passages
from .period_map import periodic_starts as periodic_starts
from .propagate import propagate as propagate
from .propagate import propagate_in_pieces as propagate_in_pieces
from .propagate import propagated as propagated
from .propagate import propagation_obstacle as propagation_obstacle
from .propagate import reached_like as reached_like
from .system import ForcedSystem as ForcedSystem
from .system import balanced as balanced
from .system import exact_obstacle as exact_obstacle
from .system import forced_system as forced_system
