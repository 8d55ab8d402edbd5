"""Answers of drawn cases as lines of JSON: seeds, files, rates."""

import json
import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path

from scipy.stats import binomtest

RESULTS = Path(__file__).parent / "results"
# chi2 by which a wrong law leads by chance at most 3e-4 of the time (two fits' gap is normal, of
# mean d^2 and variance 4 d^2)
TELLS = 12.0


def between(seeds: str) -> range:
    """`7-9` or `7` as a range that holds its ends."""
    first, _, last = seeds.partition("-")
    return range(int(first), int(last or first) + 1)


def read(path: Path) -> list[dict]:
    """The answers in a file."""
    return [json.loads(x) for x in path.read_text().splitlines()] if path.exists() else []


def run(path: Path, lines: list[dict], seeds: range, answered: Callable[[int], dict]) -> list[dict]:
    """Answer what is not answered yet, one line each; a plant that runs away is no case."""
    have = {x["seed"] for x in lines}
    path.parent.mkdir(parents=True, exist_ok=True)
    for seed in seeds:
        if seed in have:
            continue
        try:
            line = answered(seed)
        except RuntimeError as error:  # the plant, not the diagnosis
            print(f"seed {seed}: {error}", flush=True)
            continue
        print(json.dumps(line), flush=True)
        with path.open("a") as file:
            file.write(json.dumps(line) + "\n")
        lines.append(line)
    return lines


def commit() -> str:
    """Short hash of the tree that answers, with + where it was changed."""
    run = lambda *words: subprocess.run(  # noqa: E731
        ["git", *words], capture_output=True, text=True, check=True, cwd=Path(__file__).parent
    ).stdout.strip()
    changed = run("status", "--porcelain", "--", "../omnijax", "*.py")
    return run("rev-parse", "--short", "HEAD") + ("+" if changed else "")


def rate(words: str, hits: Iterable[bool]) -> str:
    """A row: how many of how many, with the exact (Clopper and Pearson) 95 % interval."""
    hits = list(hits)
    if not hits:
        return f"| {words} | 0/0 | |"
    low, high = binomtest(sum(hits), len(hits)).proportion_ci(0.95, "exact")
    percent = 100 * sum(hits) / len(hits)
    return (f"| {words} | {sum(hits)}/{len(hits)} ({percent:.0f} %) "
            f"| {100 * low:.0f} to {100 * high:.0f} % |")  # fmt: skip
