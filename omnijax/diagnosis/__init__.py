"""Recording -> where -> which -> refit -> report: the missing effect, named or honestly not."""

from typing import TYPE_CHECKING

from .._lazy import lazy_face

if TYPE_CHECKING:
    from ._answer import Diagnosis as Diagnosis
    from ._answer import Named as Named
    from ._answer import OutputGap as OutputGap
    from ._answer import Sizes as Sizes
    from ._answer import effect_sizes_on_held_out as effect_sizes_on_held_out
    from ._axis_case import force_error as force_error
    from ._diagnose import diagnose as diagnose
    from ._machine import RigModel as RigModel
    from ._machine import along as along
    from ._search import AbstractModel as AbstractModel
    from ._search import Effect as Effect
    from ._search import Point as Point
    from ._search import Prior as Prior
    from ._search import Search as Search
    from ._search import SmallModel as SmallModel
    from ._search import refit as refit

__getattr__, __dir__ = lazy_face(__name__)
