"""The page of a sweep: the best designs first, then pictures, failures and how it was made."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from .._text import listed, path_words, quantity_text
from ..study import Grid, SweepResult
from ._axis import SpeedAxis
from ._content import Column, Fact, Figure, Provenance, Section, Table
from ._page import Page
from ._style import figure, style
from ._terms import meanings

ROWS = 10  # designs of a table
POINTS = 4000  # of a picture of samples, and rows of its CSV


def sweep_page(result: SweepResult) -> Page:
    """One offline page of a sweep."""
    varied = [path_words(path) for path, _, _ in result.spec.vary]
    return Page(
        title="Sweep",
        question=f"How {'do' if result.spec.metrics[1:] else 'does'} "
        f"{listed(result.spec.metrics)} depend on {listed(varied)}?",
        answer=_answer(result),
        facts=[
            Fact("designs", result.size),
            *(Fact(f"status: {name}", count) for name, count in result.counts().items()),
        ],
        sections=[*_pictures(result), _best(result), *_failures(result), _how(result)],
        provenance=_provenance(result),
        terms=meanings(*result.spec.metrics),
    )


def _place(result: SweepResult, design: dict[str, float]) -> str:
    return ", ".join(
        f"{path_words(path)} {quantity_text(design[path], unit)}"
        for path, unit, _ in result.spec.vary
    )


def _answer(result: SweepResult) -> str:
    sentences = []
    for name in result.spec.metrics:
        index = result.best(name)
        if index is None:
            sentences.append(f"No design has a figure for {name}.")
            continue
        design = result.design(index)
        value = quantity_text(design[name], result.unit(name))
        status = result.status(index)
        doubt = "" if status == "ok" else f" (but {status})"
        edges = [f"{path_words(path)} is the {end} tried" for path, end in result.edges(index)]
        said = f"The best {name} is {value} at {_place(result, design)}{doubt}."
        if edges:
            said += f" It lies at the edge: {listed(edges)}; look further there."
        sentences.append(said)
    loose = int(np.sum(~result.held()))
    if loose:
        sentences.append(
            f"{loose} of {result.size} designs slip or lift off at some time: they are marked in "
            "the pictures and count as best only where no other design is left."
        )
    return "\n\n".join(sentences)


def _pictures(result: SweepResult) -> list[Section]:
    figures = []
    path, unit, _ = result.spec.vary[0]  # to the right in every picture
    axis = SpeedAxis(path_words(path)) if unit == "rad/s" else None
    for name in result.spec.metrics:
        fig = sweep_figure(result, name)
        words = "white cells have no figure" if _in_cells(result) else "one point a design"
        caption = f"{name} of the designs; {words}."
        switch = axis if len(fig.axes) == 1 else None
        figures.append(Figure(fig, f"sweep-{name}", caption, _data(result, name), switch))
    return [Section("Over the parameters", "", figures)]


def _in_cells(result: SweepResult) -> bool:
    """Whether designs are cells of a heat map: of a grid over several parameters."""
    return isinstance(result.points, Grid) and len(result.shape) > 1


def sweep_figure(result: SweepResult, metric: str) -> Any:
    """`metric` of every design: a heat map of a grid over several parameters, else points.

    Samples over several parameters have a panel for each of them, one below the other.
    """
    with style():
        if _in_cells(result):
            fig, (ax,) = figure(height=4.2)
            result.plot_heatmap(metric, ax=ax)
            return fig
        paths = [path for path, _, _ in result.spec.vary]
        tall = 4.2 if len(paths) == 1 else 2.8 * len(paths)
        fig, panels = figure(rows=len(paths), height=tall, sharex=False)
        for path, ax in zip(paths, panels, strict=True):
            result.plot_lines(metric, path, ax=ax)
            ax.set_title(metric if ax is panels[0] else "")
    return fig


def _data(result: SweepResult, name: str) -> dict[str, Any]:
    """Columns of the picture's CSV: evenly picked designs where there are very many."""
    index = np.unique(np.linspace(0, result.size - 1, min(result.size, POINTS)).round().astype(int))
    columns = [*(path for path, _, _ in result.spec.vary), name]
    return {f"{c} / {result.unit(c)}": result.store.read(c)[index] for c in columns}


