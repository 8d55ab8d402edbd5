"""The modal core: figures of many linear rigs at once, from their poles and residues."""

from .bulk import ModalFigures as ModalFigures
from .bulk import modal_figures as modal_figures
from .bulk import modal_obstacle as modal_obstacle
from .bulk import modal_steady as modal_steady
from .bulk import modal_steady_obstacle as modal_steady_obstacle
from .system import Operating as Operating
