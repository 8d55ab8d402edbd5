"""Sweeps: designs in chunks, stored, resumable, in one process or many."""

from .evaluator import Evaluator as Evaluator
from .progress import Bar as Bar
from .progress import clock as clock
from .progress import progress as progress
from .progress import status_text as status_text
from .result import SweepResult as SweepResult
from .result import load_sweep as load_sweep
from .sweep import sweep as sweep
