"""What hangs on the thresholds of the search: each halved and doubled, the same cases again."""

import contextlib
import dataclasses
import json
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

from omnijax.diagnosis import AbstractModel, diagnose
from omnijax.diagnosis._settings import SETTINGS

from .._lines import commit
from .answers import right
from .cases import drawn, recorded, sized, written

VARIED = ("alpha", "sure_sigmas", "size_factor", "margin", "material_change", "column_price",
          "runner_up_cost", "near_noise", "hopeless_cost", "noise_share", "strong_misfit",
          "promise_share", "least_closed", "near_margin", "like_gain")  # fmt: skip
BOUNDED = {"size_factor": (1.05, None), "runner_up_cost": (1.0, None),
           "near_noise": (1.0, None), "hopeless_cost": (1.0, None),
           "like_gain": (None, 1.0), "promise_share": (None, 1.0)}  # fmt: skip


@contextlib.contextmanager
def varied(name: str, factor: float) -> Iterator[float]:
    """Every model's settings with one of them times `factor`, within where it has a meaning."""
    low, high = BOUNDED.get(name, (None, None))
    value = getattr(SETTINGS.search, name) * factor
    value = value if low is None else max(low, value)
    value = value if high is None else min(high, value)
    AbstractModel.settings = dataclasses.replace(SETTINGS.search, **{name: value})
    try:
        yield value
    finally:
        AbstractModel.settings = SETTINGS.search


def run(path: Path, lines: list[dict], seeds: range, names: Sequence[str]) -> list[dict]:
    """Answers that are missing in `lines`: the case of every seed as it is, and varied."""
    have = {(x["seed"], x["threshold"], x["factor"]) for x in lines}
    wanted = [("", 1.0), *((name, factor) for name in names for factor in (0.5, 2.0))]
    path.parent.mkdir(parents=True, exist_ok=True)
    for seed in seeds:
        missing = [w for w in wanted if (seed, *w) not in have]
        if not missing:
            continue
        case = drawn(seed)
        sizes = sized(case)
        tables, _ = recorded(case, sizes)
        with tempfile.TemporaryDirectory() as folder:
            written(Path(folder), case, sizes, tables)
            for name, factor in missing:
                with varied(name, factor) if name else contextlib.nullcontext(1.0) as value:
                    found = diagnose(folder)
                line = {"seed": seed, "kind": case.kind, "commit": commit(), "threshold": name,
                        "factor": factor, "value": value, "verdict": found.verdict,
                        "got": sorted([e.id, e.place] for e in found.effects),
                        "right": right(case, found)}  # fmt: skip
                print(json.dumps(line), flush=True)
                with path.open("a") as file:
                    file.write(json.dumps(line) + "\n")
                lines.append(line)
    return lines


def table(lines: list[dict]) -> str:
    """By threshold: its value, the cases, and how many answers are right and changed."""
    plain = {x["seed"]: x for x in lines if not x["threshold"]}
    groups = defaultdict(list)
    for x in lines:
        if x["threshold"] and x["seed"] in plain:
            groups[x["threshold"], x["factor"]].append(x)
    out = ["| threshold | value | cases | right, was | right, now | other answers |",
           "| --- | --- | --- | --- | --- | --- |"]  # fmt: skip
    for (name, _), some in groups.items():
        before = [plain[x["seed"]] for x in some]
        moved = sum((a["verdict"], a["got"]) != (b["verdict"], b["got"])
                    for a, b in zip(some, before, strict=True))  # fmt: skip
        was, now = sum(b["right"] for b in before), sum(x["right"] for x in some)
        value = f"{getattr(SETTINGS.search, name):g} -> {some[0]['value']:g}"
        out.append(f"| `{name}` | {value} | {len(some)} | {was} | {now} | {moved} |")
    return "\n".join(out)
