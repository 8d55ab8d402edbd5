"""Put drawn axes to `omnijax case new` and the diagnosis, a line each.

    python -m benchmarks.axes --seeds 1-20 [--out FILE]     (1:20 is the same)

Seeds below 100 are for work; published figures come from seeds 100 and up.  Right means: every
hidden effect named, orders within 0.5 %, nothing else; or ambiguous with times that no one can
tell from the hidden one by these logs (`oracle.py`).
"""

import argparse
import contextlib
import io
import tempfile
import time
import traceback
from pathlib import Path

import jax
import numpy as np

from omnijax import cli
from omnijax.diagnosis import Diagnosis, diagnose

from .._lines import RESULTS, between, commit, rate, read, run
from .cases import IDS, Case, drawn, written
from .oracle import untold

ORDER = 5e-3  # of an order, that it may be off


def main() -> None:
    """Parse and do."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.axes", description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("--seeds", required=True, help="first-last, or one; those answered stay")
    parser.add_argument("--out", type=Path, default=RESULTS / "axes.jsonl")
    options = parser.parse_args()
    seeds = between(options.seeds.replace(":", "-"))
    lines = run(options.out, read(options.out), seeds, answered)
    print(table([x for x in lines if x["seed"] in seeds]))


def answered(seed: int) -> dict:
    """Draw the axis of a seed, put its files to the commands and compare."""
    case = drawn(seed)
    with tempfile.TemporaryDirectory() as folder:
        logs, here = written(Path(folder), case), Path(folder, "case")
        started = time.process_time()
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                ended = cli.run(["case", "new", *map(str, logs), "--out", str(here), "--yes"])
            if ended:
                raise RuntimeError(f"`case new` ended with {ended}")
            if case.machine:
                (here / "machine.toml").write_text(case.machine)
            found = diagnose(here)
        except Exception as error:  # a failure is an answer, and a wrong one
            traceback.print_exc()
            found = Diagnosis("failed", [], [], {}, None, [], {}, [], notes=[repr(error)])
        seconds = time.process_time() - started
    jax.clear_caches()  # programs of lengths and laws that no other case has: memory maps are few
    missed, false = compared(case, found)
    equal = untold(case, set(false)) if found.verdict == "ambiguous" else {}
    false = [x for x in false if x not in equal]
    verdict = "ambiguous" if equal else "named" if IDS[case.hidden] else "none"
    right = not missed and not false and found.verdict == verdict
    return {
        "seed": seed, "commit": commit(), "cpu": round(seconds, 1), "kind": case.plant.kind,
        "input": case.plant.drives, "rate": case.rate, "runs": len(logs), "held": case.held,
        "noise": case.noise, "file": "stated" if case.machine else "case new",
        "hidden": case.hidden, "share": round(case.share, 4), "shows": float(f"{case.shows:.3g}"),
        "verdict": found.verdict, "got": [[e.id, *_orders(e)] for e in found.effects],
        "right": right, "missed": missed, "false": false,
        "untold": {k: float(f"{x:.3g}") for k, x in equal.items()}, "why": found.notes[0][:160],
    }  # fmt: skip


def compared(case: Case, found: Diagnosis) -> tuple[list[str], list[str]]:
    """(hidden effects that were not named, names of what is not there)."""
    wanted, got = IDS[case.hidden], {e.id for e in found.effects}
    missed = [min(names) for names in wanted if not names & got]
    false = sorted(got - set().union(*wanted))
    seen = [n for e in found.effects for n in _orders(e) if e.id not in false]
    false += [f"order {n:.6g}" for n in seen if not _near(n, case.orders)]
    missed += [f"order {n:.6g}" for n in case.orders if seen and not _near(n, seen)]
    return missed, false


def _near(order: float, orders: list[float]) -> bool:
    return any(abs(order / x - 1) < ORDER for x in orders)


def _orders(effect) -> list[float]:
    said = [p["value"] for k, p in effect.parameters.items() if k in ("order", "orders")]
    return [float(f"{abs(x):.6g}") for values in said for x in np.atleast_1d(values)]


def table(lines: list[dict]) -> str:
    """Rates with exact 95 % intervals, and every answer that is not right."""
    hidden = [x for x in lines if x["hidden"] != "none"]
    rows = [
        "| figure | cases | 95 % interval |", "| --- | --- | --- |",
        rate("right", (x["right"] for x in lines)),
        rate("an effect hidden: right", (x["right"] for x in hidden)),
        rate("... that shows 1 sigma or more", (x["right"] for x in hidden if x["shows"] >= 1)),
        rate("nothing hidden: `none`", (x["right"] for x in lines if x["hidden"] == "none")),
        rate("named, and something of it false",
             (x["verdict"] == "named" and bool(x["false"]) for x in lines)),
        rate("ambiguous, what is hidden among the rivals",
             (x["verdict"] == "ambiguous" and not x["missed"] for x in hidden)),
    ]  # fmt: skip
    kinds = sorted({x["kind"] for x in lines})
    rows += [rate(f"{k}: right", (x["right"] for x in lines if x["kind"] == k)) for k in kinds]
    seconds = [x["cpu"] for x in lines]
    rows.append(f"| CPU s a case | median {np.median(seconds):.0f}, worst {max(seconds):.0f} | |")
    wrong = [
        f"- {x['seed']} {x['kind']}, {x['hidden']} (share {x['share']:.3g}, shows {x['shows']:.3g} "
        f"sigma): {x['verdict']} {' + '.join(e[0] for e in x['got'])}; missed "
        f"{', '.join(x['missed']) or 'nothing'}, false {', '.join(x['false']) or 'nothing'}"
        for x in lines if not x["right"]
    ]  # fmt: skip
    return "\n".join([*rows, "", *wrong])


if __name__ == "__main__":
    main()
