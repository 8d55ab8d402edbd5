"""One line per answer: what was hidden, what was said, and how the figures of both compare."""

import math
import tempfile
import time
import traceback
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import norm

from omnijax.diagnosis import Diagnosis, diagnose

from .._lines import commit
from .cases import Drawn, drawn, recorded, sized, taught, written
from .effects import Hidden
from .oracle import honest, told, told_apart

ANGLES = ("phase", "phases")
DIRECTIONS = ("axis", "direction")
PICKED = 6  # p-values of candidates kept a case, drawn at random


def answered(seed: int, kind: str | None = None) -> dict:
    """Draw, plant, diagnose and compare the case of a seed."""
    case = drawn(seed, kind)
    sizes = sized(case)
    tables, shows = recorded(case, sizes)
    first = taught(case, sizes)
    with tempfile.TemporaryDirectory() as folder:
        written(Path(folder), case, sizes, tables)
        started = time.process_time()
        try:
            found = diagnose(folder)
        except Exception as error:  # a failure is an answer, and a wrong one
            traceback.print_exc()
            found = Diagnosis("failed", [], [], {}, None, [], {}, [], notes=[repr(error)])
            found.details = {"found": None}
        seconds = time.process_time() - started
    hidden = list(zip(case.hidden, sizes, strict=True))
    true = {(h.id, h.place): h.truth(x) for h, x in hidden}
    asked = "named" if case.kind == "ambiguous" else "ambiguous"
    apart = told_apart(found, true) if found.verdict == asked else None
    return {
        "seed": seed, "kind": case.kind, "commit": commit(), "cpu": round(seconds, 1),
        "shows": _short(shows), "factors": case.factors, "taught": [_short(x) for x in first],
        "hidden": [{"id": h.id, "place": h.place, "parameters": _plain(h.truth(x))}
                   for h, x in hidden],
        "noise": [case.noise["how"], case.noise["fault"]],
        "machine": [case.machine.wheels, case.rate, len(case.torque), case.forced, case.drop,
                    len(case.machine.uncertainty) > 4, case.cut],
        "verdict": found.verdict, "got": [[e.id, e.place] for e in found.effects],
        "right": right(case, found, apart), "apart": apart,
        "compared": compared(case.kind, hidden, found, case.cut),
        "limits": limits(hidden, found), "p": picked(seed, found),
        "gap": {g: [_short(x.before / x.noise_floor), _short(x.after / x.noise_floor)]
                for g, x in found.gap.items()},
        "why": found.notes[0][:160],
    }  # fmt: skip


def right(case: Drawn, found, apart: list[dict] | None = None) -> bool:
    """Verdict, all ids and places, nothing extra.

    `ambiguous` is right too where it holds what is hidden, and no rival is told `apart` from that;
    of a case drawn as ambiguous `named` is, where every rival is.
    """
    wanted = {(h.id, h.place) for h in case.hidden}
    got = {(e.id, e.place) for e in found.effects}
    if case.kind == "ambiguous":
        twins = {(t["id"], t["place"]) for e in found.effects for t in e.indistinguishable_from}
        alone = found.verdict == "named" and got == wanted and told(apart)
        return alone or (bool(twins) and wanted <= got | twins)
    if case.kind == "unknown":
        return found.verdict == "unknown"
    verdict = "named" if wanted else "none"
    return (found.verdict == verdict and got == wanted) or honest(apart)


def compared(
    kind: str, hidden: list[tuple[Hidden, float]], found, cut: float = 0.0
) -> dict[str, dict[str, Any]]:
    """By parameter of the effects that were found: truth, value, and (value - truth)/sigma.

    `cut` s after the plant began, the recording does: what counts its time from there.
    """
    out = {}
    for h, x in hidden:
        e = next((e for e in found.effects if (e.id, e.place) == (h.id, h.place)), None)
        if e is None or kind == "ambiguous":
            continue
        truth = _recorded(h.id, h.truth(x), cut)
        parameters = _turned_alike(h.id, truth, e.parameters)
        for key, true in truth.items():
            given = parameters.get(key)
            if given is None or None in np.ravel(given["sigma"]):
                continue
            for k, (t, v, s) in enumerate(_numbers(key, true, given)):
                out[f"{h.id} {key} {k}" if np.ndim(true) else f"{h.id} {key}"] = {
                    "true": _short(t), "value": _short(v),
                    "z": _short((v - t) / s) if s > 0 else None,
                }  # fmt: skip
    return out


def _recorded(id: str, truth: dict[str, Any], cut: float) -> dict[str, Any]:
    """The parameters of a law of time, whose time begins `cut` s later."""
    if id != "floor-vibration":
        return truth
    return truth | {"phase": truth["phase"] + 2 * math.pi * truth["frequency"] * cut}


def _turned_alike(id: str, truth: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """A vibration's direction on the truth's side: turned about, half a turn later, it is one."""
    if id != "floor-vibration" or np.dot(given["direction"]["value"], truth["direction"]) >= 0:
        return given
    direction, phase = given["direction"], given["phase"]
    return given | {
        "direction": direction | {"value": [-x for x in direction["value"]]},
        "phase": phase | {"value": phase["value"] + math.pi},
    }


def _numbers(key: str, true, given) -> list[tuple[float, float, float]]:
    """(truth, value, sigma) of every number: angles within a turn, an axis up to its sign."""
    t, v = np.atleast_1d(true).astype(float), np.atleast_1d(given["value"]).astype(float)
    s = np.broadcast_to(np.atleast_1d(given["sigma"]).astype(float), t.shape)
    if t.shape != v.shape:
        return []
    if key in ANGLES:
        v = t + np.angle(np.exp(1j * (v - t)))
    if key in DIRECTIONS:
        v = v / np.linalg.norm(v)
        v = v * (np.sign(t @ v) or 1.0) if key == "axis" else v
    return list(zip(t.tolist(), v.tolist(), s.tolist(), strict=True))


def limits(hidden: list[tuple[Hidden, float]], found) -> list[list[Any]]:
    """[effect, limit, true size] of hidden effects that were not named but have a limit.

    Of a saturation the true bound and the excluded one, which lies below it where it holds.
    """
    out = []
    for h, x in hidden:
        for entry in found.excluded:
            if (entry["id"], entry["place"]) != (h.id, h.place) or entry["limit_95"] is None:
                continue
            true = h.truth(x).get(entry["parameter"])
            if true is not None:
                pair = [_short(entry["limit_95"]), _short(float(np.linalg.norm(true)))]
                out.append([h.id, *(pair[::-1] if entry["parameter"] == "limit" else pair)])
    return out


def picked(seed: int, found) -> list[float]:
    """p-values of candidates of the first scan, drawn at random; of one column's own each."""
    known = found.details["found"]
    scans = known.scans if known else []
    if not scans:
        return []
    alive = [s for s in scans[0].scores if not s.dead and s.candidate.trials == 1]
    rng = np.random.default_rng([19, seed])
    some = rng.choice(len(alive), min(PICKED, len(alive)), replace=False)
    return [_short(alive[k].p) for k in some]


def rank(z: float) -> float:
    """Where a true value lies in its stated distribution, 0 to 1."""
    return float(norm.cdf(-z))


def _short(x: float) -> float:
    return float(f"{float(x):.4g}") if math.isfinite(x) else 9e99


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    return {k: [_short(x) for x in np.ravel(v)] if np.ndim(v) else _short(v)
            for k, v in values.items()}  # fmt: skip
