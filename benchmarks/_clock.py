"""Rows of the table: each tool of a task timed in turn, round after round, in CPU seconds."""

import functools
import resource
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

ACCURACY = 1e-4


class Tool(NamedTuple):
    """One way to do a task."""

    name: str
    run: Callable[[], Any]  # does the whole batch
    designs: int  # in the batch
    error: Callable[[Any], float | None]
    rounds: int = 5
    note: str = ""
    cold: bool = False  # timed without a run before it: what a first process costs


def loosest(
    name: str,
    run: Callable[[Any], Any],
    settings: Sequence[Any],
    designs: int,
    error: Callable[[Any], float],
    accuracy: float = ACCURACY,
    rounds: int = 3,
    note: str = "",
) -> Tool:
    """The tool at the cheapest of `settings` (cheapest first) whose error is within `accuracy`.

    Each is run until one reaches it; the note says which, and what the setting before it missed by.
    Where none does, the last stands, and its row says that it misses.  `note` holds one `{}`.
    """
    before = ""
    for setting in settings:
        reached = error(run(setting))
        text = note.format(setting)
        if reached <= accuracy or setting == settings[-1]:
            return Tool(
                name, functools.partial(run, setting), designs, error, rounds, text + before
            )
        before = f"; {note.format(setting).split(', ')[-1]} has {reached:.1e}"
    raise ValueError(f"{name}: no settings to try.")


def cpu_seconds() -> float:
    """CPU time of this process with all threads, and of its finished children."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def measure(task: str, tools: list[Tool], accuracy: float = ACCURACY) -> list[dict[str, Any]]:
    """One row a tool: median microseconds a design, error, what there is to say."""
    results = {tool.name: tool.run() for tool in tools if not tool.cold}  # compiles, warms up
    spent: dict[str, list[float]] = {tool.name: [] for tool in tools}
    for number in range(max(tool.rounds for tool in tools)):
        for tool in tools:
            if number < tool.rounds:
                start = cpu_seconds()
                results[tool.name] = tool.run()
                spent[tool.name].append(cpu_seconds() - start)
    rows = []
    for tool in tools:
        reached = tool.error(results[tool.name])
        missed = reached is not None and not reached <= accuracy
        note = "; ".join(x for x in (tool.note, f"misses {accuracy:g}" if missed else "") if x)
        rows.append(
            {
                "task": task,
                "tool": tool.name,
                "us_per_design": 1e6 * float(np.median(spent[tool.name])) / tool.designs,
                "error": reached,
                "designs": tool.designs,
                "rounds": tool.rounds,
                "note": note,
            }
        )
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown; ratios are to omnijax's first row of the same task."""
    lines = [
        "| task | tool | us/design | / omnijax | error | note |",
        "|---|---|---:|---:|---:|---|",
    ]
    ours: dict[str, float] = {}
    for row in rows:
        if row["tool"].startswith("omnijax"):
            ours.setdefault(row["task"], row["us_per_design"])
    for row in sorted(rows, key=lambda r: (r["task"], r["us_per_design"])):
        base = ours.get(row["task"])
        ratio = f"{row['us_per_design'] / base:.3g}" if base else ""
        found = "" if row["error"] is None else f"{row['error']:.1e}"
        cells = [row["task"], row["tool"], f"{row['us_per_design']:.4g}", ratio, found, row["note"]]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)
