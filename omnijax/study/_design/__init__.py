"""Design searches under constraints, and trade-off fronts."""

from .cases import RigCases as RigCases
from .cases import check_study as check_study
from .design import design as design
from .design import design_problem as design_problem
from .design import designed_rig as designed_rig
from .front import Front as Front
from .generic import optimise as optimise
from .pareto import pareto as pareto
from .pareto import trade_off as trade_off
from .result import Design as Design
from .rig import objective_text as objective_text
