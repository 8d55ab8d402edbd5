"""Studies of an axis under the input of a log: its free run against what was measured."""

from typing import TYPE_CHECKING

from ..._lazy import lazy_face

if TYPE_CHECKING:
    from .misfit import MISFITS as MISFITS
    from .sensitivity import sensitivity_machine as sensitivity_machine
    from .sweep import MachineSweep as MachineSweep
    from .sweep import sweep_machine as sweep_machine

__getattr__, __dir__ = lazy_face(__name__)
