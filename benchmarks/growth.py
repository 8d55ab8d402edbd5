"""Does a sweep of many designs need more memory, or more time a design, than one of few?

    python -m benchmarks.growth [--designs 1e4,1e6] [--json FILE]

Each size runs in a process of its own and writes a store: runs of 2 s of the Atlas rig over
roundness, stiffness and damping, Latin hypercube.  A first sweep compiles; counted is
the CPU time of a later one, with planning and store (short ones several times, their median), and
the largest resident memory.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

SWEEP = {
    "vary": {
        "wheel.roundness": "0.1:0.6",
        "contact.stiffness": "log:5e4:1e6",
        "contact.damping": "0:20000",
    },
    "speeds": (0.1, 1.2, 0.3),
    "duration": 2.0,
    "sampler": "lhs",
    "chunk": 16384,
}


LONG = 100_000  # designs: a sweep of fewer is timed several times


def one(designs: int, folder: Path) -> dict[str, Any]:
    """CPU seconds, largest memory and statuses of a sweep of `designs`, in this process."""
    import time

    from omnijax import sweep

    first = designs if designs > LONG else 64  # many designs have programs of their own
    sweep("atlas", samples=first, out=folder / "first.zarr", **SWEEP)  # pyright: ignore
    spent = []
    for turn in range(min(max(LONG // designs, 1), 7)):
        start = time.process_time()
        result = sweep("atlas", samples=designs, out=folder / f"{turn}.zarr", **SWEEP)  # pyright: ignore
        spent.append(time.process_time() - start)
    return {
        "designs": designs,
        "us_per_design": 1e6 * statistics.median(spent) / designs,
        "memory_mb": _largest_memory(),
        "status": result.counts(),
    }


def _largest_memory() -> float:
    """Resident memory at its largest, MB (Linux: of this program, not of its parent)."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


def measure(sizes: list[int]) -> list[dict[str, Any]]:
    """A row a size, each from a process of its own."""
    environment = {"XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false", **os.environ}
    rows = []
    for size in sizes:
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-m", "benchmarks.growth", "--one", str(size), folder]
            text = subprocess.run(
                command, capture_output=True, text=True, check=True, env=environment
            ).stdout
        rows.append(json.loads(text.splitlines()[-1]))
        print(_line(rows[-1]), flush=True)
    return rows


def _line(row: dict[str, Any]) -> str:
    statuses = ", ".join(f"{n} {name}" for name, n in row["status"].items())
    return (
        f"{row['designs']} designs: {row['us_per_design']:.2f} us a design, "
        f"{row['memory_mb']:.0f} MB; {statuses}"
    )


def main() -> int:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--designs", default="1e4,1e6", help="numbers of designs")
    parser.add_argument("--json", type=Path, help="write the rows to this file")
    parser.add_argument("--one", nargs=2, metavar=("N", "FOLDER"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(one(int(options.one[0]), Path(options.one[1]))))
        return 0
    rows = measure([int(float(n)) for n in options.designs.split(",")])
    first, last = rows[0], rows[-1]
    memory = last["memory_mb"] / first["memory_mb"]
    speed = first["us_per_design"] / last["us_per_design"]
    print(f"memory {memory:.3f} times, designs a second {speed:.3f} times those of the first")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
