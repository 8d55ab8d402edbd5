"""What a law of small strength changes in every channel of a run."""

from .linearisation import THIN as THIN
from .linearisation import Linearisation as Linearisation
from .linearisation import base_of as base_of
from .linearisation import transfer as transfer
from .linearisation import turned_by as turned_by
from .tangents import encoder_shifted as encoder_shifted
from .tangents import reshaped as reshaped
from .tangents import shape_along as shape_along
from .tangents import signatures as signatures
