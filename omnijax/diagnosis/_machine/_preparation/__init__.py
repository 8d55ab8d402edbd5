"""Runs made ready: their roles, bad samples, unknown start angles, and what is compared."""

from .compared import check_compared as check_compared
from .compared import said_of_compared as said_of_compared
from .outliers import readmitted as readmitted
from .outliers import said_of_outliers as said_of_outliers
from .outliers import without_outliers as without_outliers
from .roles import by_parts as by_parts
from .roles import split_runs as split_runs
from .roles import that_tell_their_motion as that_tell_their_motion
from .roles import with_roles as with_roles
from .start_angles import with_start_angles as with_start_angles
from .start_angles import without_encoder as without_encoder
