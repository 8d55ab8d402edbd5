"""Recording -> where -> which -> refit -> report: the missing effect, named or honestly not."""

from ._diagnose import diagnose as diagnose
from ._fit import refit as refit
from ._laws import along as along
from ._model import AbstractModel as AbstractModel
from ._model import Effect as Effect
from ._model import Point as Point
from ._model import Prior as Prior
from ._result import Diagnosis as Diagnosis
from ._result import Gap as Gap
from ._result import Named as Named
from ._rig_model import RigModel as RigModel
from ._search import Search as Search
from ._small import SmallModel as SmallModel
