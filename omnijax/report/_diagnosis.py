"""The page of a diagnosis: the answer first, then where, which, the gap, and the parameters."""

from typing import Any

import numpy as np

from .._errors import InputError
from .._text import listed, scaled_together
from ..laws import in_words
from ._content import Column, Fact, Provenance, Section, Table, provenance
from ._diagnosis_figures import learned_figure, next_figure, order_figure, score_figure
from ._diagnosis_numbers import closed, excluded, free_runs, gap_section, notes, parameters
from ._diagnosis_sizes import sizes_section
from ._diagnosis_words import GROUPS, channel_words, effect_sizes, size_facts, where_sentences
from ._page import Page

ANSWERS = {
    "none": "Simulation and data agree within the noise once uncertain parameters are calibrated.",
    "named": "A missing effect was found and named",
    "ambiguous": "Several effects explain these runs equally well",
    "unknown": "There is a significant gap that no known effect closes.",
}
NAMES = {
    "none": "What was tried", "named": "The named effects", "unknown": "What was found",
    "ambiguous": "The effects; of each rival, the size that it would need",
}  # fmt: skip


def diagnosis_page(diagnosis: Any, command: str = "omnijax diagnose") -> Page:
    """A `Page` of a `Diagnosis`."""
    try:
        text = diagnosis.details["evidence"].text(diagnosis.rig)
    except InputError as refused:  # an effect beside one of its kind that the machine has there
        text = f"# {refused}"
    made: Provenance = provenance(command, text, 0)
    sections = [
        *sizes_section(diagnosis),
        *_where(diagnosis),
        _which(diagnosis),
        *_learned(diagnosis),
    ]
    sections += [
        gap_section(diagnosis),
        *free_runs(diagnosis),
        *parameters(diagnosis),
        *excluded(diagnosis),
    ]
    facts = [Fact("verdict", diagnosis.verdict)]
    rivals = [e for some in diagnosis.alternatives if len(some) > 1 for e in some]
    # the sizes of some that are not there say little
    facts += [Fact("rivals", len(rivals))] if rivals else size_facts(diagnosis)
    facts += [
        Fact(f"gap of {GROUPS.get(g, g)} closed", closed(x), "%") for g, x in _worst(diagnosis)
    ]
    question = "Where do simulation and data disagree, and why?"
    return Page(
        "Diagnosis", question, _answer(diagnosis), [*sections, *notes(diagnosis)], made, facts,
        {group: GROUPS[group] for group in diagnosis.gap if group in GROUPS},
    )  # fmt: skip


def _answer(diagnosis) -> str:
    answer = _which_it_is(diagnosis) if diagnosis.effects else ANSWERS[diagnosis.verdict]
    for group, gap in _worst(diagnosis):
        factor, unit = scaled_together((gap.before, gap.after, gap.noise_floor), gap.unit)
        answer += (
            f" What the model misses of {channel_words(group)} on "
            f"{diagnosis.judges.name} falls from "
            f"{gap.before * factor:.4g} to {gap.after * factor:.3g} {unit} RMS; the noise is "
            f"{gap.noise_floor * factor:.3g} {unit}."
        )
    if diagnosis.remainder:
        answer += f" {diagnosis.remainder}"
    if diagnosis.learned:
        answer += (
            f" A learned, uninterpreted term at the {diagnosis.learned['port']} closes "
            f"{100 * diagnosis.learned['closed']:.0f} % of it."
        )
    return answer


def _which_it_is(diagnosis) -> str:
    """The named effects, and beside them the ones of which the runs do not tell which it is."""
    lists = [[_words(e, diagnosis) for e in some] for some in diagnosis.alternatives]
    sure = [some[0] for some in lists if len(some) == 1]
    rivals = [listed(some, "or") for some in lists if len(some) > 1]
    confirm, tells = diagnosis.judges.confirm, ""
    if not rivals:
        return f"{ANSWERS['named']}, {confirm}. It is {listed(sure)}."
    if diagnosis.next_experiment:
        several = " of the first which it is" if len(rivals) > 1 else ""
        tells = f": the next experiment tells{several}"
    which = rivals[0] if len(rivals) == 1 else listed([f"either {some}" for some in rivals])
    if not sure:
        return f"{ANSWERS['ambiguous']}{tells}. It is {which}."
    of, beside = ("One missing effect is", "it") if len(sure) == 1 else (
        "Missing effects are", "them"
    )  # fmt: skip
    return (
        f"{of} named, {confirm}: {listed(sure)}. Beside {beside} there is {which}, which explain "
        f"these runs equally well{tells}."
    )


def _words(effect: Any, diagnosis: Any) -> str:
    """An effect as a mechanic says it, with its id."""
    said = in_words(effect.id, effect.place, diagnosis.laws)
    return said if f"`{effect.id}`" in said else f"{said} (`{effect.id}`)"


