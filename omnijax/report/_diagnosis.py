"""The page of a diagnosis: the answer first, then where, which, the gap, and the parameters."""

from typing import Any

import numpy as np

from ._content import Column, Fact, Figure, Provenance, Section, Table, provenance
from ._page import Page
from ._style import PALETTE, figure, style

ANSWERS = {
    "none": "Simulation and data agree within the noise once uncertain parameters are calibrated.",
    "named": "A missing effect was found, named, and confirmed on held-out runs.",
    "ambiguous": "Several effects explain these runs equally well: the next experiment tells.",
    "unknown": "There is a significant gap that no known effect closes.",
}


def diagnosis_page(found: Any, command: str = "omnijax diagnose") -> Page:
    """A `Page` of a `Diagnosis`."""
    from ..rig import rig_text

    made: Provenance = provenance(command, rig_text(found.rig), 0)
    sections = [_where(found), _which(found), _gap(found), _parameters(found), _notes(found)]
    facts = [Fact("verdict", found.verdict)]
    facts += [Fact(f"{e.id} at {e.place}", _main(e)) for e in found.effects]
    answer = ANSWERS[found.verdict]
    if found.effects:
        joined = " and " if found.verdict == "named" else " or "
        answer += " It is " + joined.join(f"`{e.id}` at {e.place}" for e in found.effects) + "."
    if found.remainder:
        answer += f" {found.remainder}"
    if found.learned:
        answer += (
            f" A learned, uninterpreted term at the {found.learned['port']} closes "
            f"{100 * found.learned['closed']:.0f} % of it."
        )
    return Page(
        "Diagnosis",
        "Where do simulation and data disagree, and why?",
        answer,
        sections,
        made,
        facts,
    )


def _main(effect) -> str:
    parts = []
    for key, p in effect.parameters.items():
        value = np.round(p["value"], 4) if isinstance(p["value"], list) else f"{p['value']:.5g}"
        parts.append(f"{key} {value} {p['unit']}")
    return ", ".join(parts) or "no free size"


def _where(found) -> Section:
    rows = [
        [
            w["channel"],
            w["domain"],
            f"{w['value']:.4g}" if np.isfinite(w["value"]) else "–",
            w["reference"],
            100 * w["share"],
            w["rms_over_noise"],
            "yes" if w["stands"] else "no",
        ]
        for w in found.where
    ]
    table = Table(
        [Column("channel", text=True), Column("domain", text=True), Column("value", text=True),
         Column("of", text=True), Column("share", "%"), Column("RMS over noise"),
         Column("stands", text=True)],
        rows, "where", "Whether it stands against a block-shuffled null, false discoveries kept "
        "below 1 %.",
    )  # fmt: skip
    text = (
        "The share of a channel's residual power that lies in a line (Hz or order), or between the "
        "bins of a state. Before any effect is added; on a held-out run."
        if rows
        else "Nothing stands out against a block-shuffled null."
    )
    figures = [_order_figure(found)] if found.details and found.details["where"] else []
    return Section("Where", text, figures, [table] if rows else [])


def _order_figure(found) -> Figure:
    answers = found.details["where"]
    channel = found.where[0]["channel"] if found.where else answers[0]["channel"]
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
        axes[0].set(xlabel="order (events a turn)", ylabel="share, %")
        axes[0].set_title(f"Residual of {channel} by order of each wheel and of the sphere")
        axes[0].legend()
        lines = [a for a in answers if a["channel"] == channel and a["domain"] == "frequency"]
        axes[1].plot([a["value"] for a in lines], [100 * a["share"] for a in lines],
                     color=PALETTE["black"])  # fmt: skip
        axes[1].set(xlabel="frequency, Hz", ylabel="share, %")
        axes[1].set_title("The same by frequency: a line that is sharper here stays put in Hz")
    return Figure(fig, "where-orders", f"Where the residual of {channel} lies.", data)


