"""Run seeds, report a file of answers, vary the thresholds, or measure the limits' coverage.

    python -m benchmarks.hidden_effects run --seeds 0-99 [--kind none] [--out FILE]
    python -m benchmarks.hidden_effects report [--seeds 117-199] [--out FILE] [--write]
    python -m benchmarks.hidden_effects thresholds --seeds 0-9 [--only margin,alpha] [--out FILE]
    python -m benchmarks.hidden_effects coverage --seeds 1000-1003 [--count 150] [--out FILE]

Seeds below 100 are for work; published figures come from seeds 100 and up.
"""

import argparse
from pathlib import Path

from .._lines import RESULTS, between, read, run
from .._page import put
from . import coverage, thresholds
from .answers import answered
from .report import report


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
    parser.add_argument("--write", action="store_true", help="put the report into README.md")
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
        lines = run(path, lines, seeds, lambda seed: answered(seed, options.kind))
    elif options.seeds:
        lines = [x for x in lines if x["seed"] in seeds]
    text = report(lines) if lines else f"no answers in {path}"
    print(text)
    if options.write:
        if options.do != "report" or options.seeds or options.out or not lines:
            parser.error("--write is for a report of all published answers.")
        put("hidden effects", text)


if __name__ == "__main__":
    main()