def _best(result: SweepResult) -> Section:
    names = result.store.names[:-1]
    tables = []
    left = " of those that neither slip nor lift off" if not result.held().all() else ""
    for name in result.spec.metrics:
        values = _goodness(result, name)
        order = [i for i in np.argsort(values)[:ROWS].tolist() if np.isfinite(values[i])]
        designs = [(i, result.design(i)) for i in order]
        rows = [[i, *_shown(result, d, names), result.status(i)] for i, d in designs]
        others = [n for n in result.spec.metrics if n != name]
        columns = [Column("design", minor=True)]
        columns += [_column(result, n, minor=n in others) for n in names]
        columns.append(Column("status", text=True, minor=True))
        tables.append(
            Table(columns, rows, f"best-{name}", f"The {len(rows)} designs best in {name}{left}.")
        )
    return Section("Best designs", "", tables=tables)


def _shown(result: SweepResult, design: dict[str, float], names: Sequence[str]) -> list[float]:
    """Values of a design in the units of their columns."""
    return [result.readable(name)[0] * design[name] for name in names]


def _column(result: SweepResult, name: str, minor: bool = False) -> Column:
    _, unit = result.readable(name)
    return Column(name, "" if unit == "1" else unit, minor=minor)


def _goodness(result: SweepResult, name: str) -> np.ndarray:
    """Figures of one metric so that smaller is better, infinite where there is none.

    Designs that slip or lift off are left out, unless all do.
    """
    from ..vibration import METRICS

    values = result.store.read(name)
    values = values if METRICS[name].smaller_is_better else -values
    held = result.held().ravel()
    values = np.where(np.isfinite(values), values, np.inf)
    if held[np.isfinite(values)].any():
        values = np.where(held, values, np.inf)
    return values


def _failures(result: SweepResult) -> list[Section]:
    failed = result.failed(ROWS)
    if not failed:
        return []
    names = result.store.names[: len(result.spec.vary)]
    columns = [Column("design"), *(_column(result, n) for n in names)]
    columns.append(Column("run it again", text=True))
    rows = [[i, *_shown(result, result.design(i), names), result.command(i)] for i in failed]
    table = Table(columns, rows, "failed", f"The first {len(rows)} designs without figures.")
    return [Section("Designs that failed", "", tables=[table])]


def _how(result: SweepResult) -> Section:
    spec = result.spec
    rows = [["method of evaluation", result.method], ["translation model", spec.model]]
    rows += [[f"`{axis.path}`", _levels(axis)] for axis in result.points.axes]
    rows.append(
        ["points", spec.sampler if spec.samples is None else f"{spec.samples} {spec.sampler}"]
    )
    if spec.duration is not None:
        rows.append(["runs", f"{spec.duration:g} s at {spec.rate:g} samples/s"])
    device = str(result.store.group.attrs.get("device", ""))
    rows.append(["device", " ".join(dict.fromkeys(device.split()))])
    table = Table([Column("what", text=True), Column("value", text=True)], rows, "question")
    return Section("How it was computed", "", tables=[table])


def _levels(axis: Any) -> str:
    """What an axis of the sweep goes through, in words."""
    if axis.values is not None:
        return ", ".join(quantity_text(x, axis.unit) for x in axis.values)
    count = "" if axis.count is None else f", {axis.count} levels"
    scale = ", logarithmic" if axis.log else ""
    low, high = (quantity_text(end, axis.unit) for end in (axis.low, axis.high))
    return f"{low} to {high}{count}{scale}"


def _provenance(result: SweepResult) -> Provenance:
    attrs = result.store.group.attrs
    command = str(attrs.get("command") or "omnijax.sweep(...)")
    return Provenance(command, result.spec.rig, result.spec.seed, dict(attrs.get("versions", {})))  # pyright: ignore
