"""The page of a diagnosis: the answer first, then where, which, the gap, and the parameters."""

from typing import Any

import numpy as np

from .._text import estimate, scaled
from ..laws import in_words
from ._content import Column, Fact, Provenance, Section, Table, provenance
from ._diagnosis_figures import (
    gap_figure,
    learned_figure,
    limits_figure,
    next_figure,
    order_figure,
    score_figure,
)
from ._page import Page

ANSWERS = {
    "none": "Simulation and data agree within the noise once uncertain parameters are calibrated.",
    "named": "A missing effect was found and named",
    "ambiguous": "Several effects explain these runs equally well: the next experiment tells.",
    "unknown": "There is a significant gap that no known effect closes.",
}
CONFIRMED = {
    "held-out": "and held-out runs confirm it",
    "blocks": "and those parts of the only run confirm it that were kept out of the fit",
    "nothing": "and no run is left to confirm it",
}
NEVER = {
    "held-out": "Held-out runs are never fitted, but for their start: where wheels without encoder "
    "stand, and the motion there.",
    "blocks": "On the seconds of the only run that were kept out of the fit.",
    "nothing": "On the only run, which was fitted: nothing was kept out.",
}


def diagnosis_page(found: Any, command: str = "omnijax diagnose") -> Page:
    """A `Page` of a `Diagnosis`."""
    text = found.details["evidence"].text(found.rig)
    made: Provenance = provenance(command, text, 0)
    sections = [_where(found), _which(found), *_learned(found), _gap(found)]
    sections += [*_free_runs(found), *_excluded(found), _parameters(found)]
    facts = [Fact("verdict", found.verdict)]
    facts += [Fact(f"{e.id} at {e.place}", effect_sizes(e)) for e in found.effects]
    facts += [Fact(f"gap of {g} closed", f"{100 * x.closed:.3g} %") for g, x in _worst(found)]
    question = "Where do simulation and data disagree, and why?"
    return Page("Diagnosis", question, _answer(found), [*sections, _notes(found)], made, facts)


def _answer(found) -> str:
    answer = ANSWERS[found.verdict]
    if found.verdict == "named":
        answer += f", {CONFIRMED[found.confirmed_on]}."
    if found.effects:
        joined = " and " if found.verdict == "named" else " or "
        words = [in_words(e.id, e.place) for e in found.effects]
        words = [
            said if f"`{e.id}`" in said else f"{said} (`{e.id}`)"
            for e, said in zip(found.effects, words, strict=True)
        ]
        answer += " It is " + joined.join(words) + "."
    for group, gap in _worst(found):
        factor, unit = scaled(gap.before, gap.unit)
        answer += (
            f" What the model misses of {group} on the held-out runs falls from "
            f"{gap.before * factor:.3g} to {gap.after * factor:.3g} {unit} RMS; the noise is "
            f"{gap.noise_floor * factor:.3g} {unit}."
        )
    if found.remainder:
        answer += f" {found.remainder}"
    if found.learned:
        answer += (
            f" A learned, uninterpreted term at the {found.learned['port']} closes "
            f"{100 * found.learned['closed']:.0f} % of it."
        )
    return answer


def _worst(found) -> list:
    """The output group highest above its noise, where something was added to close it."""
    if found.verdict == "none" or not found.gap:
        return []
    return [max(found.gap.items(), key=lambda item: item[1].before / item[1].noise_floor)]


def effect_sizes(effect) -> str:
    """The parameters of an effect with their 1-sigma: "gap 5.660 ± 0.002 µm"."""
    parts = []
    for key, p in effect.parameters.items():
        values, sigmas = np.atleast_1d(p["value"]), p["sigma"]
        each = np.broadcast_to(np.nan if sigmas is None else sigmas, values.shape)
        said = [estimate(float(v), float(d), p["unit"]) for v, d in zip(values, each, strict=True)]
        parts.append(f"{key} {', '.join(said)}")
    return "; ".join(parts) or "no free size"


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
    )
    if not any(w["stands"] for w in found.where):
        text += " Nothing stands out against a block-shuffled null"
        text += "; the likeliest places are listed." if rows else "."
    figures = [order_figure(found)] if found.details and found.details["where"] else []
    return Section("Where", text, figures, [table] if rows else [])


