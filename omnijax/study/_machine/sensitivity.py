"""`sensitivity` of an axis: what its numbers do to the misfit."""

from collections.abc import Sequence

import numpy as np

from ..._errors import RunError
from ...machine import Log, MachineFile, free_run_of
from .._sensitivity import Sensitivity
from .misfit import Misfit, checked_misfits
from .numbers import VariedNumbers


def sensitivity_machine(
    file: MachineFile, log: Log, metrics: str | Sequence[str] = "rms",
    parameters: Sequence[str] | None = None,
) -> Sensitivity:  # fmt: skip
    """What each number of a machine file does to the misfit of its free run under a log's inputs.

    Exact derivatives; `raw` is in the unit of what was measured by the parameter's.  Raises
    `InputError` for an unknown metric or parameter, `RunError` where the run leaves all bounds.
    """
    numbers = VariedNumbers.of(file)
    paths = list(numbers.where) if parameters is None else parameters
    misfit = Misfit(file, log, numbers.checked(paths), checked_misfits(metrics))
    values = np.array([numbers.value(p) for p in misfit.paths])
    figures, raw = misfit.slopes(values)
    if not (np.all(np.isfinite(figures)) and np.all(np.isfinite(raw))):
        free_run_of(file, log)  # says why there is none where this is so
        raise RunError("the free run of this axis left all bounds: it has no sensitivities.")
    return Sensitivity(
        misfit.paths, tuple(map(numbers.unit, misfit.paths)), values, misfit.metrics,
        (misfit.unit,) * len(misfit.metrics), figures, raw, "free-run",
    )  # fmt: skip
