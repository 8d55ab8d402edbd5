"""What poles make of a measured table that a wheel passes at constant speed."""

from .outputs import table_outputs as table_outputs
from .slopes import with_tables as with_tables
