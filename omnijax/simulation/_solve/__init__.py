"""Solving in time: diffrax, the exponential method, fixed steps."""

from .fixed_step import simulate_fixed as simulate_fixed
from .fixed_step import simulate_many as simulate_many
from .simulate import exact_run_obstacle as exact_run_obstacle
from .simulate import simulate as simulate
from .solve import choose_solver as choose_solver
from .solve import solve_in_pieces as solve_in_pieces
from .state_vector import build_model as build_model
from .state_vector import initial_state_like as initial_state_like
