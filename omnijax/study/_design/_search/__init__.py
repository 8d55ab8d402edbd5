"""Searches of a design: where they start, how they run and end, and whether that is an optimum."""

from .engine import Engine as Engine
from .figures import limits_text as limits_text
from .figures import nothing_left as nothing_left
from .figures import values_of as values_of
from .judge import SearchEnd as SearchEnd
from .judge import best_of as best_of
from .kkt import ACTIVE as ACTIVE
from .kkt import FEASIBLE as FEASIBLE
from .kkt import ON_BOUND as ON_BOUND
from .kkt import STATIONARY as STATIONARY
from .many import followed_by as followed_by
from .search import Adam as Adam
from .search import Starts as Starts
from .starts import start_shares as start_shares
