"""The modal core: figures of many linear rigs at once, from their poles and residues."""

from ._long_run import FilterPoles as FilterPoles
from ._long_run import SteadyFigures as SteadyFigures
from .bulk import ModalFigures as ModalFigures
from .bulk import modal_figures as modal_figures
from .bulk import modal_steady as modal_steady
from .many_runs import ModalRuns as ModalRuns
from .many_runs import modal_runs as modal_runs
from .obstacles import BULK_METRICS as BULK_METRICS
from .obstacles import figures_obstacle as figures_obstacle
from .obstacles import modal_obstacle as modal_obstacle
from .obstacles import modal_steady_obstacle as modal_steady_obstacle
from .runs import RunChannels as RunChannels
from .runs import channels_of as channels_of
from .system import Operating as Operating