def _which(found) -> Section:
    first = [s for s in found.scores if s["step"] == 1][:10]
    figures = []
    if first:
        with style():
            fig, axes = figure(1, 1, height=3.6)
            names = [f"{s['id']} at {s['place']}" for s in first][::-1]
            gain = np.array([max(s["gain"], 1e-2) for s in first])[::-1]
            axes[0].barh(range(len(names)), gain, color=PALETTE["blue"])
            axes[0].set_yticks(range(len(names)), names)
            axes[0].set(xlabel="gain in chi-square, tangent score", xscale="log")
            axes[0].set_title("What each candidate would explain")
        figures.append(
            Figure(
                fig,
                "scores",
                "Score of the best candidates, baseline parameters projected out.",
                {"candidate": names, "gain / 1": gain.tolist()},
            )
        )
    rows = [
        [f"{e.id} at {e.place}", _main(e), e.evidence.get("delta_bic"),
         e.evidence.get("margin_to_next"),
         ", ".join(f"{a['id']} at {a['place']}" for a in e.indistinguishable_from) or "–"]
        for e in found.effects
    ]  # fmt: skip
    columns = [Column("effect", text=True), Column("parameters", text=True), Column("ΔBIC"),
               Column("margin to the next rival"),
               Column("not to be told from", text=True)]  # fmt: skip
    tables = [Table(columns, rows, "effects", "The named effects.", stacked=True)] if rows else []
    text = (
        "Every law of the library at every place it may have, refitted together with the baseline."
    )
    if found.next_experiment:
        text += f"\n\nNext experiment: {found.next_experiment['drive']}."
        figures.append(_next_figure(found))
        compared = [[x["drive"], x["separation"]] for x in found.next_experiment["compared"]]
        columns = [Column("motion", text=True), Column("separation")]
        note = "Simulated: chi-square between the closest two rivals; 25 is needed."
        tables.append(Table(columns, compared, "next-experiment", note))
    return Section("Which", text, figures, tables)


def _next_figure(found) -> Figure:
    """The torques of the proposed run."""
    torque = found.next_experiment["torque"]
    values = np.asarray(torque["values"])
    time = np.arange(len(values)) * torque["step"]
    data: dict[str, Any] = {"time / s": time}
    with style():
        fig, axes = figure(1, 1, height=3.0)
        for name, x in zip(found.rig.names, values.T, strict=True):
            axes[0].plot(time, x, label=name)
            data[f"{name} / N m"] = x
        axes[0].set(xlabel="time, s", ylabel="motor torque, N m")
        axes[0].set_title("The run that tells the rivals apart")
        axes[0].legend(ncols=len(values.T))
    return Figure(fig, "next-torque", f"Torques of: {found.next_experiment['drive']}.", data)


def _gap(found) -> Section:
    rows = [[g, x.unit, x.noise_floor, x.before, x.after] for g, x in found.gap.items()]
    table = Table(
        [Column("group", text=True), Column("unit", text=True), Column("noise"), Column("before"),
         Column("after")],
        rows, "gap", "RMS of measured less predicted, held-out runs (theta and Omega by windows).",
    )  # fmt: skip
    figures = [_time_figure(found)] if found.details else []
    return Section("The gap", "Held-out runs are never fitted.", figures, [table])


