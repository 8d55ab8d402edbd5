"""Figures of a diagnosis: orders and lines, scores, the proposed run, the gap, what was learned."""

from typing import Any

import numpy as np

from .._plot import PALETTE, bars_of_scores
from .._text import listed, scaled
from ._content import Figure
from ._style import figure, legend_above, style


def order_figure(diagnosis) -> Figure:
    """Shares of one channel's residual by order of every wheel and of the sphere, and by Hz."""
    answers = diagnosis.details["where"]
    channel = diagnosis.where[0]["channel"] if diagnosis.where else answers[0]["channel"]
    with style():
        fig, axes = figure(2, 1, sharex=False)
        data: dict[str, Any] = {}
        for name in dict.fromkeys(a["reference"] for a in answers if a["domain"] == "order"):
            own = [
                a for a in answers
                if a["channel"] == channel and a["domain"] == "order" and a["reference"] == name
            ]  # fmt: skip
            x, y = [a["value"] for a in own], [100 * a["share"] for a in own]
            axes[0].plot(x, y, marker=".", label=name)
            data["order / 1"], data[f"share {name} / %"] = x, y
        names = dict.fromkeys(a["reference"] for a in answers if a["domain"] == "order")
        turning = list(names) != ["travel"]
        axes[0].set(ylabel="share (%)")
        axes[0].set_xlabel("order (events a turn)" if turning else "order (over the travel)")
        by = "by order of each wheel and of the sphere" if turning else "over the travel"
        axes[0].set_title(f"Residual of {channel} {by}")
        axes[0].legend()
        lines = [a for a in answers if a["channel"] == channel and a["domain"] == "frequency"]
        axes[1].plot([a["value"] for a in lines], [100 * a["share"] for a in lines],
                     color=PALETTE["black"])  # fmt: skip
        axes[1].set(xlabel="frequency (Hz)", ylabel="share (%)")
        axes[1].set_title("The same by frequency: a line that is sharper here stays put in Hz")
        axes[1].set_xlim(0.0, _content_end(lines))
    return Figure(fig, "where-orders", f"Where the residual of {channel} lies.", data)


CONTENT = 0.9  # of the power that a frequency axis has to show


