"""`reproduce`: the paper's figures, its claims judged, its errata checked, on one page."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np

from .._files import write_text
from ..report import Badge, Column, Fact, Page, Section, Table, provenance
from ..rig import rig_text
from . import _figures_elastic, _figures_ideal
from ._case import RANGES, SENSITIVITY_DAMPING, changed
from ._claim import FAILS, HOLDS, PARTLY, TONES, Claim, Erratum
from ._cycle import FACTORS, FASTEST, HARMONICS, cycle
from ._errata import errata, recovered_radius
from ._judge_elastic import SCANNED, elastic_claims
from ._judge_ideal import ideal_claims, rigid_claim
from ._judge_resistance import resistance_claim
from ._study import PaperStudy, make_study

STEPS = 8
SYMBOLS = ("K", "C", "k", "c", "K'", "η")


class Reproduction(NamedTuple):
    """What was found and where it lies."""

    claims: list[Claim]
    errata: list[Erratum]
    page: Path

    def to_json(self) -> dict[str, Any]:
        """Claims and errata as plain data."""
        return {
            "claims": [claim.to_json() for claim in self.claims],
            "errata": [row.to_json() for row in self.errata],
        }


def reproduce(
    out: str | Path,
    *,
    samples: int = 4,
    seed: int = 0,
    harmonics: int = HARMONICS,
    say: Callable[[str], None] = lambda _: None,
) -> Reproduction:
    """Remake the paper into the folder `out`: fig07.png … fig14.png, claims.json, index.html.

    `samples` points of the parameters that the paper does not give are judged beside the rig's own;
    `harmonics` of every wheel enter; `say` hears the name of each step as it begins.
    """
    study = make_study(samples, seed, harmonics, say)
    say("claims and errata")
    claims = [
        *ideal_claims(study),
        rigid_claim(study),
        *elastic_claims(study),
        resistance_claim(study),
    ]
    rows = errata(study)
    say("figures and page")
    page = _page(study, claims, rows, f"omnijax reproduce --out {out} --seed {seed}")
    path = page.write(out)
    reproduction = Reproduction(claims, rows, path)
    text = json.dumps(reproduction.to_json(), indent=1, ensure_ascii=False)
    write_text(Path(out) / "claims.json", text + "\n")
    return reproduction


def _spectra(study: PaperStudy) -> dict[float, tuple[np.ndarray, np.ndarray]]:
    """Angular frequencies and sizes of the fastest wheel's lines, by roundness."""
    run = eqx.filter_jit(lambda rig: cycle(rig, "paper", 64, 1536))
    by_roundness = {}
    for eta in _figures_elastic.SHOWN:
        machine = changed(study.rig, {"wheel.roundness": eta, "wheel.contact.damping": 8500.0})
        lines = run(machine)
        size = np.linalg.norm(np.abs(np.asarray(lines.lines[FASTEST])), axis=-1)
        by_roundness[eta] = (np.asarray(lines.rate[FASTEST]), size)
    return by_roundness


def _page(study: PaperStudy, claims: list[Claim], rows: list[Erratum], command: str) -> Page:
    tally = {v: sum(c.verdict == v for c in claims) for v in (HOLDS, PARTLY, FAILS)}
    confirmed = sum(row.confirmed for row in rows)
    rigid = next(c for c in claims if c.id == "rigid-size").evidence
    elastic = next(c for c in claims if c.id == "elastic-smaller").readings
    return Page(
        title="The paper remade",
        question=(
            "Which results of “Dynamics and vibration analysis of the interface between a "
            "non-rigid sphere and omnidirectional wheel actuators” (Weiss, Langlois, Hayes) stand?"
        ),
        answer=(
            f"Of {len(claims)} claims, {tally[HOLDS]} hold, {tally[PARTLY]} hold only under a "
            f"reading, {tally[FAILS]} not. {confirmed} of {len(rows)} errata are borne "
            "out by a number.\n\n"
            "The decisive point: the wheel's shape has a kink at every gap edge. Its impulses, "
            "which the printed equations drop, raise the elastic part from at most "
            f"{100 * elastic[0].high:.2g} % of the rigid ΔR to between "
            f"{100 * elastic[1].low:.2g} % and {100 * elastic[1].high:.2g} % over the ranges."
        ),
        facts=[
            Fact("claims that hold", f"{tally[HOLDS]} of {len(claims)}"),
            Fact("only under a reading", f"{tally[PARTLY]} of {len(claims)}"),
            Fact("errata borne out", f"{confirmed} of {len(rows)}"),
            Fact("peak of the rigid ΔR", 1e6 * rigid["peak |ΔR| of the cycle / m"], "µm"),
        ],
        sections=[
            Section("Claims", _CLAIMS_TEXT, tables=[_claims_table(claims)]),
            Section("Errata", _errata_text(study), tables=[_errata_table(rows)]),
            Section(
                "The ideal case",
                "Round wheels, constant torques and force. Same content as figures 7 to 9 of the "
                "paper; the look is ours.",
                figures=[make(study) for make in _IDEAL],
            ),
            Section(
                "The elastic cases",
                "Constant wheel speeds (0.1, 1.2, 0.3) rad/s, the paper's own equations contact by "
                "contact. Same content as figures 10 to 14 of the paper as far as it can be told "
                "from its text; the look is ours.",
                figures=[
                    _figures_ideal.rigid(study),
                    _figures_elastic.elastic(study),
                    _figures_elastic.roundness(study),
                    _figures_elastic.spectrum(study, _spectra(study)),
                    _figures_elastic.stiffness(study),
                ],
            ),
            Section("What matters", _SENSITIVITY_TEXT, tables=[_sensitivity_table(study)]),
            Section("What the paper does not give", _RANGES_TEXT, tables=[_ranges_table()]),
        ],
        provenance=provenance(command, rig_text(study.rig), study.seed),
    )