def _time_figure(found) -> Figure:
    d = found.details
    machine = d["model"].machine
    i = d["model"].splits["held-out"][0]
    rows = machine.rows[i]
    groups = list(found.gap)
    worst = max(groups, key=lambda g: found.gap[g].before / found.gap[g].noise_floor)
    tables = [np.concatenate(rows.split(d[k][: rows.size]), axis=1) for k in ("before", "after")]
    column = {"dR": 0, "a": 3, "Omega": 6, "theta": 9}[worst]
    width = 3 if worst != "theta" else tables[0].shape[1] - 9
    pick = column + int(np.argmax(np.sum(tables[0][:, column : column + width] ** 2, axis=0)))
    time = machine.runs[i].time
    before, after = tables[0][:, pick], tables[1][:, pick]
    with style():
        fig, axes = figure(2, 1, sharex=False)
        axes[0].plot(time, before, color=PALETTE["vermillion"], label="before", linewidth=0.8)
        axes[0].plot(time, after, color=PALETTE["blue"], label="after", linewidth=0.8)
        axes[0].set(xlabel="time, s", ylabel="residual, sigma")
        axes[0].set_title(f"Residual of {worst} on {machine.runs[i].name}")
        axes[0].legend(ncols=2)
        f = np.fft.rfftfreq(len(time), machine.runs[i].step)
        for values, colour in ((before, "vermillion"), (after, "blue")):
            axes[1].loglog(f[1:], np.abs(np.fft.rfft(values))[1:] / np.sqrt(len(time)),
                           color=PALETTE[colour], linewidth=0.8)  # fmt: skip
        axes[1].set(xlabel="frequency, Hz", ylabel="amplitude, sigma")
        axes[1].set_title("Its spectrum; white noise is flat at 1")
    data = {"time / s": time, "before / sigma": before, "after / sigma": after}
    return Figure(fig, "gap", "The residual before and after, in units of the noise.", data)


def _parameters(found) -> Section:
    rows = [
        [b["parameter"], b["stated"], b["without_effects"], b["with_effects"],
         100 * b["relative_sigma"],
         100 * b["absorbed"], "yes" if b["determined"] else "no, the prior holds it"]
        for b in found.baseline
    ]  # fmt: skip
    columns = [Column("parameter", text=True), Column("stated"), Column("calibrated, no effect"),
               Column("calibrated, with effect"), Column("sigma", "%"), Column("had absorbed", "%"),
               Column("determined by the data", text=True)]  # fmt: skip
    tables = [Table(columns, rows, "baseline", "Uncertain parameters, SI units.")] if rows else []
    figures = []
    if found.details and found.details["learned"] is not None:
        figures.append(_learned_figure(found.details["learned"]))
    return Section(
        "Parameters", "What the baseline had absorbed before the effect was in.", figures, tables
    )


def _learned_figure(learned) -> Figure:
    picture = learned.map
    with style():
        fig, axes = figure(1, 2, height=3.4)
        data = {}
        for name, (x, y) in learned.curves.items():
            axes[0].plot(x, y, label=name)
            data[f"{name}: input / {learned.units[0]}"] = x
            data[f"{name} / {learned.units[1]}"] = y
        axes[0].set(xlabel=learned.units[0], ylabel=learned.units[1])
        axes[0].set_title("Learned, over the own input")
        axes[0].legend()
        most = np.abs(picture["force"]).max() or 1.0
        drawn = axes[1].pcolormesh(picture["x"], picture["y"], picture["force"].T, cmap="PuOr",
                                   vmin=-most, vmax=most, rasterized=True)  # fmt: skip
        axes[1].set(xlabel=picture["x label"], ylabel=picture["y label"])
        axes[1].set_title(f"Of {picture['wheel']}, {picture['unit']}")
        fig.colorbar(drawn, ax=axes[1])
    return Figure(
        fig, "learned",
        f"What was learned at the {learned.port}: a drawing, not a law. The smooth basis closes "
        f"{100 * learned.smooth:.0f} % of the held-out gap, with a small network beside it "
        f"{100 * learned.network:.0f} %.",
        data,
    )  # fmt: skip


def _notes(found) -> Section:
    lines = [*found.notes, *(f"Data: {f}" for f in found.faults)]
    lines.append("Noise, 1-sigma: " + ", ".join(
        f"{g} {t['sigma']:.3g} ({t['source']})" for g, t in found.noise.items()))  # fmt: skip
    return Section("Notes", "\n\n".join(lines))
