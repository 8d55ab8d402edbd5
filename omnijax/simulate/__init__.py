"""A rig and a drive in, a trajectory out."""

import sys as _sys
import types as _types

from ._drives import AbstractDrive as AbstractDrive
from ._drives import SpeedDrive as SpeedDrive
from ._drives import TorqueDrive as TorqueDrive
from ._drives import speeds as speeds
from ._drives import torques as torques
from ._files import load_trajectory as load_trajectory
from ._files import save_trajectory as save_trajectory
from ._files import to_recording as to_recording
from ._many import simulate_fixed as simulate_fixed
from ._many import simulate_many as simulate_many
from ._recorded import drive_from_recording as drive_from_recording
from ._recorded import measured as measured
from ._signals import Signal as Signal
from ._signals import constant as constant
from ._signals import ramp as ramp
from ._signals import step as step
from ._signals import table as table
from ._simulate import exact_run_obstacle as exact_run_obstacle
from ._simulate import simulate as simulate
from ._trajectory import Trajectory as Trajectory
from .exact import SteadyState as SteadyState
from .exact import exact_obstacle as exact_obstacle
from .exact import propagate as propagate
from .exact import steady_state as steady_state


class _CallablePackage(_types.ModuleType):
    """The package is its own main function: `omnijax.simulate(rig, drive, ts)`."""

    def __call__(self, *args, **kwargs) -> Trajectory:
        return simulate(*args, **kwargs)


_sys.modules[__name__].__class__ = _CallablePackage
