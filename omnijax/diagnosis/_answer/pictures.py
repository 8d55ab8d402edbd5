"""Pictures and tables of a diagnosis: `diagnosis.plot_gap()`, `.plot_scores()`, `.to_xarray()`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..._plot import PALETTE, bars_of_scores, new_axes, styled
from ..._result import TitledTable
from .named_effect import Named, OutputGap

BLUE, ORANGE, GREY = PALETTE["blue"], PALETTE["vermillion"], "#777777"
ENDS = ("noise_floor", "before", "after")


@styled
def plot_gap(verdict: str, gap: Mapping[str, OutputGap], judges: str, *, ax: Any = None) -> Any:
    """RMS of every output group before and after, over its noise, on `judges`; returns the axes."""
    ax = new_axes(ax, 3.0)
    groups = list(gap)
    at = np.arange(len(groups))
    for shift, end, colour in ((-0.2, "before", ORANGE), (0.2, "after", BLUE)):
        values = [getattr(g, end) / g.noise_floor for g in gap.values()]
        ax.bar(at + shift, values, 0.38, color=colour, label=end)
    ax.axhline(1.0, color=GREY, lw=1.0, ls="--", label="noise")
    ax.set_xticks(at, groups)
    ax.set(yscale="log", ylabel="RMS / noise", title=f"{verdict}: gap on {judges}")
    ax.legend(frameon=False, ncols=3)
    return ax


@styled
def plot_scores(scores: Sequence[dict[str, Any]], *, step: int = 1, ax: Any = None) -> Any:
    """What the best candidates of a step would explain, as tangent scores; returns the axes.

    Raises `ValueError` where the search had no such step.
    """
    best = [s for s in scores if s["step"] == step]
    if not best:
        steps = sorted({s["step"] for s in scores})
        raise ValueError(f"`step` must be one of {steps}, but is {step}.")
    ax = new_axes(ax, 0.9 + 0.26 * len(best))
    bars_of_scores(ax, best, BLUE)
    ax.set_title(f"What each candidate would explain, step {step}")
    return ax


@styled
def plot_where(where: Sequence[dict[str, Any]], *, ax: Any = None) -> Any:
    """Shares of the residual's power by place, those that do not stand paler; returns the axes."""
    ax = new_axes(ax, 0.9 + 0.26 * max(1, len(where)))
    rows = where[::-1]
    colours = [BLUE if w["stands"] else GREY for w in rows]
    names = [f"{k}  {place_text(w)}" for k, w in zip(range(len(rows), 0, -1), rows, strict=True)]
    ax.barh(names, [100 * w["share"] for w in rows], color=colours)
    ax.set(xlabel="share of the channel's residual power, %", title="Where the gap is")
    return ax


def place_text(where: dict[str, Any]) -> str:
    """A place in words: dR_y, order 1 of w2."""
    value = "" if where["value"] is None or np.isnan(where["value"]) else f" {where['value']:.4g}"
    unit = " Hz" if where["domain"] == "frequency" else f" of {where['reference']}"
    return f"{where['channel']}, {where['domain']}{value}{unit}"


def tables(
    verdict: str, effects: Sequence[Named], gap: Mapping[str, OutputGap], judges: str
) -> list[TitledTable]:
    """The answer with sizes of the effects, and the gap of the runs that judge it."""
    sizes = [
        (f"{e.id} at {e.place}", key, p["value"], "–" if p["sigma"] is None else p["sigma"],
         p["unit"])
        for e in effects
        for key, p in (e.parameters or {"–": {"value": "–", "sigma": None, "unit": ""}}).items()
    ]  # fmt: skip
    rows = [(g, x.unit, x.noise_floor, x.before, x.after) for g, x in gap.items()]
    header = ("effect", "parameter", "value", "1-sigma", "unit") if sizes else ()
    ends = ("group", "unit", "noise", "before", "after")
    return [(f"Diagnosis: {verdict}", sizes, header), (f"Gap on {judges}", rows, ends)]


def dataset(
    verdict: str,
    effects: Sequence[Named],
    gap: Mapping[str, OutputGap],
    base: Sequence[dict[str, Any]],
    scores: Sequence[dict[str, Any]],
) -> Any:
    """Gap, calibrated parameters and scores as an `xarray.Dataset`."""
    import xarray

    ends = {f"gap_{end}": ("group", [getattr(g, end) for g in gap.values()]) for end in ENDS}
    keys = ("stated", "without_effects", "with_effects", "relative_sigma")
    parameters = {f"parameter_{k}": ("parameter", _numbers(base, k)) for k in keys}
    columns = {f"score_{k}": ("candidate", _numbers(scores, k)) for k in ("gain", "p", "step")}
    coords = {
        "group": list(gap),
        "unit": ("group", [g.unit for g in gap.values()]),
        "parameter": [b["parameter"] for b in base],
        "candidate": [f"{s['id']}@{s['place']}" for s in scores],
    }
    named = ", ".join(f"{e.id}@{e.place}" for e in effects)
    return xarray.Dataset(
        ends | parameters | columns, coords, {"verdict": verdict, "effects": named}
    )


def _numbers(rows: Sequence[dict[str, Any]], key: str) -> np.ndarray:
    """A column (rows,); what is not known (None) is NaN."""
    return np.array([row[key] for row in rows], float)