def _worst(diagnosis) -> list:
    """The output group highest above its noise, where something was added to close it."""
    if diagnosis.verdict == "none" or not diagnosis.gap:
        return []
    return [max(diagnosis.gap.items(), key=lambda item: item[1].before / item[1].noise_floor)]


def _where(diagnosis) -> list[Section]:
    """Where the gap is: sentences, a figure, and the table behind; none where nothing was asked."""
    if not diagnosis.where:
        return []
    rows = [
        [w["channel"], w["domain"], f"{w['value']:.4g}" if np.isfinite(w["value"]) else "–",
         {"Hz": "Hz", "s": "the run"}.get(w["reference"], w["reference"]), 100 * w["share"],
         w["rms_over_noise"], "yes" if w["stands"] else "no"]
        for w in diagnosis.where
    ]  # fmt: skip
    columns = [Column("channel", text=True), Column("hangs on", text=True),
               Column("value", text=True, minor=True), Column("of", text=True),
               Column("share", "%"), Column("RMS over noise", minor=True),
               Column("beyond chance", text=True, minor=True)]  # fmt: skip
    note = "Every place, with its share of a channel's residual power"
    table = Table(columns, rows, "where", note, folded=True)
    text = " ".join(where_sentences(diagnosis))
    text += (
        f"\n\nBefore any effect is added, on {diagnosis.judges.shown}. Beyond chance: against "
        "residuals whose blocks are shuffled, fewer than 1 % false discoveries."
    )
    figures = [order_figure(diagnosis)] if diagnosis.details and diagnosis.details["where"] else []
    return [Section("Where", text, figures, [table])]


def _which(diagnosis) -> Section:
    first = [s for s in diagnosis.scores if s["step"] == 1][:10]
    figures = [score_figure(first)] if first else []
    rows = [
        [f"{e.id} at {e.place}", effect_sizes(e), e.evidence.get("delta_bic"),
         e.evidence.get("margin_to_next"),
         _rivals(e, diagnosis.effects)]
        for some in diagnosis.alternatives for e in some
    ]  # fmt: skip
    columns = [Column("effect", text=True), Column("parameters", text=True),
               Column("ΔBIC", minor=True),
               Column("margin to the next rival", minor=True),
               Column("not to be told from", text=True)]  # fmt: skip
    tables = [Table(columns, rows, "effects", f"{NAMES[diagnosis.verdict]}.")] if rows else []
    text = (
        "Every law of the library was scored at every place it may have, with the baseline free "
        "beside it; the best few of each step were refitted together with it."
    )
    if diagnosis.next_experiment:
        text += f"\n\nNext experiment: {diagnosis.next_experiment['drive']}."
        figures.append(next_figure(diagnosis))
        compared = [[x["drive"], x["separation"]] for x in diagnosis.next_experiment["compared"]]
        columns = [Column("motion", text=True), Column("separation")]
        note = "Simulated: chi-square between the closest two rivals; 25 is needed."
        tables.append(Table(columns, compared, "next-experiment", note))
    return Section("Which", text, figures, tables)


def _rivals(effect: Any, effects: Any) -> str:
    """What an effect is not to be told from, in words where that is every other one."""
    others = [f"{a['id']} at {a['place']}" for a in effect.indistinguishable_from]
    every = {f"{e.id} at {e.place}" for e in effects if e is not effect}
    return (
        "each of the others"
        if len(every) > 1 and every == set(others)
        else ", ".join(others) or "–"
    )


def _learned(diagnosis) -> list[Section]:
    if not diagnosis.details or diagnosis.details["learned"] is None:
        return []
    learned = diagnosis.details["learned"]
    text = "No known law fits. This is what one would have to do, drawn, not interpreted."
    near = [f"`{x.id}` at {x.place} (cosine {x.cosine:.2f})" for x in learned.nearest]
    if near:
        come = "come" if len(near) > 1 else "comes"
        text += f" Of the library's laws {listed(near)} {come} nearest to it."
    figure = learned_figure(learned, diagnosis.judges.name)
    rows = [
        [x["place"], x["input"], x["coefficient"], x["sigma"], x["unit"]]
        for x in sorted(learned.terms, key=lambda x: -abs(x["coefficient"]) / x["sigma"])
    ]
    columns = [Column("at", text=True), Column("of", text=True), Column("coefficient"),
               Column("1-sigma"), Column("unit", text=True)]  # fmt: skip
    note = f"What the {learned.kind} took up: {learned.coefficients}, the surest first"
    return [Section("What is missing", text, [figure],
                    [Table(columns, rows, "learned-terms", note, folded=True)])]  # fmt: skip