def _which(found) -> Section:
    first = [s for s in found.scores if s["step"] == 1][:10]
    figures = [score_figure(first)] if first else []
    rows = [
        [f"{e.id} at {e.place}", effect_sizes(e), e.evidence.get("delta_bic"),
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
        figures.append(next_figure(found))
        compared = [[x["drive"], x["separation"]] for x in found.next_experiment["compared"]]
        columns = [Column("motion", text=True), Column("separation")]
        note = "Simulated: chi-square between the closest two rivals; 25 is needed."
        tables.append(Table(columns, compared, "next-experiment", note))
    return Section("Which", text, figures, tables)


def _learned(found) -> list[Section]:
    if not found.details or found.details["learned"] is None:
        return []
    text = "No known law fits. This is what one would have to do, drawn, not interpreted."
    return [Section("What is missing", text, [learned_figure(found.details["learned"])])]


def _gap(found) -> Section:
    rows = []
    for group, gap in found.gap.items():
        factor, unit = scaled(gap.before, gap.unit)
        values = [factor * x for x in (gap.noise_floor, gap.before, gap.after)]
        above = gap.before > 1.02 * gap.noise_floor
        rows.append([group, unit, *values, 100 * gap.closed if above else None])
    table = Table(
        [Column("group", text=True), Column("unit", text=True), Column("noise"), Column("before"),
         Column("after"), Column("closed", "%")],
        rows, "gap", "RMS of measured less predicted, held-out runs (theta and Omega by windows); "
        "closed: what is gone of what was above the noise.",
    )  # fmt: skip
    figures = [gap_figure(found)] if found.details else []
    return Section("The gap", NEVER[found.confirmed_on], figures, [table])


def _free_runs(found) -> list[Section]:
    """Of a machine: what a simulation from the first sample misses, run by run."""
    if not found.free_runs:
        return []
    rows = []
    for run in found.free_runs:
        for word in ("before", "after"):
            if word in run:
                own = run[word]
                rows.append([run["run"], run["role"], word, run["unit"], own["rms"], own["mae"],
                             own["percent"]])  # fmt: skip
    columns = [Column("run", text=True), Column("role", text=True), Column("effects", text=True),
               Column("unit", text=True), Column("RMS"), Column("MAE"),
               Column("of the motion", "%")]  # fmt: skip
    text = "Position simulated from the inputs alone, from each run's first sample."
    if found.one_step:
        said = ", ".join(f"{k} {x:.3g} %" for k, x in found.one_step.items())
        text += f" The balance misses, in per cent of the motor's torque on held-out runs: {said}."
    table = Table(columns, rows, "free-runs", "Free runs.")
    return [Section("Free runs", text, tables=[table])]


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
    text = "What the baseline had absorbed before the effect was in."
    return Section("Parameters", text, tables=tables)


def _notes(found) -> Section:
    lines = [*found.notes, *(f"Data: {f}" for f in found.faults)]
    text = "\n\n".join(line[:1].upper() + line[1:] for line in lines)
    return Section("Notes", text, tables=[_noise(found)] if found.noise else [])


def _noise(found) -> Table:
    """The noise by channel: declared and shown."""
    rows = []
    for channel, known in found.noise.items():
        factor, unit = scaled(known["shown"], known["unit"])
        declared = known["declared"]
        rows.append(
            [channel, unit, f"{factor * declared:.4g}" if declared else "–",
             factor * known["shown"], factor * known["sigma"], known["colour"]]
        )  # fmt: skip
    columns = [Column("channel", text=True), Column("unit", text=True),
               Column("declared", text=True), Column("shown"), Column("its sigma"),
               Column("colour", text=True)]  # fmt: skip
    return Table(columns, rows, "noise", "Measurement noise, 1-sigma, as the data show it.")


def _excluded(found) -> list[Section]:
    """What the runs exclude: a limit for every effect and place that was not named."""
    known = [x for x in found.excluded if x["limit_95"] is not None]
    if not known:
        return []
    rows = []
    for x in known:
        factor, unit = scaled(x["limit_95"], x["unit"])
        rows.append([x["id"], x["place"], x["parameter"], factor * x["limit_95"], unit])
    columns = [Column("effect", text=True), Column("place", text=True),
               Column("size", text=True), Column("below"), Column("unit", text=True)]  # fmt: skip
    note = "Upper limits, 95 %: a larger effect would have been seen with that probability."
    silent = sorted({x["id"] for x in found.excluded} - {x["id"] for x in known})
    text = "Every effect and place that was not named is smaller than its limit."
    if silent:
        text += f" These runs say nothing about {', '.join(silent)}."
    if any(x["parameter"] == "share" for x in known):
        text += " A share is that of the law's own size: below 1 the law is excluded."
    table = Table(columns, rows, "excluded", note)
    return [Section("What is excluded", text, [limits_figure(known)], [table])]
