"""Run seeds, report a file of answers, vary the thresholds, or measure the limits' coverage.

    python -m benchmarks.hidden_effects run --seeds 0-99 [--kind none] [--out FILE]
    python -m benchmarks.hidden_effects report [--seeds 117-199] [--out FILE]
    python -m benchmarks.hidden_effects thresholds --seeds 0-9 [--only margin,sure] [--out FILE]
    python -m benchmarks.hidden_effects coverage --seeds 1000-1003 [--count 150] [--out FILE]

Seeds below 100 are for work; published figures come from seeds 100 and up.
"""

import argparse
import json
from pathlib import Path

from . import coverage, thresholds
from .answers import answered
from .report import report

RESULTS = Path(__file__).parents[1] / "results"


def main() -> None:
    """Parse and do."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.hidden_effects", description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("do", choices=["run", "report", "thresholds", "coverage"])
    parser.add_argument("--seeds", help="first-last, or one; 0-99, of a report all")
    parser.add_argument("--kind", help="hide this kind whatever the seed draws")
    parser.add_argument("--only", help="thresholds to vary, by comma")
    parser.add_argument("--count", type=int, default=150, help="plants into every machine")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    own = options.do in ("thresholds", "coverage")
    path = options.out or RESULTS / (f"{options.do}.jsonl" if own else "hidden_effects.jsonl")
    lines, seeds = read(path), between(options.seeds or "0-99")
    if options.do == "coverage":
        lines += coverage.run(path, seeds, options.count)
        print(coverage.table(lines))
        return
    if options.do == "thresholds":
        names = options.only.split(",") if options.only else list(thresholds.VARIED)
        print(thresholds.table(thresholds.run(path, lines, seeds, names)))
        return
    if options.do == "run":
        lines = run(path, lines, seeds, options.kind)
    elif options.seeds:
        lines = [x for x in lines if x["seed"] in seeds]
    print(report(lines) if lines else f"no answers in {path}")


def between(seeds: str) -> range:
    """`7-9` or `7` as a range that holds its ends."""
    first, _, last = seeds.partition("-")
    return range(int(first), int(last or first) + 1)


def read(path: Path) -> list[dict]:
    """The answers in a file."""
    return [json.loads(x) for x in path.read_text().splitlines()] if path.exists() else []


def run(path: Path, lines: list[dict], seeds: range, kind: str | None) -> list[dict]:
    """Answer what is not answered yet, one line each."""
    have = {x["seed"] for x in lines}
    path.parent.mkdir(parents=True, exist_ok=True)
    for seed in seeds:
        if seed in have:
            continue
        try:
            line = answered(seed, kind)
        except RuntimeError as error:  # the plant, not the diagnosis
            print(f"seed {seed}: {error}", flush=True)
            continue
        print(json.dumps(line), flush=True)
        with path.open("a") as file:
            file.write(json.dumps(line) + "\n")
        lines.append(line)
    return lines


if __name__ == "__main__":
    main()
