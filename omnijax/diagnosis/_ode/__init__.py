"""Machines of a few states as models of the diagnosis."""

from .build import build_model as build_model
from .evidence import OdeEvidence as OdeEvidence
from .evidence import balance_error as balance_error
from .evidence import missed_output as missed_output
from .hold import HoldReading as HoldReading
from .hold import better_reading as better_reading
from .hold import first_reading as first_reading
from .model import OdeModel as OdeModel
from .numbers import Numbers as Numbers
from .programs import Programs as Programs
from .rows import Balance as Balance
from .rows import FreeRun as FreeRun
from .rows import OdeRun as OdeRun
