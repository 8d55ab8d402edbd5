"""Rotation along a run: torques of the laws and the response to them."""

from .observer import held_turning as held_turning
from .observer import needs_observer as needs_observer
from .observer import observed_turning as observed_turning
from .observer import path_along as path_along
from .rotation import MeasuredTurning as MeasuredTurning
from .rotation import attitude_matters as attitude_matters
from .rotation import commanded as commanded
from .rotation import each_law as each_law
from .rotation import each_moment as each_moment
from .rotation import rotation_moments as rotation_moments
from .rotation import run_torques as run_torques
from .rotation import turning as turning
