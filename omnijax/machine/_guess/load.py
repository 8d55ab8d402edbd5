"""The load behind an elastic drive: another column of the log that moves as it would."""

import dataclasses
from collections.abc import Sequence

from ..._errors import InputError
from ...recording import read_table
from .._second_numbers import coupled
from .columns import unit_in
from .described import Guess, LogColumns, described


def with_load(one: Guess, table, others: Sequence[str], rate, free: bool) -> Guess:
    """The guess with the column of a load, where the relative motion is that of an elastic drive.

    What was taken for the motor may be the load where it is `free`, not named by the user.
    """
    best, told = one, 0.0
    for name in others:
        try:
            other = _of_column(one, table, name, one.measured, rate)
        except InputError:
            continue
        if other.motion != one.motion or other.samples != one.samples:
            continue
        for motor, load in ((one, other), (other, one))[: 1 + free]:
            both = _loaded(motor, load)
            known = coupled([both.signals], one.turns())
            if known is not None and known.told > told:
                best, told = both, known.told
    return best


def _loaded(motor: Guess, load: Guess) -> Guess:
    """The guess of a motor, with the column of another guess as its load's."""
    signals = dataclasses.replace(motor.signals, second=load.signals.position)
    return dataclasses.replace(motor, signals=signals, second=load.position or load.velocity)


def of_one_machine(guesses: Sequence[Guess]) -> list[Guess]:
    """The guesses of one machine's logs, with one answer to whether it has a load behind a drive.

    A log in which the drive is hardly bent does not show one: all logs together tell.
    """
    told = next((one for one in guesses if one.second), None)
    if told is None or all(one.second for one in guesses):
        return list(guesses)
    columns = [k for k in (told.position, told.velocity, told.second) if k]
    tables = [read_table(one.log) for one in guesses]
    if all(k in table.columns for table in tables for k in columns):
        pairs = [
            [_of_column(one, table, k, told.measured, None if one.time else one.rate)
             for k in columns]
            for one, table in zip(guesses, tables, strict=True)
        ]  # fmt: skip
        if all(motor.samples == load.samples for motor, load in pairs):
            loaded = [_loaded(motor, load) for motor, load in pairs]
            if coupled([one.signals for one in loaded], told.turns()):
                return loaded
    return [_alone(one) for one in guesses]


def _of_column(one: Guess, table, column: str, measured: str, rate: float | None) -> Guess:
    """The guess of the same log with another column as what was measured."""
    shown = (column, None) if measured == "position" else (None, column)
    known = one.stated if unit_in(column) is None else {
        k: x for k, x in one.stated.items() if k != measured
    }  # fmt: skip
    return described(one.log, table, LogColumns(one.time, one.input, *shown), rate, known)


def _alone(one: Guess) -> Guess:
    """The guess without a load."""
    signals = dataclasses.replace(one.signals, second=None)
    return dataclasses.replace(one, second=None, signals=signals)
