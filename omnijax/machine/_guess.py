"""What a stranger's log probably holds: time, input, position, units, rate, noise."""

import dataclasses
import math
import re
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from .._errors import InputError
from ..recording import read_table, stem_of
from ..rig import Quantity
from ._axis import INPUTS
from ._file import field_names
from ._first_numbers import LogSignals, driven_numbers, servo_numbers
from ._hold import input_hold
from ._log import LEAST

TIME = r"^(t|time|timestamp|zeit|stamp|seconds|sec|ms)\b|time"
INPUT = (
    r"^(u|vir|v1|in|input)$|^tau|cmd|torque|force|volt|curr|command|goal|ref|setpoint|moment"
    r"|duty|pwm"
)
POSITION = r"^(y|q|qm|x|v2|out)$|pos|angle|theta|encoder|deg|winkel|weg|displ"
MEASURED = r"meas|act|enc|fb"
KINDS = (  # pattern of a name -> how the motor is driven
    (r"goal|ref|setpoint", "goal"), (r"torque|force|moment", "torque"), (r"curr", "current"),
)  # fmt: skip
UNIT = re.compile(r"[\[(_ ]\s*(mm|cm|um|m|deg|rad|mrad|ms|us|s|N ?m|mNm|N|A|mA|V|mV)\s*[\])]?$")
SERVO_UNSURE = ("damping", "gravity", "back_emf")  # by their own size
SUPPLY = 0.2  # standard deviation of a voltage over its mean, below which it is a supply's
ANGLES, LENGTHS = ("rad", "deg", "mrad"), ("m", "mm", "cm", "um")


@dataclasses.dataclass(frozen=True)
class Guess:
    """A log's channels with units, the sampling, the noise, and a machine to begin with."""

    log: Path
    time: str | None
    input: str
    position: str
    units: dict[str, str]
    drives: str
    motion: str
    samples: int
    rate: float
    noise: float
    signals: LogSignals
    beside: dict[str, str] = dataclasses.field(default_factory=dict)  # further inputs: column

    def held(self) -> str:
        """How the input is read between its samples, in words."""
        told = input_hold([self.signals], self.motion == "rotation")
        return told.sentence if told.sure else "held or linear: the diagnosis looks"

    def rows(self) -> list[tuple[str, str]]:
        """The guess as pairs to be shown."""
        unit = "m" if self.motion == "translation" else "rad"
        return [
            ("time", self.time or "none: from the rate"),
            ("input", f"{self.input} ({self.drives}, {self.units.get('input', 'as it is')})"),
            *([("input is read as", self.held())] if self.drives != "goal" else []),
            ("position", f"{self.position} ({self.units.get('position', unit)})"),
            *self.beside.items(),
            ("motion", self.motion), ("samples", f"{self.samples} at {self.rate:.6g} Hz"),
            ("noise of position", f"{self.noise:.3g} {unit} (1 sigma)"),
        ]  # fmt: skip


def guess(log: Path, rate: float | None = None) -> Guess:
    """Look at a log.  `rate` in Hz where it has no column of time.

    Raises `InputError` where no column looks like the input or the position, or where the one that
    does never changes; else as `describe`.
    """
    table = read_table(log)
    columns = {k: np.asarray(x, float) for k, x in table.columns.items() if np.ndim(x) == 1}
    moving = [k for k, x in columns.items() if np.ptp(x[np.isfinite(x)]) > 0]
    time = _time(columns, moving, rate)
    rest = [k for k in moving if k != time]
    names = {"input": _best([k for k in rest if not _supplies(k, columns[k])], INPUT)}
    others = [k for k in rest if k != names["input"]]
    names["position"] = _best(others, POSITION, MEASURED)
    patterns = {"input": INPUT, "position": POSITION}
    for word, column in names.items():
        still = _best([k for k in columns if k not in moving], patterns[word])
        if column is None and still is not None:
            raise InputError(f"{log.name}: the column {still!r} looks like the {word}, but it "
                             "never changes: all at rest.")  # fmt: skip
        if column is None:
            raise InputError(
                f"{log.name}: no column looks like the {word}; columns: {', '.join(columns)}. "
                f"Name it: --{word} COLUMN."
            )
    return describe(log, time, str(names["input"]), str(names["position"]), rate)


def describe(log: Path, time: str | None, given: str, position: str, rate: float | None) -> Guess:
    """The guess with its channels known; `rate` in Hz where no column is the time.

    Raises `InputError` for a column that the log lacks, or one that is named twice.
    """
    table = _table_of(log, time, given, position)
    units = {
        ours: u for ours, theirs in (("t", time), ("input", given), ("position", position))
        if theirs and (u := table.units.get(theirs) or _unit(theirs))
    }  # fmt: skip
    motion = "translation" if units.get("position") in LENGTHS else "rotation"
    drives = next((d for p, d in KINDS if re.search(p, given.lower())), "command")
    units = _fitting(units, motion, drives)
    q = np.asarray(table.columns[position], float)
    step = 1 / float(rate or 1.0) if time is None else _step_of(table.columns[time], units)
    q = _in_si(q, units.get("position"), "m" if motion == "translation" else "rad")
    u = _in_si(table.columns[given], units.get("input"), _input_unit(motion, drives))
    beside = _beside(table.columns) if drives == "goal" else {}
    others = {k: np.asarray(table.columns[c], float) for k, c in beside.items()}
    good = np.all([np.isfinite(x) for x in (q, u, *others.values())], axis=0)
    q, u, others = q[good], u[good], {k: x[good] for k, x in others.items()}
    if len(q) < LEAST:
        raise InputError(f"{log.name} has {len(q)} usable rows, but at least {LEAST} are needed.")
    for word, values in (("input", u), ("position", q)):
        if np.ptp(values) == 0:
            raise InputError(f"{log.name}: the {word} never changes: all at rest.")
    return Guess(log, time, given, position, units, drives, motion, len(q), 1 / step, _noise(q),
                 LogSignals(q, u, step, others), beside)  # fmt: skip


