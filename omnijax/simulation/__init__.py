"""A rig and a drive in, a trajectory out."""

from typing import TYPE_CHECKING

from .._lazy import lazy_face

if TYPE_CHECKING:
    from ._batch_last import LANES as LANES
    from ._batch_last import WIDTH as WIDTH
    from ._batch_last import side_by_side as side_by_side
    from ._between import SENSOR_POINTS as SENSOR_POINTS
    from ._between import at_samples as at_samples
    from ._between import to_be_seen as to_be_seen
    from ._between import without_sensors as without_sensors
    from ._drives import RATE as RATE
    from ._drives import AbstractDrive as AbstractDrive
    from ._drives import SpeedDrive as SpeedDrive
    from ._drives import TorqueDrive as TorqueDrive
    from ._drives import drive_for as drive_for
    from ._drives import sample_times as sample_times
    from ._drives import speeds as speeds
    from ._drives import torques as torques
    from ._exact import ForcedSystem as ForcedSystem
    from ._exact import exact_obstacle as exact_obstacle
    from ._exact import forced_system as forced_system
    from ._exact import forcing as forcing
    from ._exact import propagate as propagate
    from ._exact import propagate_in_pieces as propagate_in_pieces
    from ._exact import propagated as propagated
    from ._exact import reached_like as reached_like
    from ._files import asked_in as asked_in
    from ._files import check_suffix as check_suffix
    from ._files import save_trajectory as save_trajectory
    from ._files import to_recording as to_recording
    from ._modal import BULK_METRICS as BULK_METRICS
    from ._modal import FilterPoles as FilterPoles
    from ._modal import ModalFigures as ModalFigures
    from ._modal import ModalRuns as ModalRuns
    from ._modal import Operating as Operating
    from ._modal import RunChannels as RunChannels
    from ._modal import SteadyFigures as SteadyFigures
    from ._modal import channels_of as channels_of
    from ._modal import figures_obstacle as figures_obstacle
    from ._modal import modal_figures as modal_figures
    from ._modal import modal_obstacle as modal_obstacle
    from ._modal import modal_runs as modal_runs
    from ._modal import modal_steady as modal_steady
    from ._modal import modal_steady_obstacle as modal_steady_obstacle
    from ._padding import EXACT_PIECE as EXACT_PIECE
    from ._padding import STEPPED_PIECE as STEPPED_PIECE
    from ._padding import Gathered as Gathered
    from ._padding import bytes_a_sample as bytes_a_sample
    from ._plots import channel_scale as channel_scale
    from ._plots import plot_run as plot_run
    from ._remarks import drift_remarks as drift_remarks
    from ._remarks import remarks as remarks
    from ._remarks import speed_remarks as speed_remarks
    from ._sensors import drive_from_recording as drive_from_recording
    from ._sensors import measured as measured
    from ._signals import Signal as Signal
    from ._signals import constant as constant
    from ._signals import is_constant as is_constant
    from ._signals import ramp as ramp
    from ._signals import step as step
    from ._signals import table as table
    from ._solve import EXPONENTIAL as EXPONENTIAL
    from ._solve import MAX_STEPS as MAX_STEPS
    from ._solve import RTOL as RTOL
    from ._solve import RUNGE_KUTTA as RUNGE_KUTTA
    from ._solve import build_model as build_model
    from ._solve import choose_solver as choose_solver
    from ._solve import fixed_methods as fixed_methods
    from ._solve import goes_exactly as goes_exactly
    from ._solve import initial_state_like as initial_state_like
    from ._solve import simulate as simulate
    from ._solve import simulate_fixed as simulate_fixed
    from ._solve import simulate_many as simulate_many
    from ._solve import simulated as simulated
    from ._solve import solve_in_pieces as solve_in_pieces
    from ._solve import start_vector as start_vector
    from ._solve import state_of as state_of
    from ._solve import term as term
    from ._steady import LinearFilter as LinearFilter
    from ._steady import LongRun as LongRun
    from ._steady import SteadyState as SteadyState
    from ._steady import fourier as fourier
    from ._steady import line_output as line_output
    from ._steady import line_rates as line_rates
    from ._steady import line_response as line_response
    from ._steady import line_state as line_state
    from ._steady import settled as settled
    from ._steady import steady_state as steady_state
    from ._trajectory import Trajectory as Trajectory
    from ._trajectory import load_run as load_run
    from ._trajectory import load_run as load_trajectory  # noqa: F401  (its name in 0.1)

__getattr__, __dir__ = lazy_face(__name__)
