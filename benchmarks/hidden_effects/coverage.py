"""How often a planted effect lies below its 95 % limit: many plants from one converged fit.

A machine with nothing hidden is drawn, recorded and calibrated as in `cases`.  Then, a thousand
times cheaper than as many diagnoses: an effect of a size beyond what noise alone excludes is
simulated into the prediction, white noise is drawn anew for every row, and the limit is taken from
the scan as the diagnosis takes it.  So the law's own nonlinearity, the other candidates' and the
baseline's freedom count; a wrongly known noise, and a baseline that is far from linear, do not.
Smaller sizes lie below their limits always: an estimate below zero excludes no more than zero.
"""

import dataclasses
import json
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.stats import beta

from omnijax.diagnosis import Effect, Point, Search, diagnose, refit
from omnijax.diagnosis._search import upper_limits

from .._lines import commit
from .cases import drawn, recorded, written

SIZES = (1.05, 2.5)  # times the limit of a recording of nothing but the prediction


def run(path: Path, seeds: range, count: int) -> list[dict]:
    """`count` plants into the machine of every seed, a line each."""
    lines = []
    path.parent.mkdir(parents=True, exist_ok=True)
    for seed in seeds:
        for line in planted(seed, count):
            with path.open("a") as file:
                file.write(json.dumps(line) + "\n")
            lines.append(line)
    return lines


def planted(seed: int, count: int) -> Iterator[dict]:
    """Plants into one machine: what, how large, and the limit that came out."""
    model, point = _calibrated(seed)
    fit = refit(model, point)
    scan, signatures = Search(model).scan(fit)
    still = dataclasses.replace(fit, residual=0 * fit.residual)
    floor = {
        (x["id"], x["place"]): (x["limit_95"], x["parameter"])
        for x in upper_limits(model, still, signatures, set())
    }
    rng = np.random.default_rng([20, seed])
    names = [n for n, (limit, key) in floor.items() if limit and key not in ("share", "limit")]
    by_name = defaultdict(list)
    for c in (s.candidate for s in scan.scores):
        by_name[c.id, c.place].append(c)
    (before,), here = model.residuals([fit.point], "train"), commit()
    for name in (names[k] for k in rng.integers(len(names), size=count)):
        size = floor[name][0] * rng.uniform(*SIZES)
        effect = _effect(rng, by_name[name], floor[name][1], size)
        (after,) = model.residuals([fit.point.with_effects(effect)], "train")
        if not np.all(np.isfinite(after)):
            continue  # it runs away: not a case
        shown = dataclasses.replace(fit, residual=_noise(rng, model) + before - after)
        found = upper_limits(model, shown, signatures, set())
        limit = next(x["limit_95"] for x in found if (x["id"], x["place"]) == name)
        yield {"seed": seed, "commit": here, "id": effect.id, "place": effect.place,
               "size": float(f"{size:.4g}"),
               "limit": None if limit is None else float(f"{limit:.4g}")}  # fmt: skip


def _calibrated(seed: int) -> tuple:
    """Model of a healthy machine's recording, and its calibrated point."""
    case = drawn(seed, "none")
    tables, _ = recorded(case, [])
    with tempfile.TemporaryDirectory() as folder:
        written(Path(folder), case, [], tables)
        details = diagnose(folder).details
    model, point = details["model"], Point(details["found"].baseline.point.u)
    model.rebase(point)
    return model, point


def _effect(rng, variants: list, key: str, size: float) -> Effect:
    """One of an effect's variants in a random direction, of size `size`."""
    c = variants[rng.integers(len(variants))]
    way = rng.normal(size=len(c.columns))
    way = way if c.allowed(way) else -way
    now = float(np.linalg.norm(c.decode(way)[key]))
    values = c.decode(way * size / now)  # of an offset and a slope both, say
    if not np.isclose(np.linalg.norm(values[key]), size):  # a threshold is no multiple of one
        values = values | {key: np.asarray(values[key]) * size / now}
    return Effect(c.id, c.place, values)


def _noise(rng, model) -> np.ndarray:
    """White noise of unit level in every row that was measured, nuisance directions taken off."""
    out = []
    for i in model.splits["train"]:
        rows = model.machine.rows[i]
        weight = np.concatenate([rows.elastic.ravel(), rows.rotation.ravel()])
        x = rng.normal(size=rows.size) * (weight > 0)
        for part, q in rows.nuisance:
            x[part] -= q @ (x[part] @ q)
        out.append(x)
    return np.concatenate(out)


def table(lines: list[dict]) -> str:
    """Coverage of all plants and by effect, with exact intervals."""
    groups = defaultdict(list)
    for x in lines:
        if x["limit"] is not None:
            groups["all effects"].append(x["size"] < x["limit"])
            groups[f"`{x['id']}`"].append(x["size"] < x["limit"])
    out = ["| effect | below its limit | 95 % |", "| --- | --- | --- |"]
    for name in sorted(groups, key=lambda n: (n != "all effects", n)):
        n, k = len(groups[name]), sum(groups[name])
        low = beta.ppf(0.025, k, n - k + 1) if k else 0.0
        high = beta.ppf(0.975, k + 1, n - k) if k < n else 1.0
        out.append(f"| {name} | {k}/{n} ({100 * k / n:.1f} %) | {100 * low:.0f} to "
                   f"{100 * high:.0f} % |")  # fmt: skip
    return "\n".join(out)
