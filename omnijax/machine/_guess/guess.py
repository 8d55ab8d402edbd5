"""What a stranger's log probably holds: time, input, position, units, rate, noise."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..._errors import InputError, not_above_zero
from ...recording import read_table
from .columns import (
    INPUT,
    POSITION,
    SPEED,
    best_of,
    input_column,
    matches,
    not_found,
    output_columns,
    supplies,
    time_column,
    with_units,
)
from .described import Guess, LogColumns, described
from .load import with_load


def guess(
    log: str | Path,
    rate: float | None = None,
    *,
    time: str | None = None,
    given: str | None = None,
    position: str | None = None,
    velocity: str | None = None,
    units: Mapping[str, str] | None = None,
) -> Guess:
    """Look at a log for the columns that are not named.  `rate` in Hz where it has none of time.

    `units` are those of `t`, `input`, `position` or `velocity` that are known: `360/4096 deg`.
    Raises `InputError` where no column looks like the input or the output, where the one that does
    never changes, for a column that the log lacks or one that is named twice, and for a `rate` not
    above 0.
    """
    if wrong := not_above_zero("Hz", rate=rate):
        raise InputError(wrong)
    log = Path(log)
    table = _with_numbers(read_table(log))
    columns, words = table.columns, with_units(table)
    changing = {k: len(np.unique(x[np.isfinite(x)])) > 1 for k, x in columns.items()}
    time = time or time_column(log, columns, [k for k, moves in changing.items() if moves], rate)
    named = (time, given, position, velocity)
    moving = [k for k, moves in changing.items() if moves and k not in named]
    still = [k for k, moves in changing.items() if not moves and k not in named]
    if given is None:
        driving = [k for k in moving if not supplies(k, columns[k])]
        given = words.column(input_column(words.of(driving)))
        if given is None:
            raise not_found(log, "input", "--input COLUMN", columns, best_of(still, INPUT))
    if not (position or velocity):
        others = words.of([k for k in moving if k != given])
        shown = output_columns([k for k in others if not matches(k, INPUT)] or others)
        position, velocity = map(words.column, shown)
        if not (position or velocity):
            raise not_found(
                log, "position or the speed", "--position COLUMN or --velocity COLUMN",
                columns, best_of(still, f"{POSITION}|{SPEED}"),
            )  # fmt: skip
    one = described(log, table, LogColumns(time, given, position, velocity), rate, units or {})
    if one.drives == "goal":
        return one
    others = [k for k in moving if k not in (given, position, velocity)]
    same = [k for k in others if _may_be_load(words[k], one.measured)]
    return with_load(one, table, same, rate, (position or velocity) not in named)


def _with_numbers(table):
    """The table with its plain columns alone, NaN for what is no finite number."""
    flat = {k: np.asarray(x, float) for k, x in table.columns.items() if np.ndim(x) == 1}
    return table._replace(columns={k: np.where(np.isfinite(x), x, np.nan) for k, x in flat.items()})


def _may_be_load(name: str, measured: str) -> bool:
    """Whether a column may show a load as the motor was measured: no input, a speed or none."""
    speed = bool(best_of([name], SPEED))
    return not best_of([name], INPUT) and speed == (measured == "velocity")
