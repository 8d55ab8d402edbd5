"""Wrong units: channels that are a thousand times, or degrees and rpm, off what the rig allows.

Four relations hold in every run, whatever effect hides in it: the wheels' angles and the sphere's
angle roll on each other (R s.Omega = r omega), torques turn the sphere, dR has the size of a gap,
and the platform's mean acceleration is that of the force on the whole machine.
"""

from typing import Any

import numpy as np

from .._columns import group_of, unit_of
from .._recording import Fault, Recording
from .factors import FACTORS
from .sizes import accelerations, gap_sizes, siblings
from .torques import torques
from .turning import rolling


def mend_units(run: Recording, rig: Any, declared: set[str]) -> None:
    """Find columns in a wrong unit, bring them to SI and say so in `run.faults`.

    Columns or groups in `declared` have their unit from the user: they are named but left alone.
    """
    for check in (rolling, siblings, gap_sizes, accelerations, torques):
        for columns, factor in check(run, rig):
            _mend(run, columns, factor, declared)


def _mend(run: Recording, columns: tuple[str, ...], factor: float, declared: set[str]) -> None:
    first = next(iter(columns))
    group = group_of(first)
    whole = len(columns) > 1
    units = {name: f for name, f in FACTORS[group].items() if 0.4 < factor / f < 2.5}
    size = f"{factor:.3g} times too large" if factor > 1 else f"{1 / factor:.3g} times too small"
    name = group if whole else first
    if {*columns, group} & declared or not units:
        use = (
            "it is used as it stands" if not units else "it is used in the unit that NAME.toml says"
        )
    else:
        unit, exact = min(units.items(), key=lambda item: abs(np.log(factor / item[1])))
        for column in set(columns) & set(run.channels):
            run.channels[column] = run.channels[column] / exact
        use = f'it is read as {unit}; `units.{name} = "{unit_of(group)}"` in NAME.toml keeps it'
    what = f"the {'group' if whole else 'channel'} looks {size} for {unit_of(group)} (wrong unit?)"
    fault = Fault(run.path.name, name, (), "unit", what, use)
    if fault not in run.faults:  # two relations may say the same of a column that is left alone
        run.faults.append(fault)
