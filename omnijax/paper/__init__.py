"""The paper remade: its figures, its claims judged, its errata checked."""

from ._claim import Claim as Claim
from ._claim import Erratum as Erratum
from ._claim import Reading as Reading
from ._reproduce import STEPS as STEPS
from ._reproduce import Reproduction as Reproduction
from ._reproduce import reproduce as reproduce
