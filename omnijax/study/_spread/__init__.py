"""What spread does: global sensitivity and tolerances of parts."""

from .global_sensitivity import analyse as analyse
from .global_sensitivity import global_sensitivity as global_sensitivity
from .inputs import Input as Input
from .result import GlobalSensitivity as GlobalSensitivity
from .tolerance_result import Tolerances as Tolerances
from .tolerances import tolerances as tolerances
