"""How a machine's input is read between its samples: held, or linear."""

import dataclasses
import itertools
from collections.abc import Callable, Sequence

from ...machine import Axis, LogSignals, MachineCase, input_hold
from .._search import Effect, Fit, total_cost
from ._noise import in_colour, settled
from ._rows import Programs
from .build import build_model
from .model import OdeModel

LATE = frozenset({"actuator-delay", "actuator-lag", "sensor-delay", "sensor-lag"})
# half a sample of delay looks like a held input that is read as linear
TIMES = {"actuator-delay": "delay", "actuator-lag": "tau"}
READ = ("linear", "held")


@dataclasses.dataclass(frozen=True)
class HoldReading:
    """A case whose file says how its input is held, why so, and whether that may be wrong."""

    case: MachineCase
    said: str = ""
    open: bool = False

    @property
    def hold(self) -> str:
        """`linear`, `held` or `band-limited`."""
        return self.case.file.compare.hold

    def otherwise(self) -> "HoldReading":
        """The case with the other reading."""
        (hold,) = (h for h in READ if h != self.hold)
        said = f"The input is read as {hold} between its samples: so it fits better."
        return HoldReading(_read_as(self.case, hold), said)


def first_reading(case: MachineCase) -> HoldReading:
    """As the file states it; else as the logs of an axis of one inertia show it, else linear."""
    machine = case.file.machine
    if case.file.compare.hold != "auto":
        return HoldReading(case)
    if isinstance(machine, Axis) and machine.drives == "goal":
        return HoldReading(_read_as(case, "held"),
                       "A servo's controller takes a goal at every sample.")  # fmt: skip
    if not isinstance(machine, Axis) or machine.second_inertia is not None:
        return HoldReading(_read_as(case, "linear"), open=True)
    logs = [
        LogSignals(log.outputs["position"], log.inputs["input"], log.step, {},
                   log.shown if log.measured == "velocity" else None)
        for log in case.logs if log.role == "train"
    ]  # fmt: skip
    told = input_hold(logs, machine.motion == "rotation")
    return HoldReading(_read_as(case, told.hold), f"The input is read as {told.sentence}.",
                   not told.sure)  # fmt: skip


def better_reading(
    reading: HoldReading,
    laws: dict,
    model: OdeModel,
    fit: Fit,
    tell: Callable[[str], None],
    programs: Programs | None = None,
) -> HoldReading | None:
    """The other reading where it explains the train runs better than a fit, or None.

    Also where it does as well without a delay or lag that this reading needs, as a held input acts
    half a sample late.  A delay of this reading is tried as a lag with the other, and the reverse.
    `programs` are those of the models of this case (`build_model`).
    """
    if not reading.open:
        return None
    other = reading.otherwise()
    tell(f"reading the input as {other.hold} between its samples")
    twin, _, _ = build_model(other.case, laws, programs)
    twin.row_noise = model.row_noise
    margin, effects = model.settings.margin, fit.point.effects
    for some in _otherwise(effects, set(model.laws)):
        point = fit.point.with_effects(*some)
        twin.rebase(point)
        there = settled(twin, point)
        needed = -margin if len(some) == len(effects) else margin
        if _above(model, fit, twin, there) < needed:
            return other
    return None


def _otherwise(effects: Sequence[Effect], known: set[str]) -> list[list[Effect]]:
    """Sets of effects to try with the other reading, those with fewer delays and lags first."""
    late = [e for e in effects if e.id in LATE]
    sets = [[e for e in effects if e.id not in LATE]] if len(late) > 1 else []
    sets += [[e for e in effects if e is not one] for one in late]
    sets.append(list(effects))
    others = sorted(set(TIMES) & known - {e.id for e in effects})
    for one, id in itertools.product((e for e in late if e.id in TIMES), others):
        twin = Effect(id, one.place, {TIMES[id]: one.values[TIMES[one.id]]})
        sets.append([twin if e is one else e for e in effects])
    return sets


def _above(model: OdeModel, fit: Fit, twin: OdeModel, there: Fit) -> float:
    """Cost of the other reading less this one's, log N a number; coloured noise for a balance."""
    more = total_cost(there) - total_cost(fit)
    if model.steps_in_time:
        return more
    likely, _ = in_colour(twin, there).above(in_colour(model, fit))
    return likely + more - (there.cost - fit.cost)


def _read_as(case: MachineCase, hold: str) -> MachineCase:
    """The case with its hold stated."""
    compare = case.file.compare.model_copy(update={"hold": hold})
    return dataclasses.replace(case, file=dataclasses.replace(case.file, compare=compare))
