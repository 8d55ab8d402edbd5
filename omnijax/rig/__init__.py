"""What the machine is, and the files that say so."""

from ._machine import Closure as Closure
from ._machine import Contact as Contact
from ._machine import Mount as Mount
from ._machine import Placed as Placed
from ._machine import Platform as Platform
from ._machine import Rig as Rig
from ._machine import Sphere as Sphere
from ._machine import Wheels as Wheels
from ._machine import grouped_profiles as grouped_profiles
from ._machine import over_wheels as over_wheels
from ._machine import place_law as place_law
