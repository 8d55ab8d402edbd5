"""The numbers behind a diagnosis: the gap, free runs, parameters, limits, noise."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from .._text import estimate, quantity_text, scaled
from ._content import Column, Section, Table
from ._diagnosis_figures import gap_figure, limits_figure


def closed(gap: Any) -> float | None:
    """How much of a gap is closed, %; 100 at most, since what is below the noise is chance."""
    share = gap.closed
    return None if np.isnan(share) else float(f"{100 * min(1.0, share):.3g}")


def gap_section(diagnosis) -> Section:
    """What the model misses before and after, by output group."""
    rows = []
    for group, gap in diagnosis.gap.items():
        factor, unit = scaled(gap.noise_floor, gap.unit)
        values = [factor * x for x in (gap.noise_floor, gap.before, gap.after)]
        above = gap.before > 1.02 * gap.noise_floor
        rows.append([group, unit, *values, closed(gap) if above else None])
    windows = " (theta and Omega by windows)" if {"theta", "Omega"} & set(diagnosis.gap) else ""
    table = Table(
        [Column("group", text=True), Column("unit", text=True), Column("noise", minor=True),
         Column("before"), Column("after"), Column("closed", "%")],
        rows, "gap", f"RMS of measured less predicted, {diagnosis.judges.name}{windows}; closed: "
        "what is gone of what was above the noise.",
    )  # fmt: skip
    figures = [gap_figure(diagnosis)] if diagnosis.details else []
    return Section("The gap", diagnosis.judges.fitted, figures, [table])


def free_runs(diagnosis) -> list[Section]:
    """Of a machine: what a simulation from the first sample misses, run by run."""
    if not diagnosis.free_runs:
        return []
    rows = []
    for run in diagnosis.free_runs:
        for word in ("before", "after"):
            if word in run:
                own = run[word]
                errors = [
                    "–" if own[k] is None else quantity_text(own[k], run["unit"])
                    for k in ("rms", "mae")
                ]
                rows.append([run["run"], run["role"], word, *errors, own["percent"]])
    columns = [Column("run", text=True, minor=True), Column("role", text=True),
               Column("effects", text=True), Column("RMS", text=True, unbroken=True),
               Column("mean absolute", text=True, unbroken=True, minor=True),
               Column("of the motion", "%")]  # fmt: skip
    text = "Position simulated from the inputs alone, from each run's first sample."
    if diagnosis.one_step:
        said = ", ".join(f"{k} {x:.3g} %" for k, x in diagnosis.one_step.items())
        who = diagnosis.judges.name
        text += f" The balance misses, in per cent of the motor's torque on {who}: {said}."
    table = Table(columns, rows, "free-runs", "Free runs.")
    return [Section("Free runs", text, tables=[table])]


def parameters(diagnosis) -> list[Section]:
    """Uncertain parameters, where the rig names any."""
    if not diagnosis.baseline:
        return []
    rows = [
        [
            b["parameter"],
            quantity_text(b["stated"], b["unit"]),
            quantity_text(b["without_effects"], b["unit"]),
            estimate(b["with_effects"], b["sigma"], b["unit"])
            + (" (end)" if b["at_bound"] else ""),
            _absorbed(b),
            _known(b),
        ]
        for b in diagnosis.baseline
    ]
    columns = [
        Column("parameter", text=True),
        Column("stated", text=True, unbroken=True),
        Column("without the effect", text=True, minor=True, unbroken=True),
        Column("calibrated", text=True, unbroken=True),
        Column("had absorbed", text=True, minor=True),
        Column("known from these runs", text=True, minor=True),
    ]
    text = (
        "Calibrated: together with what was named. Had absorbed: by how much it was off while the "
        "effect was missing."
    )
    if any(b["parameter"].split(".")[0] == "clock" and b["parameter"].count(".") > 1
           for b in diagnosis.baseline):  # fmt: skip
        text += (
            " A clock's offset is the mean of the fitted runs; with a run's name, how far that run "
            "is beside it (the last one by what makes their sum 0)."
        )
    if any(b["at_bound"] for b in diagnosis.baseline):
        text += " (end): at an end of its range, so that it is not known."
    table = Table(columns, rows, "baseline", "Uncertain parameters.")
    return [Section("Parameters", text, tables=[table])]


def _absorbed(row: Mapping[str, Any]) -> str:
    """How far a number was off while the effect was missing: a share, or in its unit."""
    if row["relative"]:
        return f"{round(100 * row['absorbed'], 2) + 0.0:.2g} %"
    return quantity_text(row["absorbed"] + 0.0, row["unit"])


def _known(row: Mapping[str, Any]) -> str:
    """Whether the runs have told a number."""
    if row["at_bound"]:
        return "no: at an end of its range"
    return "yes" if row["determined"] else "no: what was stated weighs more"


def notes(diagnosis) -> list[Section]:
    """What else is to be known, and the noise."""
    lines = [*diagnosis.notes, *(f"Data: {f}" for f in diagnosis.faults)]
    text = "\n\n".join(line[:1].upper() + line[1:] for line in lines)
    tables = [_noise(diagnosis)] if diagnosis.noise else []
    return [Section("Notes", text, tables=tables)] if text or tables else []


def _noise(diagnosis) -> Table:
    """The noise by channel: declared and shown."""
    rows = []
    for channel, known in diagnosis.noise.items():
        factor, unit = scaled(known["declared"] or known["shown"], known["unit"])
        declared = known["declared"]
        rows.append(
            [channel, unit, f"{factor * declared:.4g}" if declared else "–",
             factor * known["shown"], None if known["at_most"] else factor * known["sigma"],
             "at most" if known["at_most"] else "level", known["colour"]]
        )  # fmt: skip
    columns = [Column("channel", text=True), Column("unit", text=True),
               Column("declared", text=True), Column("shown"), Column("its sigma", minor=True),
               Column("shown as", text=True), Column("colour", text=True, minor=True)]  # fmt: skip
    note = "Measurement noise, 1-sigma, as the data show it"
    if any(known["at_most"] for known in diagnosis.noise.values()):
        note += "; at most: beside a gap, parts of which count in it"
    return Table(columns, rows, "noise", f"{note}.")


def excluded(diagnosis) -> list[Section]:
    """What the runs exclude: a limit for every effect and place that was not named."""
    known = [x for x in diagnosis.excluded if x["limit_95"] is not None]
    if not known:
        return []
    rows = []
    for x in known:
        factor, unit = scaled(x["limit_95"], x["unit"])
        rows.append([x["id"], x["place"], x["parameter"], factor * x["limit_95"], unit])
    columns = [Column("effect", text=True), Column("place", text=True),
               Column("size", text=True), Column("below"), Column("unit", text=True)]  # fmt: skip
    note = "Upper limits, 95 %: a larger effect would have been seen with that probability."
    silent = sorted({x["id"] for x in diagnosis.excluded} - {x["id"] for x in known})
    text = "Every effect and place that was not named is smaller than its limit."
    if silent:
        text += f" These runs say nothing about {', '.join(silent)}."
    if any(x["parameter"] == "share" for x in known):
        text += " A share is that of the law's own size: below 1 the law is excluded."
    if any(x["parameter"] == "limit" for x in known):
        text += (
            " The limit of a saturation is the highest one tried that the runs exclude: it would "
            "have to be higher."
        )
    table = Table(columns, rows, "excluded", note, folded=True)
    return [Section("What is excluded", text, [limits_figure(known)], [table])]
