"""`python -m tests.faults [PART ...]`: attack the commands and print the figures.

Parts: inputs, writes, flips, kills, interrupts, ports, memory; all of them where none is named.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from . import commands, flips, inputs, limits, processes, writes

Figures = tuple[int, list[str]]


def _inputs() -> Figures:
    wrong = [f"{c.name}: {said}" for c in inputs.cases() if (said := inputs.attack(c)) is not None]
    return len(inputs.cases()), wrong


def _writes() -> Figures:
    return writes.all_faults(writes.Disk())


STORE, ALL = commands.prepare_store, commands.prepare
PARTS: dict[str, tuple[str, Callable[[Path], None], Callable[[], Figures]]] = {
    "inputs": ("wrong inputs answered right", inputs.prepare, _inputs),
    "writes": ("failed writes answered right", STORE, _writes),
    "flips": ("bit flips noticed or without effect", STORE, lambda: flips.flips(200)),
    "kills": ("kills after which nothing was lost", STORE, lambda: processes.kills(24)),
    "interrupts": ("interrupts right", ALL, lambda: processes.interrupts(50)),
    "ports": ("commands that listen on the loopback alone", STORE, limits.ports),
    "memory": ("runs below 1 kB a sample", STORE, limits.memory),
}


def main() -> int:
    """The parts that are named, or all."""
    failed = False
    for part in sys.argv[1:] or PARTS:
        words, prepare, work = PARTS[part]
        began = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            prepare(Path(folder))
            count, wrong = work()
        for line in wrong:
            print(f"  {line}")
        seconds = time.monotonic() - began
        print(f"{part}: {count - len(wrong)} of {count} {words} ({seconds:.0f} s)", flush=True)
        failed = failed or bool(wrong)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
