"""The sphere on its wheels as a model of the diagnosis: what its runs should show."""

from .candidates import candidates as candidates
from .clocks import CLOCK as CLOCK
from .elastic import SIGNALS as SIGNALS
from .elastic import rest_state as rest_state
from .laws import along as along
from .linearisation import THIN as THIN
from .linearisation import Linearisation as Linearisation
from .linearisation import transfer as transfer
from .linearisation import turned_by as turned_by
from .locate import locate as locate
from .machine import Machine as Machine
from .modes import forced as forced
from .modes import observe as observe
from .modes import propagate as propagate
from .outliers import without_outliers as without_outliers
from .rig_model import LINES as LINES
from .rig_model import RigModel as RigModel
from .roles import with_roles as with_roles
from .runs import FINE as FINE
from .runs import Run as Run
from .runs import to_run as to_run
from .start_angles import with_start_angles as with_start_angles
from .start_angles import without_encoder as without_encoder
from .unit_laws import Context as Context
from .wheels import wheel_tables as wheel_tables