def _content_end(lines: list[dict[str, Any]]) -> float:
    """Where the frequency axis may end: beyond it lies next to nothing."""
    if not lines:
        return 1.0
    lines = sorted(lines, key=lambda a: a["value"])
    whole = np.cumsum([a["share"] for a in lines])
    last = int(np.searchsorted(whole, CONTENT * whole[-1]))
    return lines[min(len(lines) - 1, max(9, last + 1 + last // 4))]["value"]


def score_figure(first: list[dict[str, Any]]) -> Figure:
    """What each of the best candidates would explain, baseline parameters projected out."""
    names = [f"{s['id']} at {s['place']}" for s in first][::-1]
    gain = [float(s["gain"]) for s in first][::-1]
    beside = first[0].get("beside", [])
    with style():
        fig, axes = figure(1, 1, height=3.6)
        bars_of_scores(axes[0], first, PALETTE["blue"])
        axes[0].set_title(f"What each {'further ' if beside else ''}candidate would explain")
    also = f", beside {listed(beside)}" if beside else ""
    note = f"Score of the best candidates{also}, baseline parameters projected out."
    return Figure(fig, "scores", note, {"candidate": names, "gain / 1": gain})


def limits_figure(known: list[dict[str, Any]]) -> Figure:
    """Upper limits by place over the median of the effect's: where it would hide best."""
    ids = list(dict.fromkeys(x["id"] for x in known))
    with style():
        fig, axes = figure(1, 1, height=1.2 + 0.2 * len(ids))
        for row, name in enumerate(ids):
            own = [x["limit_95"] for x in known if x["id"] == name]
            axes[0].plot(np.array(own) / np.median(own), [row] * len(own), "o", ms=4,
                         color=PALETTE["blue"])  # fmt: skip
        axes[0].set_yticks(range(len(ids)), ids)
        axes[0].invert_yaxis()
        axes[0].axvline(1.0, color=PALETTE["black"], lw=0.6)
        axes[0].set(xscale="log", xlabel="limit over the median of the effect's limits")
        axes[0].set_title("Where an effect could hide")
    data = {"effect": [f"{x['id']} at {x['place']}" for x in known],
            "limit / SI": [x["limit_95"] for x in known]}  # fmt: skip
    return Figure(fig, "limits", "Upper limits by place, over the median of each effect.", data)


def next_figure(diagnosis) -> Figure:
    """The torques of the proposed run, of an axis its input."""
    torque = diagnosis.next_experiment["torque"]
    values, unit = np.asarray(torque["values"]), torque["unit"]
    time = np.arange(len(values)) * torque["step"]
    data: dict[str, Any] = {"time / s": time}
    with style():
        fig, axes = figure(1, 1, height=3.0)
        wheels = getattr(diagnosis.rig, "names", None)
        wheels = () if wheels is None or isinstance(wheels, dict) else wheels
        for name, x in zip(wheels or ("input",), values.T, strict=True):
            axes[0].plot(time, x, label=name)
            data[f"{name} / {unit}"] = x
        said = "motor torque" if wheels else "input"
        axes[0].set(xlabel="time (s)", ylabel=f"{said} ({unit})")
        axes[0].set_title("The run that tells the rivals apart")
        axes[0].legend(ncols=len(values.T))
    note = f"{said.capitalize()} of: {diagnosis.next_experiment['drive']}."
    return Figure(fig, "next-torque", note, data)


def gap_figure(diagnosis) -> Figure:
    """The residual of the worst group before and after, over time and frequency."""
    groups = list(diagnosis.gap)
    worst = max(groups, key=lambda g: diagnosis.gap[g].before / diagnosis.gap[g].noise_floor)
    series = diagnosis.details["evidence"].series
    (name, time, first), (_, _, last) = (series(diagnosis.details[k]) for k in ("before", "after"))
    own = {c: x for c, x in first.items() if c == worst or c.rpartition("_")[0] == worst}
    pick = max(own, key=lambda c: float(np.sum(own[c] ** 2)))
    before, after = first[pick], last[pick]
    with style():
        fig, axes = figure(2, 1, sharex=False)
        axes[0].plot(time, before, color=PALETTE["vermillion"], label="before", linewidth=0.8)
        axes[0].plot(time, after, color=PALETTE["blue"], label="after", linewidth=0.8)
        axes[0].set(xlabel="time (s)", ylabel="residual (σ)")
        axes[0].set_title(f"Residual of {worst} on {name}")
        axes[0].legend(ncols=2)
        f = np.fft.rfftfreq(len(time), time[1] - time[0])
        for values, colour in ((before, "vermillion"), (after, "blue")):
            axes[1].loglog(f[1:], np.abs(np.fft.rfft(values))[1:] / np.sqrt(len(time)),
                           color=PALETTE[colour], linewidth=0.8)  # fmt: skip
        axes[1].set(xlabel="frequency (Hz)", ylabel="amplitude (σ)")
        axes[1].set_title("Its spectrum; white noise is flat at 1")
    data = {"time / s": time, "before / sigma": before, "after / sigma": after}
    return Figure(fig, "gap", "The residual before and after, in units of the noise.", data)


def _scaled(values: np.ndarray, unit: str) -> tuple[float, str]:
    """(factor, unit) in which the largest of some values reads well."""
    return scaled(float(np.abs(values).max()), unit)


def learned_figure(learned, who: str) -> Figure:
    """What was learned: the term over its own input with its band, and its map.

    Beside it the nearest laws of the library.  `who` are the runs, or parts of one, whose gap it
    closes.
    """
    picture, ((own, unit_x), (term, unit_y)) = learned.map, learned.axes
    curves = learned.curves.values()
    with style():
        fig, axes = figure(2 if picture else 1, 1, height=6.6 if picture else 3.6, sharex=False)
        data: dict[str, Any] = {}
        p, shown_x = _scaled(np.concatenate([curve[0] for curve in curves]), unit_x)
        q, shown_y = _scaled(np.concatenate([curve[1] for curve in curves]), unit_y)
        for name, (x, y, sigma) in learned.curves.items():
            (line,) = axes[0].plot(p * x, q * y, label=name)
            axes[0].fill_between(p * x, q * (y - 2 * sigma), q * (y + 2 * sigma),
                                 color=line.get_color(), alpha=0.2)  # fmt: skip
            data[f"{name}: input / {unit_x}"] = x
            data[f"{name} / {unit_y}"] = y
            data[f"{name}, 1-sigma / {unit_y}"] = sigma
        for law, dashes in zip(learned.nearest, ("--", ":"), strict=False):
            if law.curve is not None:
                (x, y), name = law.curve, f"{law.id} at {law.place}"
                axes[0].plot(p * x, q * y, color=PALETTE["black"], linestyle=dashes, label=name)
                data[f"{name}: input / {unit_x}"] = x
                data[f"{name} / {unit_y}"] = y
        axes[0].set(xlabel=f"{own} ({shown_x})", ylabel=f"{term} ({shown_y})")
        legend_above(axes[0], 3)
        if picture:
            p, shown_x = _scaled(picture["x"], picture["x unit"])
            q, shown_y = _scaled(picture["y"], picture["y unit"])
            most = np.abs(picture["force"]).max() or 1.0
            drawn = axes[1].pcolormesh(
                p * picture["x"], q * picture["y"], picture["force"].T, cmap="PuOr", vmin=-most,
                vmax=most, rasterized=True,
            )  # fmt: skip
            axes[1].set_xlabel(f"{picture['x label']} ({shown_x})")
            axes[1].set_ylabel(f"{picture['y label']} ({shown_y})")
            axes[1].set_title(f"Of {picture['place']}, {picture['unit']}")
            fig.colorbar(drawn, ax=axes[1])
    beside = ""
    if learned.network is not None:
        beside = f", with a small network beside it {100 * learned.network:.0f} %"
    return Figure(
        fig, "learned",
        f"What was learned at the {learned.port}, with two sigma to each side: a drawing, not a "
        f"law. The smooth basis closes {100 * learned.smooth:.0f} % of the gap on {who}{beside}.",
        data,
    )  # fmt: skip
