"""A learned term on a machine's shaft: what a smooth function of its state would have to do."""

import dataclasses
from typing import Any

import numpy as np

from ..._answer import NearLaw, near_laws
from ..._settings import SETTINGS
from .._rows import smoothed
from ..model import OdeModel

KNOTS = SETTINGS.free_learned.knots
RIDGE = SETTINGS.free_learned.ridge


@dataclasses.dataclass(frozen=True)
class ShaftTerm:
    """sum_k w_k hat_k of speed, position and input: acceleration that the model misses."""

    knots: dict[str, np.ndarray]
    weights: np.ndarray

    def columns(self, signals: dict[str, np.ndarray]) -> np.ndarray:
        """Basis (rows, k) at some signals."""
        return np.concatenate([hats(signals[k], x) for k, x in self.knots.items()], axis=1)


@dataclasses.dataclass(frozen=True)
class LearnedShaft:
    """A learned term of a machine: how much of the held-out gap it closes, and its curves.

    `curves` are by input: values, the term in the unit of an acceleration, and 1-sigma of it.
    """

    term: ShaftTerm
    closed: float
    residual: np.ndarray
    curves: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]
    nearest: list[NearLaw]
    port: str = "shaft"
    smooth: float = 0.0
    network: float | None = None
    axes: tuple[tuple[str, str], tuple[str, str]] = (("input", "SI"), ("acceleration", "SI"))
    kind: str = "sum of piecewise-linear functions of speed, position and input"
    coefficients: str = "the values at the knots of its functions"

    @property
    def map(self) -> dict[str, Any] | None:
        """No map: the term is a sum of functions of one input each."""
        return None

    @property
    def terms(self) -> list[dict[str, Any]]:
        """The term's value at every knot with 1-sigma, in the unit of an acceleration."""
        unit = self.axes[1][1]
        return [
            {"place": "axis", "input": f"{name} at {x:.3g}", "coefficient": float(y),
             "sigma": float(s), "unit": unit}
            for name, curve in self.curves.items() for x, y, s in zip(*curve, strict=True)
        ]  # fmt: skip

    def table(self) -> dict[str, Any]:
        """Numbers for diagnosis.json."""
        return {
            "port": self.port, "closed": self.closed, "uninterpreted": True,
            "kind": self.kind,
            "curves": {k: {"x": x, "y": y, "sigma": s} for k, (x, y, s) in self.curves.items()},
            "terms": self.terms,
            "nearest": [x.table() for x in self.nearest],
        }  # fmt: skip


def hats(x: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Piecewise-linear basis (rows, knots) of mean zero."""
    out = np.stack([np.interp(x, knots, e) for e in np.eye(len(knots))], axis=1)
    return out - out.mean(axis=0)


def learn_shaft(model: OdeModel, fit, scores, tell) -> LearnedShaft | None:
    """The term fitted to the train runs' rows beside the baseline; None where it closes nothing.

    And in a free run: only a balance shows it as rows, what a free run shows is its consequence.
    """
    if model.steps_in_time:
        return None
    signals = {s: _signals(model, s) for s in ("train", "held-out")}
    knots = {
        k: np.unique(np.quantile(x, np.linspace(0, 1, KNOTS)))
        for k, x in signals["train"].items()
    }  # fmt: skip
    term = ShaftTerm(knots, np.zeros(0))
    A = term.columns(signals["train"]) * model.weights("train")[:, None]
    J, rest = fit.jacobian[:, : len(model.priors)], fit.residual
    both = np.concatenate([A, J], axis=1)
    size = np.linalg.norm(both, axis=0)
    size[size == 0] = 1.0
    both = both / size
    gram = both.T @ both + RIDGE * np.eye(both.shape[1])
    w = np.linalg.solve(gram, both.T @ rest) / size
    k = A.shape[1]
    term = dataclasses.replace(term, weights=w[:k])
    (before,) = model.residuals([fit.point], "held-out")
    ways, tangents = model.numbers.ways(fit.point), np.zeros((len(before), 0))
    if len(ways):
        tangents = model.along(fit.point, ways, "held-out").T
    shift = term.columns(signals["held-out"]) @ w[:k] * model.weights("held-out")
    after = before - shift - tangents @ w[k:]
    above = float(before @ before) - model.dof("held-out")
    closed = (float(before @ before) - float(after @ after)) / max(above, 1.0)
    tell(f"learned term at the shaft: closes {100 * closed:.0f} % of the gap")
    if not closed > 0:
        return None
    left = rest - (both * size) @ w
    spread = max(1.0, float(left @ left) / model.dof("train"))
    sigma = np.sqrt(spread * np.diag(np.linalg.inv(gram))) / size
    curves, at = {}, 0
    for name, x in knots.items():
        curves[name] = (x, w[at : at + len(x)], sigma[at : at + len(x)])
        at += len(x)
    nearest = near_laws(model, fit.point, J, A @ w[:k], scores)
    return LearnedShaft(term, closed, after, curves, nearest, smooth=closed)


def _signals(model: OdeModel, split: str) -> dict[str, np.ndarray]:
    out: dict[str, list[np.ndarray]] = {"speed": [], "position": [], "input": []}
    for i in model.measured.splits[split]:
        run, rows = model.measured.runs[i], model.measured.rows[i]
        q, v, _ = smoothed(run.outputs["position"], run.step, run.cutoff)
        for name, x in (("speed", v), ("position", q), ("input", run.inputs["input"])):
            out[name].append(np.interp(rows.time, run.time, x))
    return {k: np.concatenate(x) for k, x in out.items()}
