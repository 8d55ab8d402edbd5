"""Exact local sensitivities."""

from .plot import new_axes as new_axes
from .sensitivity import Sensitivity as Sensitivity
from .sensitivity import sensitivity as sensitivity
from .speeds import SpeedSensitivity as SpeedSensitivity
from .speeds import sensitivity_over_speeds as sensitivity_over_speeds
from .target import Evaluation as Evaluation
from .target import checked_metrics as checked_metrics
from .target import checked_parameters as checked_parameters
from .target import evaluation as evaluation
from .target import speaks_of_all as speaks_of_all
from .target import values_of as values_of
