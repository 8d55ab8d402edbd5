"""Runs of `omnijax simulate`: with progress, compared, summarised."""

from .compare import compared as compared
from .compare import differences as differences
from .compare import lay_over as lay_over
from .run import StoredPieces as StoredPieces
from .run import asked_of as asked_of
from .run import perform as perform
from .run import planned as planned
from .run import whole_run as whole_run
from .summary import show as show
from .summary import summarise as summarise
