"""Figures of runs from the samples t = 0, step, ..., duration, and their derivatives."""

from .blocks import LENGTH as LENGTH
from .blocks import BlockTables as BlockTables
from .blocks import OutputParts as OutputParts
from .blocks import Weights as Weights
from .blocks import shown_by as shown_by
from .blocks import stored_forced as stored_forced
from .figures import samples_of as samples_of
from .output_sums import slopes_of as slopes_of
from .passages import repeated as repeated
from .peak import peak_sums as peak_sums
from .sums_along import sums_along as sums_along
from .walk import Walk as Walk
from .walk import WalkState as WalkState
