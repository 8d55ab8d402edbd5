"""What a sweep is: everything that decides its numbers, as one JSON text."""

import dataclasses
import hashlib
import json
import tomllib
from typing import Any

from ..._errors import InputError
from .._axes import read_axis
from .._differences import differences
from .._points import PointSet, build_points


@dataclasses.dataclass(frozen=True)
class SweepSpec:
    """Rig, drive, points, metrics and numerics of one sweep; equal specs give equal numbers.

    `rig` is the text of the rig file, `laws` names and texts of the law files that it names, `vary`
    pairs of (path, unit, range in SI units), `drive` the drive as plain numbers, `duration` in s
    (none: steady state), `rate` samples per s, `substeps` the fixed steps that pass two samples,
    `method` one of `METHODS`.
    """

    rig: str
    vary: tuple[tuple[str, str, str], ...]
    metrics: tuple[str, ...]
    drive: dict[str, Any]
    method: str
    model: str = "coupled"
    solver: str = ""
    duration: float | None = None
    rate: float | None = None
    rtol: float | None = None
    max_steps: int | None = None
    substeps: int | None = None
    gradient: bool = False
    sampler: str = "grid"
    samples: int | None = None
    seed: int = 0
    batch: int = 1024
    chunk: int = 8192
    laws: tuple[tuple[str, str], ...] = ()

    @property
    def points(self) -> PointSet:
        """The design points."""
        axes = [read_axis(path, text, unit) for path, unit, text in self.vary]
        return build_points(axes, self.sampler, self.samples, self.seed)

    def to_json(self) -> str:
        """The spec as JSON; `from_json` reads it back equal."""
        return json.dumps(dataclasses.asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "SweepSpec":
        """The spec that `to_json` wrote; `InputError` where `text` is no spec of this version."""
        try:
            fields = json.loads(text)
            fields["vary"] = tuple(tuple(axis) for axis in fields["vary"])
            fields["metrics"] = tuple(fields["metrics"])
            fields["laws"] = tuple(map(tuple, fields.get("laws", ())))
            if "path" in fields:  # what version 0.1 called the method
                fields["method"] = fields.pop("path")
            return cls(**fields)
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"the store's sweep specification cannot be read: {error}") from None


def differences_of(stored: SweepSpec, asked: SweepSpec) -> list[str]:
    """Keys in which two specs differ, each as `key: stored -> asked`."""
    return differences(_tree(stored), _tree(asked))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:16]


def _tree(spec: SweepSpec) -> dict[str, Any]:
    fields = dataclasses.asdict(spec)
    fields["vary"] = {path: text for path, _, text in spec.vary}
    fields["order of vary"] = ", ".join(path for path, _, _ in spec.vary)
    fields["metrics"] = ", ".join(spec.metrics)
    fields["rig"] = tomllib.loads(spec.rig)
    fields["laws"] = {name: _digest(text) for name, text in spec.laws}
    return fields
