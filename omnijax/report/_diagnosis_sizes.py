"""Sliders of a diagnosis: the size of every named effect, and what the model then misses."""

from typing import Any

import numpy as np

from .._text import scaled
from ..diagnosis import effect_sizes_on_held_out
from ..laws import in_words
from ._content import Column, Dial, Section, Table

DIGITS = 5  # of a stored number


def sizes_section(diagnosis: Any) -> list[Section]:
    """The section with the sliders; none where nothing is named."""
    kept = effect_sizes_on_held_out(diagnosis)
    if kept is None:
        return []
    traces = []
    for trace in kept.traces:
        factor, unit = scaled(float(np.abs(trace.values).max()), trace.unit)
        traces.append({
            "channel": trace.channel, "unit": unit, "time": _few(trace.time),
            "values": _few(factor * trace.values),
        })  # fmt: skip
    sliders = []
    for effect in kept.effects:
        name, _, place = effect.name.partition("@")
        own, own_unit = (1.0, "") if effect.size is None else scaled(effect.size, effect.unit)
        sliders.append({
            "label": in_words(name, place, diagnosis.laws).replace("`", ""), "unit": own_unit,
            "size": None if effect.size is None else own * effect.size,
            "shares": effect.shares, "columns": effect.column,
        })  # fmt: skip
    groups = []
    for group, gram in kept.gram.items():
        own, own_unit = scaled(kept.floor[group], kept.units[group])
        groups.append({
            "name": group, "unit": own_unit, "noise": own * kept.floor[group],
            "gram": _few(own**2 * gram),
        })  # fmt: skip
    model = {
        "sliders": sliders, "groups": groups, "named": kept.as_named, "run": kept.run,
        "count": len(kept.traces[0].values), "traces": traces,
    }  # fmt: skip
    who = diagnosis.judges.name
    text = (
        "Drag the size: at 0 the effect is not there, at 100 % it is as large as the runs say. "
        f"What {who} then leave unexplained is drawn below. Calibrated "
        "parameters stay as they are."
    )
    return [Section("How large is it", text, tables=[_table(kept, sliders, groups, who)],
                    dial=Dial(model))]  # fmt: skip


def _few(values: Any) -> list:
    """Numbers in few digits, as nested lists."""
    x = np.asarray(values, float)
    with np.errstate(divide="ignore"):
        places = DIGITS - 1 - np.floor(np.log10(np.maximum(np.abs(x).max(initial=0.0), 1e-300)))
    return np.round(x, int(np.clip(places + 3, 0, 300))).tolist()


def _table(kept: Any, sliders: list, groups: list, who: str) -> Table:
    """RMS of every group at the stored sizes, on the runs or parts `who` judge."""
    rows = []
    for slider in sliders:
        for share, k in zip(slider["shares"], slider["columns"], strict=True):
            left = [float(np.sqrt(max(0.0, g["gram"][k][k]))) for g in groups]
            rows.append([slider["label"], 100.0 * share, *left])
    columns = [Column("effect", text=True), Column("size", "%"),
               *(Column(g["name"], g["unit"]) for g in groups)]  # fmt: skip
    note = f"What {who} leave at each size of an effect, RMS."
    return Table(columns, rows, "sizes", note, folded=True)
