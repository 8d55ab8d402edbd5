"""`python -m tests.mutants [WORD ...]`: every mutant of the functions that a word names, or all."""

import sys
import time

from .equations import SAME, all_mutants
from .killing import Tried, named_checks, prepare, tried

KINDS = ("sign", "factor", "exponent", "function", "port")


def main(words: list[str]) -> int:
    """Prints survivors, a table by function, and the share; 1 where one survives."""
    began, results = time.perf_counter(), []
    for result in tried(all_mutants(words), prepare(named_checks())):
        results.append(result)
        if result.killer is None:
            mutant = result.mutant
            print(f"survives: {mutant.where} ({mutant.kind}): {mutant.text}", flush=True)
    print(table(results))
    killed, seconds = sum(r.killer is not None for r in results), time.perf_counter() - began
    share = 100 * killed / max(len(results), 1)
    print(f"{killed} of {len(results)} mutants killed: {share:.1f} % in {seconds:.0f} s")
    print(f"not tried, since they change nothing: {len(SAME)}")
    return int(killed < len(results))


def table(results: list[Tried]) -> str:
    """Killed of tried by function and kind, as Markdown."""
    lines = ["| equation | " + " | ".join(KINDS) + " |", "| --- |" + " --- |" * len(KINDS)]
    for where in sorted({r.mutant.where for r in results}):
        own = [r for r in results if r.mutant.where == where]
        cells = []
        for kind in KINDS:
            of = [r.killer is not None for r in own if r.mutant.kind == kind]
            cells.append(f"{sum(of)}/{len(of)}" if of else "")
        lines.append(f"| {where.removeprefix('omnijax.')} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
