"""The terminal: what is typed, tables, progress, and errors in one sentence."""

from .heap import give_back_freed_memory as give_back_freed_memory
from .heap import keep_freed_memory as keep_freed_memory
from .plain import PLAIN as PLAIN
from .progress import bar as bar
from .progress import stages as stages
from .progress import waiting as waiting
from .table import columns as columns
from .table import paragraph as paragraph
from .tokens import flowing as flowing
from .tokens import understood as understood
