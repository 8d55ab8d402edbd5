"""Exact local sensitivities."""

from .sensitivity import Sensitivity as Sensitivity
from .sensitivity import sensitivity as sensitivity
from .speeds import SpeedSensitivity as SpeedSensitivity
from .speeds import sensitivity_over_speeds as sensitivity_over_speeds
