"""A checked study: what to vary, what to judge by, under which drives and loads."""

import dataclasses
from typing import Any

from ...rig import Rig, rig_identity
from ...simulation import SpeedDrive, TorqueDrive, speeds, torques
from .._constraints import Constraint
from .._differences import plain
from .._problem import Variable


@dataclasses.dataclass(frozen=True)
class Load:
    """Parameters with values of their own in one case: a light or a heavy pilot."""

    name: str
    values: tuple[tuple[str, float], ...] = ()


@dataclasses.dataclass(frozen=True)
class LoadCase:
    """A named drive: constant wheel speeds (rad/s) or motor torques (N m), and a force (N)."""

    name: str
    kind: str  # speed or torque
    values: tuple[float, ...]
    force: tuple[float, ...] = (0.0, 0.0, 0.0)

    @property
    def drive(self) -> SpeedDrive | TorqueDrive:
        """As a drive of a run."""
        make = speeds if self.kind == "speed" else torques
        return make(self.values, self.force)


@dataclasses.dataclass(frozen=True)
class Study:
    """A checked study: v variables of one rig, judged by metrics under every drive and load.

    `drives` have (n,) wheel speeds in rad/s or torques in N m and a force (3,) in N; `variables`
    (v) have bounds in their parameter's SI unit, `distributions` and `levels` one entry each.
    `tolerances` are pairs of path and relative half width; `duration` in s, `rate` in samples/s.
    Metrics are in SI.
    """

    rig: Rig
    drives: tuple[LoadCase, ...]  # all of one kind
    loads: tuple[Load, ...]
    variables: tuple[Variable, ...] = ()
    distributions: tuple[str, ...] = ()
    levels: tuple[int, ...] = ()  # of each variable, in a sweep
    weights: tuple[tuple[str, float], ...] = (("rms", 1.0),)
    over: str = "worst"
    spread: str = "worst"
    sigmas: float = 3.0
    constraints: tuple[Constraint, ...] = ()
    tolerances: tuple[tuple[str, float], ...] = ()  # path, relative half width
    draws: int = 16
    model: str = "coupled"
    duration: float | None = None
    rate: float | None = None
    rtol: float | None = None  # of runs by the adaptive solver; asks for that solver
    starts: int = 8
    seed: int = 0
    batch: int = 8
    stochastic: int = 0
    pareto: tuple[str, ...] = ()
    points: int = 12
    limit: tuple[str, float | None, float | None] | None = None  # metric, max, or rise over nominal
    confidence: float = 0.99
    samples: int = 256

    def identity(self, question: str, **more: Any) -> dict[str, Any]:
        """Everything that decides the numbers of a command, as tables."""
        settings = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        return plain({"question": question, **more, **settings, "rig": rig_identity(self.rig)})
