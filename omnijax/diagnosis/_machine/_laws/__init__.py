"""Laws along whole runs: at their ports, and taken off the readings of their sensors."""

from .behind import begin_of as begin_of
from .behind import changed_beside_delays as changed_beside_delays
from .behind import folds as folds
from .behind import outputs_on_time as outputs_on_time
from .behind import reading_of as reading_of
from .behind import values_behind as values_behind
from .laws import along as along
from .laws import follow as follow
from .laws import moving_readings as moving_readings
from .laws import on_time as on_time
from .laws import readings as readings
from .laws import remembers as remembers
from .ports import ElasticLaws as ElasticLaws
from .ports import bare as bare
from .ports import radii as radii
