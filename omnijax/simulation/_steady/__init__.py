"""Steady states at constant wheel speeds, and the search for their suprema."""

from .filtered import LinearFilter as LinearFilter
from .long_run import LongRun as LongRun
from .peak_search import sphere as sphere
from .spectrum import fourier as fourier
from .spectrum import line_output as line_output
from .spectrum import line_rates as line_rates
from .spectrum import line_response as line_response
from .spectrum import line_state as line_state
from .steady import SteadyState as SteadyState
from .steady import settled as settled
from .steady import steady_state as steady_state
