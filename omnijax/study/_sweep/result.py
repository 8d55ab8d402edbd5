"""What a sweep returns: metrics, gradients and status of every design, read when asked for."""

import shlex
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import InputError, did_you_mean, tell
from ..._result import AbstractShown
from ..._status import FAILED, Status
from ..._text import scaled
from .._evaluation import METHODS
from .._points import Grid
from .spec import SweepSpec
from .store import Store, create_store, open_store

BLOCK = 262_144  # designs read at a time


class SweepResult(AbstractShown):
    """The designs of a sweep; values stay in the store until asked for.

    `result["peak"]` has the grid's shape (or one entry a design for samples), as `to_xarray()` with
    units and coordinates.  `load_sweep(folder)` opens a stored one.
    """

    def __init__(self, store: Store):
        self.store = store
        self.points = store.spec.points

    @property
    def spec(self) -> SweepSpec:
        """What was asked for."""
        return self.store.spec

    @property
    def size(self) -> int:
        """Number of designs."""
        return self.store.size

    @property
    def method(self) -> str:
        """How the designs were evaluated, and why so."""
        about = self.store.group.attrs
        why = about["method_reason"] if "method_reason" in about else about["path_reason"]
        after = f"; {about['checked_after']}" if "checked_after" in about else ""
        return f"{METHODS[self.spec.method]}: {why}{after}"

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid; (designs,) for samples."""
        return self.points.shape if isinstance(self.points, Grid) else (self.size,)

    def __getitem__(self, name: str) -> np.ndarray:
        return self.store.read(self._known(name)).reshape(self.shape)

    def unit(self, name: str) -> str:
        """Unit of a stored quantity."""
        return self.store.unit(self._known(name))

    def readable(self, name: str) -> tuple[float, str]:
        """Factor and unit in which a stored quantity's figures read well."""
        if self.unit(name) == "rad/s":  # as pages offer it beside rpm and Hz
            return 1.0, "rad/s"
        values = np.abs(self.store.read(self._known(name)))
        if name in self.spec.metrics:
            size = np.max(values, where=np.isfinite(values), initial=0.0)
        else:
            size = np.median(values)
        return scaled(float(size), self.unit(name))

    def _known(self, name: str) -> str:
        if name not in self.store.names:
            hint = did_you_mean(name, self.store.names)
            raise InputError(f"the sweep holds no `{name}`.{hint}")
        return name

    def counts(self) -> dict[str, int]:
        """Number of designs by status."""
        total = np.zeros(len(Status), int)
        for start in range(0, self.size, BLOCK):
            status = self.store.read("status", start, min(start + BLOCK, self.size)).astype(int)
            total += np.bincount(status + 1, minlength=len(Status))
        return {Status(k - 1).text: int(n) for k, n in enumerate(total) if n}

    def failed(self, limit: int | None = None) -> list[int]:
        """Designs that ended without figures, the first `limit`."""
        designs: list[int] = []
        for start in range(0, self.size, BLOCK):
            status = self.store.read("status", start, min(start + BLOCK, self.size))
            designs += (start + np.flatnonzero(np.isin(status, FAILED))).tolist()
            if limit is not None and len(designs) >= limit:
                return designs[:limit]
        return designs

    def design(self, index: int) -> dict[str, float]:
        """Every stored quantity of one design."""
        if not 0 <= index < self.size:
            raise InputError(f"`design` must lie in [0, {self.size - 1}], but is {index}.")
        return {name: self.store.read(name, index, index + 1).item() for name in self.store.names}

    def status(self, index: int) -> str:
        """How one design ended: ok, slip, lift-off, ..."""
        return Status(int(self.design(index)["status"])).text

    def best(self, metric: str) -> int | None:
        """The design with the smallest (margins: largest) `metric`; None where none has one.

        A design that slips or lifts off is the best only where every design with a figure does.
        """
        from ...vibration import METRICS

        self._known(metric)
        sign = 1.0 if metric not in METRICS or METRICS[metric].smaller_is_better else -1.0
        where, least = None, (True, np.inf)
        for start in range(0, self.size, BLOCK):
            stop = min(start + BLOCK, self.size)
            values = sign * self.store.read(metric, start, stop)
            doubt = self.store.read("status", start, stop) != Status.OK
            finite = np.isfinite(values)
            for bad in (False, True):
                own = np.where(finite & (doubt == bad), values, np.inf)
                if np.isfinite(own).any() and (bad, float(own.min())) < least:
                    where, least = start + int(own.argmin()), (bad, float(own.min()))
        return where

    def held(self) -> np.ndarray:
        """Which designs neither slip nor lift off, in the grid's shape (or one entry a design)."""
        return ~np.isin(self["status"].astype(int), (Status.SLIP, Status.LIFT_OFF))

    def edges(self, index: int) -> list[tuple[str, str]]:
        """(path, "lowest" or "highest") where a design lies at an end of a grid's axis."""
        if not isinstance(self.points, Grid):
            return []
        at = np.unravel_index(index, self.shape)
        return [
            (axis.path, "lowest" if axis.level(k) == axis.levels().min() else "highest")
            for axis, k in zip(self.points.axes, at, strict=True)
            if (axis.count or 0) > 2 and axis.level(k) in (axis.levels().min(), axis.levels().max())
        ]  # fmt: skip

    def left_out(self, metric: str) -> int:
        """Number of designs whose `metric` betters that of `best`, but which slip or lift off."""
        from ...vibration import METRICS

        best = self.best(metric)
        if best is None:
            return 0
        sign = 1.0 if metric not in METRICS or METRICS[metric].smaller_is_better else -1.0
        level = sign * self.design(best)[metric]
        ends = ((i, min(i + BLOCK, self.size)) for i in range(0, self.size, BLOCK))
        return sum(int(np.sum(sign * self.store.read(metric, a, b) < level)) for a, b in ends)

    def command(self, index: int) -> str:
        """The command that evaluates one design again, from the store alone."""
        folder = "sweep.zarr" if self.store.folder is None else str(self.store.folder)
        return f"omnijax sweep-status {shlex.quote(folder)} --rerun {index}"

    def to_xarray(self) -> Any:
        """An `xarray.Dataset`: grids with one dimension a parameter, samples along `design`."""
        from .export import dataset

        return dataset(self)

    def plot_heatmap(self, metric: str, x: str | None = None, y: str | None = None, *, ax=None):
        """`metric` over two parameters of a grid; the others at their first level."""
        from .plot import heatmap

        return heatmap(self, metric, x, y, ax=ax)

    def plot_lines(self, metric: str, x: str | None = None, hue: str | None = None, *, ax=None):
        """`metric` over one parameter, one line a level of another; points for samples."""
        from .plot import lines

        return lines(self, metric, x, hue, ax=ax)

    def export(self, file: str | Path) -> Path:
        """Write a `.nc`, `.csv` or `.parquet` file."""
        from .export import export

        return export(self, file)

    @staticmethod
    def load(folder: str | Path) -> "SweepResult":
        """The sweep stored in `folder`, as `load_sweep` opens it."""
        return load_sweep(folder)

    def save(self, folder: str | Path) -> "SweepResult":
        """Copy to a store of its own."""
        from .evaluator import quantities

        attrs = dict(self.store.group.attrs)
        about = {
            k: v
            for k, v in attrs.items()
            if k not in {"schema", "spec", "order", "files", "sha256"}
        }
        target = Path(folder)
        if target.exists():
            raise InputError("exists already.", target)
        store = create_store(target, self.spec, quantities(self.spec), about)
        for chunk in np.flatnonzero(self.store.done()).tolist():
            start, stop = self.store.bounds(chunk)
            store.write(chunk, {n: self.store.read(n, start, stop) for n in self.store.names})
        return SweepResult(store)

    def tables(self):
        """The method, and how many designs ended how; the least of each metric."""
        rows = [("method", self.method), ("designs", self.size)]
        rows += [(f"status {name}", count) for name, count in self.counts().items()]
        for metric in self.spec.metrics:
            best = self.best(metric)
            least = "none" if best is None else f"{self[metric].ravel()[best]:.4g} (design {best})"
            rows.append((f"least {metric}, {self.unit(metric)}", least))
        return [("Sweep", rows, ())]

    def sentences(self) -> list[str]:
        """What was varied, the metrics, the method, and how many designs ended how."""
        counts = ", ".join(f"{n} {name}" for name, n in self.counts().items())
        varied = ", ".join(path for path, _, _ in self.spec.vary)
        return [
            f"SweepResult({self.size} designs over {varied}; {', '.join(self.spec.metrics)}; "
            f"{self.spec.method}; {counts})"
        ]


def load_sweep(folder: str | Path) -> SweepResult:
    """The sweep stored in `folder`, finished or not.

    Figures are SI.  Raises `InputError` where `folder` is no store of a sweep.
    """
    result = SweepResult(open_store(folder, mode="r"))
    tell(result.store.damage())
    return result
