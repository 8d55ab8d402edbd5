"""What a rig may lack: laws at their places, and numbers that its file leaves open."""

from .candidates import candidates as candidates
from .uncertain import rig_priors as rig_priors
from .uncertain import with_parameters as with_parameters
from .uncertain import with_sensors as with_sensors
from .unit_laws import Context as Context
from .unit_laws import held_law as held_law
from .unit_laws import held_sizes as held_sizes
