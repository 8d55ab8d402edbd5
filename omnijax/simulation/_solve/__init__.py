"""Solving in time: diffrax, the exponential method, fixed steps."""

from typing import Any

from .defaults import MAX_STEPS as MAX_STEPS
from .defaults import RTOL as RTOL
from .fixed_step import EXPONENTIAL as EXPONENTIAL
from .fixed_step import RUNGE_KUTTA as RUNGE_KUTTA
from .fixed_step import fixed_methods as fixed_methods
from .fixed_step import simulate_fixed as simulate_fixed
from .fixed_step import simulate_many as simulate_many
from .simulate import goes_exactly as goes_exactly
from .simulate import simulate as simulate
from .simulate import simulated as simulated
from .state_vector import build_model as build_model
from .state_vector import initial_state_like as initial_state_like


def __getattr__(name: str) -> Any:
    """What needs diffrax, which takes as long to import as an exact run takes."""
    if name in {"choose_solver", "solve_in_pieces"}:
        from . import solve

        return getattr(solve, name)
    if name in {"start_vector", "state_of", "term"}:
        from . import diffrax_term

        return getattr(diffrax_term, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
