"""The answer of a design search, in numbers and in sentences."""

import dataclasses
import json
from typing import Any, ClassVar

import numpy as np

from ..._result import AbstractResult
from ..._text import listed, path_words, quantity_text, scaled_together


@dataclasses.dataclass(frozen=True, repr=False)
class Design(AbstractResult):
    """The best design, whether it is optimal, what holds it there, and all the searches.

    `status` is `optimal` (locally, and the best of all starts), `not optimal` or `infeasible`;
    `ends` is one row a search.  `notes` holds figures of the study that asked.  `limits` has by
    constraint what the design reaches and its unit.  `was` compares with the study's own rig, parts
    at their nominal values: `old` and `new` objective, `cases` by name as (old, new), and
    `variables` where the rig has one value of each, and `name` of the objective without draws.
    `size` is that of the objective where the searches began.
    """

    status: str
    reason: str
    variables: dict[str, float]
    objective: float
    objective_name: str
    unit: str
    cases: dict[str, float]
    active: tuple[str, ...]
    multipliers: tuple[str, ...]
    kkt_residual: float
    violation: float
    evaluations: int
    ends: dict[str, list]
    units: dict[str, str]
    prices: dict[str, float]  # objective per unit of each active limit
    whole: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    limits: dict[str, tuple[float, str]] = dataclasses.field(default_factory=dict)
    was: dict[str, Any] = dataclasses.field(default_factory=dict)
    size: float = 0.0

    file_kind: ClassVar[str] = "omnijax design"
    what: ClassVar[str] = "design"

    def table(self):
        """One row a variable."""
        head, *_ = self.sentences()
        rows = [(name, value, self.units[name]) for name, value in self.variables.items()]
        return head, rows, ("variable", "value", "unit")

    @property
    def optimal(self) -> bool:
        """Whether the design meets the conditions of an optimum."""
        return self.status == "optimal"

    @property
    def agreement(self) -> tuple[int, int]:
        """How many searches ended at this objective (within 0.1 %, or 1e-6 of `size`), of how many.

        Only searches with the same whole numbers count.
        """
        values = np.array(self.ends["objective"], float)
        good = np.array([s in {"optimal", "not optimal"} for s in self.ends["status"]])
        near = np.abs(values - self.objective) <= max(1e-3 * abs(self.objective), 1e-6 * self.size)
        at = [list(self.variables).index(name) for name in self.whole]
        x, best = np.array(self.ends["x"])[:, at], np.array(list(self.variables.values()))[at]
        same = np.all(np.abs(x - best) < 1e-6, axis=1)
        return int(np.sum(near & good & same)), int(same.sum())

    @property
    def case_name(self) -> str:
        """What each entry of `cases` is: the objective before it is combined over them."""
        return _of_a_case(self.objective_name, len(self.cases))

    @property
    def nominal_name(self) -> str:
        """What `was` compares: the objective with the parts at their nominal values."""
        return self.was.get("name", self.objective_name)

    @property
    def nominal_case_name(self) -> str:
        """What each entry of `was["cases"]` is."""
        return _of_a_case(self.nominal_name, len(self.was["cases"]))

    @property
    def ranking(self) -> np.ndarray:
        """The searches, best first: those that meet every limit by objective, others by violation.

        A failed one comes last.
        """
        value, over = (np.array(self.ends[k], float) for k in ("objective", "violation"))
        kept = np.isin(self.ends["status"], ("optimal", "not optimal"))
        measure = np.where(kept, value, np.where(np.isfinite(over), over, np.inf))
        return np.lexsort((measure, ~kept))

    def sentences(self) -> list[str]:
        """The answer in words."""
        same, total = self.agreement
        objective = (
            f"{self.objective_name} = {quantity_text(self.objective, self.unit)}: {self.status}"
        )
        whole = " and ".join(f"{n} = {self.variables[n]:g}" for n in self.whole)
        which = f"searches with {whole}" if whole else "searches"
        searched = f"{objective} ({self.reason}); {same} of {total} {which} end there."
        return [self.headline(), *self.active, *self.multipliers, *self.notes, searched]

    def headline(self) -> str:
        """What to build, what it brings, and whether something better may exist."""
        if self.status in {"infeasible", "failed"}:
            return f"Nothing to build: {self.reason}."
        given, old = [], self.was.get("variables", {})
        for name, value in self.variables.items():
            unit = self.units[name]
            now = f" (now {quantity_text(old[name], unit)})" if name in old else ""
            given.append(f"{path_words(name)} {quantity_text(value, unit)}{now}")
        told = f"Build it with {listed(given)}."
        if self.was:
            told += f" {self._gain()}"
        return told if self.optimal else f"{told} A better one may exist: {self.reason}."

    def _gain(self) -> str:
        """The objective against that of the rig as it was."""
        before, after = self.was["old"], self.was["new"]
        factor, unit = scaled_together((abs(before), abs(after)), self.unit)
        ends = f"from {factor * before:.4g} to {factor * after:.4g} {unit}".strip()
        share = f"{abs(100 * (after / before - 1)):.3g} % " if before else ""  # of 0 there is none
        way = "less" if after < before else "more"
        parts = "" if self.nominal_name == self.objective_name else ", parts at nominal values"
        return f"That is {share}{way} {self.nominal_name} than your rig{parts}: {ends}."

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` of all searches, with the best design as attributes."""
        import xarray as xr

        names = list(self.variables)
        rows = ("search", "variable")
        data = {
            "start": (rows, np.array(self.ends["start"])),
            "x": (rows, np.array(self.ends["x"])),
            "objective": ("search", np.array(self.ends["objective"]), {"units": self.unit}),
            "violation": ("search", np.array(self.ends["violation"]), {"units": "1"}),
            "kkt_residual": ("search", np.array(self.ends["kkt_residual"]), {"units": "1"}),
            "evaluations": ("search", np.array(self.ends["evaluations"])),
            "status": ("search", np.array(self.ends["status"])),
            "best": ("variable", np.array(list(self.variables.values()))),
        }
        units = ("variable", [self.units[n] for n in names])
        coords = {"variable": names, "variable_unit": units}
        return xr.Dataset(data, coords, {"design": json.dumps(dataclasses.asdict(self))})

    @classmethod
    def from_xarray(cls, data: Any) -> "Design":
        """The design of which `to_xarray` made `data`."""
        fields = json.loads(data.attrs["design"])
        for key in ("active", "multipliers", "whole", "notes"):
            fields[key] = tuple(fields[key])
        fields["limits"] = {name: tuple(x) for name, x in fields.get("limits", {}).items()}
        return cls(**fields)

    def plot_gain(self, ax: Any = None) -> Any:
        """The rig as it was against the design, in every case."""
        from .plot import gain

        return gain(self, ax)

    def plot_searches(self, ax: Any = None) -> Any:
        """Where every search ended, best first."""
        from .plot import searches

        return searches(self, ax)

    def plot_cases(self, ax: Any = None) -> Any:
        """The objective in every case."""
        from .plot import cases

        return cases(self, ax=ax)


def _of_a_case(objective: str, cases: int) -> str:
    """The objective's name for a single one of that many cases."""
    first, _, rest = objective.partition(" ")
    return rest if cases > 1 and first in {"worst", "mean"} else objective
