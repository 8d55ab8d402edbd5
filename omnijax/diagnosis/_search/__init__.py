"""The search for what a model lacks: candidates, scans, refits, held-out tests."""

from .candidates import Candidate as Candidate
from .candidates import Context as Context
from .candidates import candidates as candidates
from .candidates import number as number
from .fit import Fit as Fit
from .fit import refit as refit
from .fit import tangent_rows as tangent_rows
from .function_model import SmallModel as SmallModel
from .levels import Level as Level
from .levels import levels as levels
from .limits import upper_limits as upper_limits
from .model import STEPPED as STEPPED
from .model import AbstractModel as AbstractModel
from .model import Effect as Effect
from .model import Free as Free
from .model import Point as Point
from .model import Prior as Prior
from .model import free_numbers as free_numbers
from .search import Found as Found
from .search import Search as Search
from .settings import SETTINGS as SETTINGS
from .settings import SearchSettings as SearchSettings
from .where import discovered as discovered
from .where import locate as locate