_IDEAL = (_figures_ideal.velocity, _figures_ideal.path, _figures_ideal.attitude)

_CLAIMS_TEXT = (
    "A claim holds where every reading of it keeps its bound over the whole range of the "
    "parameters that the paper does not give; it holds only under a reading where some do. "
    "Every verdict is computed from the numbers beside it; `claims.json` has them in full."
)
_SENSITIVITY_TEXT = (
    "Exact derivatives d log(metric)/d log(parameter) of the long-run cycle, own rig: 0.1 means "
    "that 10 % more of the parameter is 1 % more of the metric. They settle “dominant” and "
    "“varied little”, metric by metric."
)
_RANGES_TEXT = "Every claim is judged at the rig's own values and over these ranges."


def _errata_text(study: PaperStudy) -> str:
    return (
        "One measure of wrongness for each row, for the printed form and for the reading taken. A "
        "row is borne out where the printed form lies above the limit and the reading does not.\n\n"
        "Integrated as printed, r̈_w leaves the wheel's radius off by "
        f"{recovered_radius(study.rig):.4g} Δr_w after a single gap: the impulse at the gap's edge "
        "is what closes the circle."
    )


def _claims_table(claims: list[Claim]) -> Table:
    return Table(
        [
            Column("claim", text=True),
            Column("verdict", text=True),
            Column("readings and numbers", text=True),
            Column("decided by", text=True),
        ],
        [
            [
                claim.content,
                Badge(claim.verdict, TONES[claim.verdict]),
                tuple(reading.line() for reading in claim.readings),
                claim.figure,
            ]
            for claim in claims
        ],
        "claims",
        stacked=True,
    )


def _errata_table(rows: list[Erratum]) -> Table:
    return Table(
        [
            Column("eq.", text=True),
            Column("as printed", text=True),
            Column("problem", text=True),
            Column("reading taken", text=True),
            Column("measure", text=True),
            Column("printed"),
            Column("taken"),
            Column("borne out", text=True),
        ],
        [
            [
                row.equation, row.printed, row.problem, row.taken,
                row.measure + ("" if row.unit == "1" else f", {row.unit}"),
                row.value_printed, row.value_taken,
                Badge("yes", "good") if row.confirmed else Badge("no", "bad"),
            ]
            for row in rows
        ],
        "errata",
        stacked=True,
    )  # fmt: skip


def _sensitivity_table(study: PaperStudy) -> Table:
    return Table(
        [
            Column("metric", text=True),
            Column("C", "N s/m"),
            *(Column(f"by {symbol}") for symbol in SYMBOLS[: len(FACTORS)]),
        ],
        [
            [words, f"{damping:g}", *(float(f"{x:.3g}") for x in rates)]
            for name, words in SCANNED.items()
            for damping, rates in zip(
                SENSITIVITY_DAMPING, getattr(study.sensitivity, name)[:, 0], strict=True
            )
        ],
        "sensitivities",
    )


def _ranges_table() -> Table:
    return Table(
        [Column("parameter", text=True), Column("path", text=True), Column("from"), Column("to"),
         Column("unit", text=True)],
        [[r.symbol, r.path, r.low, r.high, r.unit] for r in RANGES],
        "ranges",
    )  # fmt: skip
