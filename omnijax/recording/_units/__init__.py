"""Wrong units: sizes that a rig does not allow, and the factors that would explain them."""

from .wrong_units import mend_units as mend_units
