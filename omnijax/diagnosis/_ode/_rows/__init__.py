"""Measured less predicted, run by run: which rows there are, and the programs that give them."""

from .before import matters as matters
from .evaluation import RowEvaluation as RowEvaluation
from .free_starts import FreeStarts as FreeStarts
from .known import states as states
from .measured import Measured as Measured
from .measured import Rows as Rows
from .numbers import Numbers as Numbers
from .programs import Programs as Programs
from .rows import Balance as Balance
from .rows import FreeRun as FreeRun
from .rows import OdeRun as OdeRun
from .rows import smoothed as smoothed