def _table_of(log: Path, time: str | None, given: str, position: str):
    """The log's table; `InputError` for a column that it lacks, or one that is named twice."""
    table = read_table(log)
    for name in filter(None, (time, given, position)):
        if name not in table.columns:
            raise InputError(f"{log.name} has no column {name!r}; columns: "
                             f"{', '.join(table.columns)}.")  # fmt: skip
    if len({time, given, position}) < 3:
        raise InputError(
            f"{log.name}: time, input and position must be three columns, but are {time!r}, "
            f"{given!r} and {position!r}."
        )
    return table


def _step_of(column, units: dict[str, str]) -> float:
    """Median step of a column of times, s; milliseconds where they are not said but likely."""
    t = np.asarray(column, float)
    t = t * (Quantity("s").read(f"1 {units['t']}") if "t" in units else 1.0)
    step = float(np.median(np.diff(t)))
    if step > 0.2 and "t" not in units:
        step, units["t"] = step / 1000, "ms"
    return step


def _noise(q: np.ndarray) -> float:
    """1-sigma of white noise on a smooth signal: of its third to seventh differences the least."""
    return min(float(np.sqrt(np.mean(np.diff(q, k) ** 2) / math.comb(2 * k, k))) for k in (3, 5, 7))


def _beside(columns) -> dict[str, str]:
    """Columns of a servo's gain and of whether it is on, where they are there."""
    patterns = {"gain": r"^(k_?p|p_?gain|gain)$", "enable": r"enable|torque_on|^on$"}
    columns_of = {k: _best(list(columns), p) for k, p in patterns.items()}
    return {k: c for k, c in columns_of.items() if c is not None}


def numbers_of_logs(guesses: Sequence[Guess]) -> dict[str, float]:
    """Fields of `Axis` to begin with, from all logs of one machine; `gain` and more of a servo."""
    logs = [one.signals for one in guesses]
    if guesses[0].drives == "goal":
        return servo_numbers(logs)
    return driven_numbers(logs, guesses[0].motion == "rotation")


def case_files(guesses: Sequence[Guess], held_out: Collection[Path] = ()) -> dict[str, str]:
    """machine.toml and a NAME.toml for each log of one machine, by file name.

    The logs `held_out` judge: the machine's numbers are not from them.
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
    if first.drives in ("current", "goal"):  # in units of it: the log does not tell it
        numbers["torque_constant"] = 1.0
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
    side = [f'log = "{guess.log.resolve()}"', 'machine = "machine.toml"', f'role = "{role}"']
    side += [] if guess.time else [f'rate = "{guess.rate!r} Hz"']
    side += ["", "[channels]"] + ([f't = "{guess.time}"'] if guess.time else [])
    side += [f'input = "{guess.input}"', f'position = "{guess.position}"']
    side += [f'{k} = "{c}"' for k, c in guess.beside.items()]
    if guess.units:
        side += ["", "[units]", *(f'{k} = "{v}"' for k, v in guess.units.items())]
    return "\n".join(side) + "\n"


def _offset(guesses: Sequence[Guess]) -> float:
    """1-sigma of the torque that the model leaves out, in the input's unit."""
    return 0.3 * float(np.std(np.concatenate([one.signals.input for one in guesses])))


def _time(columns, moving, rate) -> str | None:
    rising = [k for k in moving if np.all(np.diff(columns[k]) > 0)]
    named = [k for k in rising if re.search(TIME, k.lower())]
    if named or (rising and rate is None):
        return (named or rising)[0]
    if rate is None:
        raise InputError("no column of the log looks like time; give its sampling rate: --rate HZ.")
    return None


def _best(names: list[str], pattern: str, better: str = "$^") -> str | None:
    bare = {k: UNIT.sub("", k).strip().lower() for k in names}  # `x_mm` is as good as `x`
    matches = [k for k in names if re.search(pattern, k.lower()) or re.search(pattern, bare[k])]
    return next((k for k in matches if re.search(better, k.lower())), next(iter(matches), None))


def _supplies(name: str, x: np.ndarray) -> bool:
    """Whether a column is a supply's: a voltage that hardly changes drives nothing."""
    steady = np.nanstd(x) < SUPPLY * abs(np.nanmean(x))
    return bool("volt" in name.lower() and steady)


def _unit(name: str) -> str | None:
    match = UNIT.search(name)
    return match[1] if match else None


def _in_si(values, unit: str | None, si: str) -> np.ndarray:
    """A channel (t,) in SI, as a log of these units is read."""
    values = np.asarray(values, float)
    return values if unit in (None, si) else values * Quantity(si).read(f"1 {unit}")


def _input_unit(motion: str, drives: str) -> str:
    """SI unit of a guessed input."""
    return INPUTS[drives][motion == "translation"]


def _fitting(units: dict[str, str], motion: str, drives: str) -> dict[str, str]:
    """Only units of the quantity that a channel has."""
    wanted = {"t": "s", "position": "m" if motion == "translation" else "rad"}
    wanted["input"] = _input_unit(motion, drives)
    out = {}
    for k, u in units.items():
        try:
            Quantity(wanted[k]).read(f"1 {u}")
        except ValueError:
            continue
        out[k] = u
    return out
