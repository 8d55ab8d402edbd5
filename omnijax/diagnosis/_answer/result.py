"""What a diagnosis returns, and the file in which it is written."""

import dataclasses
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..._errors import InputError
from ..._files import write_text
from ..._json import plain
from ..._reading import read_bytes
from ..._result import AbstractShown
from ...laws import AXIS_EFFECTS, AbstractLaw
from .._settings import SETTINGS
from .judges import JUDGES, Judges
from .named_effect import Named, OutputGap, alternatives

REMAINING_RATIO = SETTINGS.answer_result.remaining_ratio


@dataclasses.dataclass(repr=False)
class Diagnosis(AbstractShown):
    """A verdict (none, named, ambiguous, unknown) with everything that speaks for it.

    `effects`, a list, hold sizes and their sigma in SI.  `gap` has an entry for each group of
    outputs (dR in m, theta in rad, Omega in rad/s, a in m/s^2): the RMS of measured less predicted
    before and after the repair, and the noise floor.  `baseline` lists the calibrated parameters,
    `noise` by channel what the data show, `scores` the candidates, `where` what the residual
    depends on.
    """

    verdict: str
    effects: list[Named]
    where: list[dict[str, Any]]
    gap: dict[str, OutputGap]
    next_experiment: dict[str, Any] | None
    baseline: list[dict[str, Any]]
    noise: dict[str, dict[str, Any]]
    scores: list[dict[str, Any]]
    confirmed_on: str = "held-out"
    excluded: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    learned: dict[str, Any] | None = None
    notes: list[str] = dataclasses.field(default_factory=list)
    faults: list[str] = dataclasses.field(default_factory=list)
    free_runs: list[dict[str, Any]] = dataclasses.field(default_factory=list)  # of a machine
    one_step: dict[str, float] = dataclasses.field(default_factory=dict)  # % of the torque missed
    rig: Any = None  # the diagnosed rig or machine
    details: Any = None  # what figures are drawn from; not written

    @property
    def laws(self) -> Mapping[str, type[AbstractLaw]]:
        """Laws by id that effects may be: of one read from its file those of the library alone."""
        return self.details["evidence"].model.laws if self.details else AXIS_EFFECTS

    @property
    def alternatives(self) -> list[list[Named]]:
        """The effects as lists: one of every list is there, and which one the runs do not tell.

        A list of one effect is certain; those come first.
        """
        return alternatives(self.effects)

    @property
    def judges(self) -> Judges:
        """The runs, or parts of one, that the gap is of."""
        return JUDGES[self.confirmed_on]

    @property
    def remainder(self) -> str:
        """What the named effects leave above the noise of what judges them, in words.

        Named effects close most of the gap, not always all of it: something smaller may hide
        beside them that no known effect explains.
        """
        left = {k: g.after / g.noise_floor for k, g in self.gap.items()}
        open_ = [f"{k} {ratio:.2g}" for k, ratio in left.items() if ratio > REMAINING_RATIO]
        if self.verdict not in ("named", "ambiguous") or not open_:
            return ""
        return (
            f"With it {self.judges.name} still differ by more than the noise "
            f"({', '.join(open_)} times): something else is missing too."
        )

    def to_dict(self) -> dict[str, Any]:
        """The diagnosis as plain numbers, lists and text."""
        further = {"free_runs": self.free_runs, "one_step": self.one_step}
        return plain(
            {k: v for k, v in further.items() if v}
            | {
                "verdict": self.verdict,
                "effects": [dataclasses.asdict(e) for e in self.effects],
                "where": self.where,
                "gap": {k: dataclasses.asdict(g) for k, g in self.gap.items()},
                "next_experiment": self.next_experiment,
                "baseline": self.baseline,
                "noise": self.noise,
                "scores": self.scores,
                "confirmed_on": self.confirmed_on,
                "excluded": self.excluded,
                "learned": self.learned,
                "notes": [*self.notes, *filter(None, [self.remainder])],
                "faults": self.faults,
            }
        )

    def save(self, path: str | Path) -> Path:
        """Write `diagnosis.json`."""
        return write_text(path, json.dumps(self.to_dict(), indent=1, ensure_ascii=False) + "\n")

    @classmethod
    def load(cls, path: str | Path) -> "Diagnosis":
        """The diagnosis that `save` wrote, but for the machine itself and what pages are drawn of.

        `rig` and `details` are None; `load_rig` reads the `rig-diagnosed.toml` beside the file.
        Raises `InputError` for a file that holds no diagnosis.
        """
        try:
            written = json.loads(read_bytes(path))
            effects = [Named(**effect) for effect in written["effects"]]
            gap = {k: OutputGap(**_numbers_again(g)) for k, g in written["gap"].items()}
            diagnosis = cls(**(written | {"effects": effects, "gap": gap}))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError("holds no diagnosis.", path) from error
        diagnosis.notes = [note for note in diagnosis.notes if note != diagnosis.remainder]
        return diagnosis

    def plot_gap(self, *, ax: Any = None) -> Any:
        """RMS before and after over the noise, by output group; returns the axes."""
        from .pictures import plot_gap

        return plot_gap(self.verdict, self.gap, self.judges.name, ax=ax)

    def plot_scores(self, *, step: int = 1, ax: Any = None) -> Any:
        """What the best candidates of a step would explain; returns the axes."""
        from .pictures import plot_scores

        return plot_scores(self.scores, step=step, ax=ax)

    def plot_where(self, *, ax: Any = None) -> Any:
        """Where the gap is, by share of the residual's power; returns the axes."""
        from .pictures import plot_where

        return plot_where(self.where, ax=ax)

    def to_xarray(self) -> Any:
        """Gap, calibrated parameters and scores as an `xarray.Dataset`."""
        from .pictures import dataset

        return dataset(self.verdict, self.effects, self.gap, self.baseline, self.scores)

    def tables(self):
        """The answer with the sizes of its effects, and the gap before and after."""
        from .pictures import tables

        return tables(self.verdict, self.effects, self.gap, self.judges.name)

    def sentences(self) -> list[str]:
        """The verdict with its effects, and the gap of each output over its noise."""
        answer = self.verdict
        if self.effects:
            each = [" or ".join(f"{e.id}@{e.place}" for e in some) for some in self.alternatives]
            answer += ": " + " and ".join(each)
        gaps = ", ".join(
            f"{k} {g.before / g.noise_floor:.3g} -> {g.after / g.noise_floor:.3g}"
            for k, g in self.gap.items()
        )
        return [f"Diagnosis({answer}; gap over noise {gaps})"]


def _numbers_again(gap: dict[str, Any]) -> dict[str, Any]:
    """Numbers that were not finite are written as null."""
    return {k: math.nan if v is None else v for k, v in gap.items()}
