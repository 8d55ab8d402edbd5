"""Machines of a few states: an axis, or one of the user's, with laws at their places."""

from typing import TYPE_CHECKING

from .._lazy import lazy_face

if TYPE_CHECKING:
    from ._axis import Axis as Axis
    from ._base import AbstractMachine as AbstractMachine
    from ._case import MachineCase as MachineCase
    from ._case import is_machine_case as is_machine_case
    from ._case import log_beside as log_beside
    from ._case import read_machine_case as read_machine_case
    from ._criterion import criterion_of as criterion_of
    from ._criterion import one_inertia as one_inertia
    from ._field import field_of_numbers as field_of_numbers
    from ._field import settled_memory as settled_memory
    from ._field import vector_field as vector_field
    from ._file import MachineFile as MachineFile
    from ._file import load_machine as load_machine
    from ._file import machine_text as machine_text
    from ._file import numbers_of as numbers_of
    from ._file import parse_machine as parse_machine
    from ._file import with_numbers as with_numbers
    from ._first_numbers import LogSignals as LogSignals
    from ._guess import Guess as Guess
    from ._guess import guess as guess
    from ._guess import of_one_machine as of_one_machine
    from ._guessed_case import case_files as case_files
    from ._guessed_case import numbers_of_logs as numbers_of_logs
    from ._hold import InputHold as InputHold
    from ._hold import acting as acting
    from ._hold import input_hold as input_hold
    from ._json_schema import machine_schema as machine_schema
    from ._log import Log as Log
    from ._log import LogFile as LogFile
    from ._log import measured_of as measured_of
    from ._log import read_log as read_log
    from ._low_pass import NOISY as NOISY
    from ._low_pass import acceleration_noise as acceleration_noise
    from ._model_file import load_model as load_model
    from ._ports import PlacedLaw as PlacedLaw
    from ._ports import Ports as Ports
    from ._ports import delayed_inputs as delayed_inputs
    from ._rectified import loses_sign as loses_sign
    from ._sample_times import travelled as travelled
    from ._schema import KEYS as KEYS
    from ._schema import axis_unit as axis_unit
    from ._schema import field_units as field_units
    from ._schema import least_of as least_of
    from ._schema import may_be_absent as may_be_absent
    from ._simulate import FreeMotion as FreeMotion
    from ._simulate import between as between
    from ._simulate import free_motion as free_motion
    from ._simulate import free_motion_of as free_motion_of
    from ._simulate import free_run as free_run
    from ._simulate import free_run_of as free_run_of
    from ._simulate import outputs_along as outputs_along
    from ._simulate import places_of as places_of
    from ._simulate import sensed as sensed
    from ._simulate import slopes_at_start as slopes_at_start
    from ._simulate import start_state as start_state
    from ._simulate import states_along as states_along
    from ._steps import most_steps as most_steps
    from ._steps import settled as settled
    from ._steps import slopes_of as slopes_of
    from ._steps import steepest_slopes as steepest_slopes
    from ._steps import steps_for as steps_for
    from ._term import start_vector as start_vector
    from ._term import term as term

__getattr__, __dir__ = lazy_face(__name__)
