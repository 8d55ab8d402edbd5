"""Figures of the long run: mean squares in closed form, suprema over its phases, derivatives."""

from .figures import LongRunTable as LongRunTable
from .figures import SteadyFigures as SteadyFigures
from .figures import outputs_asked as outputs_asked
from .figures import rows_asked as rows_asked
from .figures import steady_of as steady_of
from .filtered import FilterPoles as FilterPoles
from .phases import longest_period as longest_period
