"""What measured wheel angles say of the motion: rolled lengths, speeds, attitude."""

from .dual_rows import shares_behind as shares_behind
from .dual_rows import two_rows as two_rows
from .motion import RunMotion as RunMotion
from .motion import angles_of as angles_of
from .motion import contact_directions as contact_directions
from .motion import groups_of_motion as groups_of_motion
from .motion import integrate as integrate
from .motion import measured_lengths as measured_lengths
from .motion import motion as motion
from .motion import rolling_radius as rolling_radius
from .smooth import likeliest as likeliest
from .smooth import penalty as penalty
from .smooth import smooth as smooth
from .wheels import WheelPlaces as WheelPlaces
from .wheels import WheelTables as WheelTables
from .wheels import shape_table as shape_table
from .wheels import wheel_tables as wheel_tables
