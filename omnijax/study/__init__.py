"""Studies of many designs: sweeps over parameters and drives."""

from typing import TYPE_CHECKING

from .._lazy import lazy_face

if TYPE_CHECKING:
    from .._text import estimate as estimate
    from .._text import quantity_text as quantity_text
    from .._text import scaled as scaled
    from ._axes import split_vary as split_vary
    from ._design import Design as Design
    from ._design import Front as Front
    from ._design import check_study as check_study
    from ._design import design as design
    from ._design import design_problem as design_problem
    from ._design import designed_rig as designed_rig
    from ._design import objective_text as objective_text
    from ._design import optimise as optimise
    from ._design import pareto as pareto
    from ._design import trade_off as trade_off
    from ._differences import differences as differences
    from ._evaluation import METHODS as METHODS
    from ._evaluation import checked_metrics as checked_metrics
    from ._file import Study as Study
    from ._file import load_study as load_study
    from ._file import parse_study as parse_study
    from ._file import study_schema as study_schema
    from ._machine import MISFITS as MISFITS
    from ._machine import MachineSweep as MachineSweep
    from ._machine import sensitivity_machine as sensitivity_machine
    from ._machine import sweep_machine as sweep_machine
    from ._parameters import refit_remarks as refit_remarks
    from ._points import Grid as Grid
    from ._points import LatinHypercube as LatinHypercube
    from ._points import Sobol as Sobol
    from ._problem import Limit as Limit
    from ._problem import Problem as Problem
    from ._problem import Variable as Variable
    from ._sensitivity import Sensitivity as Sensitivity
    from ._sensitivity import SpeedSensitivity as SpeedSensitivity
    from ._sensitivity import sensitivity as sensitivity
    from ._sensitivity import sensitivity_over_speeds as sensitivity_over_speeds
    from ._spread import GlobalSensitivity as GlobalSensitivity
    from ._spread import Input as Input
    from ._spread import Tolerances as Tolerances
    from ._spread import analyse as analyse
    from ._spread import global_sensitivity as global_sensitivity
    from ._spread import tolerances as tolerances
    from ._study_folder import Folder as Folder
    from ._sweep import Bar as Bar
    from ._sweep import Evaluator as Evaluator
    from ._sweep import SweepResult as SweepResult
    from ._sweep import clock as clock
    from ._sweep import load_sweep as load_sweep
    from ._sweep import progress as progress
    from ._sweep import status_text as status_text
    from ._sweep import sweep as sweep

__getattr__, __dir__ = lazy_face(__name__)
