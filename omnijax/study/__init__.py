"""Studies of many designs: sweeps over parameters and drives."""

from ._points import Grid as Grid
from ._points import LatinHypercube as LatinHypercube
from ._points import Sobol as Sobol
from ._sweep import sweep as sweep
from ._sweep_result import SweepResult as SweepResult
from ._sweep_result import load_sweep as load_sweep
