"""The files of a case that was guessed from a stranger's logs."""

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from .._toml import toml_value
from ..recording import stem_of
from ._file import field_names
from ._first_numbers import driven_numbers, servo_numbers
from ._guess import Guess
from ._second_numbers import coupled

SERVO_UNSURE = ("damping", "gravity", "back_emf")  # by their own size


def numbers_of_logs(guesses: Sequence[Guess]) -> dict[str, float]:
    """Fields of `Axis` to begin with, from all logs of one machine; `gain` and more of a servo."""
    logs = [one.signals for one in guesses]
    if guesses[0].drives == "goal":
        return servo_numbers(logs)
    known = coupled(logs, guesses[0].turns())
    if known is not None:
        return known.numbers
    return driven_numbers(logs, guesses[0].turns())


def case_files(guesses: Sequence[Guess], held_out: Collection[Path] = ()) -> dict[str, str]:
    """machine.toml and a NAME.toml for each log of one machine, by file name.

    No log tells the torque constant, so it is left out and the numbers are in units of it.  The
    machine's numbers come from the other logs; those `held_out` only judge.
    """
    learned = [one for one in guesses if one.log not in held_out]
    files = {"machine.toml": _machine_file(learned)}
    for one in guesses:
        role = "held-out" if one.log in held_out else "train"
        files[f"{stem_of(one.log)}.toml"] = _log_file(one, role)
    return files


def _machine_file(guesses: Sequence[Guess]) -> str:
    first, numbers, names = guesses[0], numbers_of_logs(guesses), field_names()
    goal = first.drives == "goal"
    unsure: dict[str, float] = {}
    if goal:  # for an inertia of 1, what the data can tell
        numbers = {"resistance": 1.0, "back_emf": 0.0, "supply": 1.0, "limit": 1e9} | numbers
        unsure = dict.fromkeys(SERVO_UNSURE, 1.0) | {"gain": 0.5, "limit": 0.5}
        unsure = {k: x for k, x in unsure.items() if 0 < numbers.get(k, 0.0) < 1e9}
        unsure |= {"gravity_angle": 0.1} if "gravity" in numbers else {}
        numbers |= {"gravity_angle": 0.0} if "gravity" in numbers else {}
    else:
        unsure = dict.fromkeys(numbers, 1.0) | {"offset": _offset(guesses)}
    tables: dict[str, list[str]] = {"axis": [], "motor": [f'input = "{first.drives}"']}
    for field, value in numbers.items():
        table, _, key = names[field].partition(".")
        tables.setdefault(table, []).append(f"{key} = {value:.6g}")
    lines = ["#:schema ./machine.schema.json", 'kind = "axis"', f'motion = "{first.motion}"']
    for table, rows in tables.items():
        lines += ["", f"[{table}]", *rows]
    if goal:
        lines += ["", "[compare]", 'hold = "held"  # a controller takes a goal at every sample']
    lines += ["", "[uncertainty]  # 1-sigma: relative, or absolute for a number that is 0"]
    lines += [f'"{names[k]}" = {x:.3g}' for k, x in unsure.items()]
    return "\n".join(lines) + "\n"


def _log_file(guess: Guess, role: str) -> str:
    side = [
        f"log = {toml_value(guess.log.resolve())}",
        'machine = "machine.toml"',
        f'role = "{role}"',
    ]
    side += [] if guess.time else [f'rate = "{guess.rate!r} Hz"']
    side += ["", "[channels]"] + ([f"t = {toml_value(guess.time)}"] if guess.time else [])
    shown = guess.position or guess.velocity
    side += [f"input = {toml_value(guess.input)}", f"{guess.measured} = {toml_value(shown)}"]
    side += [f"{k} = {toml_value(c)}" for k, c in guess.beside.items()]
    if guess.units:
        side += ["", "[units]", *(f"{k} = {toml_value(v)}" for k, v in guess.units.items())]
    return "\n".join(side) + "\n"


def _offset(guesses: Sequence[Guess]) -> float:
    """1-sigma of the torque that the model leaves out, in the input's unit."""
    return 0.3 * float(np.std(np.concatenate([one.signals.input for one in guesses])))
