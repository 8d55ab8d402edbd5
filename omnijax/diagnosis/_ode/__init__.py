"""Machines of a few states as models of the diagnosis."""

from ._evidence import OdeEvidence as OdeEvidence
from ._evidence import balance_error as balance_error
from ._evidence import missed_output as missed_output
from ._rows import Balance as Balance
from ._rows import FreeRun as FreeRun
from ._rows import Numbers as Numbers
from ._rows import OdeRun as OdeRun
from ._rows import Programs as Programs
from .build import build_model as build_model
from .hold import HoldReading as HoldReading
from .hold import better_reading as better_reading
from .hold import first_reading as first_reading
from .model import OdeModel as OdeModel
