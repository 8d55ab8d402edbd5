"""The same sweep on an accelerator, in float64 and float32, and on all cores of its machine.

    python -m benchmarks.accelerator [--only RIG,...] [--gradient] [--designs N] [--cores N]

us a design of RMS and peak of 2 s with statuses, through `omnijax.simulation.modal_figures`, after
a first call that compiles.  On the cores, one process each works at its own designs, all at once.
Errors are the largest of any figure against float64 on a core; of statuses, those that differ.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from . import _problem as problem
from .__main__ import machine

Row = dict[str, Any]

DAMPING = 120.0
COMPARED = 1024  # designs
REPEATS = 5
RIGS = {"orthogonal": 0, "tripod": 3, "four": 4, "six": 6}  # unlike wheels, but for the first
SETTINGS = {"duration": problem.DURATION, "step": problem.STEP, "total": problem.MANY}


def _question(rig: str, designs: int, gradient: bool):
    """A function without arguments that answers."""
    from omnijax.simulation import modal_figures

    from . import _omnijax

    count = RIGS[rig]
    make, rows = _omnijax.design(count), problem.designs(designs, DAMPING)
    model = "coupled" if count else "paper"
    return lambda: modal_figures(
        make, rows, ("rms", "peak"), model=model, gradient=gradient, **SETTINGS
    )


def _child(order: dict[str, Any]) -> None:
    """Answer once, say `ready`, wait for a line, answer again and again, say how long each took."""
    import jax

    import omnijax

    assert omnijax.simulate  # which sets float64
    jax.config.update("jax_enable_x64", order["precision"] == "float64")
    ask = _question(order["rig"], order["designs"], order["gradient"])
    start = time.perf_counter()
    answer = ask()
    first = time.perf_counter() - start
    values = answer.values if answer.slopes is None else answer.slopes.reshape(len(answer.held), -1)
    signs = np.stack([answer.normal > 0, answer.slip > 0, answer.held], 1)
    if order["file"]:
        np.savez(order["file"], values=values[:COMPARED], signs=signs[:COMPARED])
    print("ready", flush=True)
    sys.stdin.readline()
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        ask()
        times.append(time.perf_counter() - start)
    device = jax.devices()[0]
    memory = (device.memory_stats() or {}).get("peak_bytes_in_use", 0)
    said = {"first": first, "times": times, "device": device.device_kind, "memory": memory}
    print(json.dumps(said), flush=True)


def _asked(order: dict[str, Any], processes: int, cpu: bool) -> list[dict[str, Any]]:
    """What so many processes answer that work at the same time."""
    command = [sys.executable, "-m", "benchmarks.accelerator", "--child"]
    environment = os.environ | {"OMP_NUM_THREADS": "1"} | ({"JAX_PLATFORMS": "cpu"} if cpu else {})
    children: list[subprocess.Popen[str]] = []
    for _ in range(processes):
        own = order | {"file": "" if children else order["file"]}
        child = subprocess.Popen(
            [*command, json.dumps(own)], env=environment, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip
        if not children:
            _ready(child)  # the others find its programs
        children.append(child)
    for child in children[1:]:
        _ready(child)
    for child in children:
        assert child.stdin is not None
        child.stdin.write("go\n")
        child.stdin.flush()
    return [json.loads(child.communicate()[0]) for child in children]


def _ready(child: "subprocess.Popen[str]") -> None:
    assert child.stdout is not None
    if child.stdout.readline().strip() != "ready":
        raise SystemExit("A process ended before it was ready; see above.")


def rows_of(rig: str, gradient: bool, designs: int, cores: int, folder: Path) -> Iterator[Row]:
    """One row each for all cores and, where there is one, an accelerator."""
    expected: Any = None
    ways = [
        (True, "float64"),
        *([(False, "float64"), (False, "float32")] if _accelerated() else []),
    ]
    for cpu, precision in ways:
        file = folder / "answer.npz"
        order = {"rig": rig, "gradient": gradient, "designs": designs, "precision": precision}
        answers = _asked(order | {"file": str(file)}, cores if cpu else 1, cpu)
        with np.load(file) as answer:
            values, signs = answer["values"], answer["signs"]
        expected = (values, signs) if expected is None else expected
        last = [max(times) for times in zip(*(x["times"] for x in answers), strict=True)]
        scale = np.abs(expected[0]).max(axis=0) if gradient else np.abs(expected[0])
        yield {
            "rig": rig,
            "asked": "with gradients" if gradient else "values",
            "on": f"{len(answers)} cores" if cpu else answers[0]["device"],
            "precision": precision,
            "us": statistics.median(last) / (len(answers) * designs) * 1e6,
            "first_s": answers[0]["first"],
            "memory_gib": answers[0]["memory"] / 2**30,
            "error": float(np.max(np.abs(values - expected[0]) / scale)),
            "other_statuses": int(np.sum(np.any(signs != expected[1], axis=1))),
        }


def _accelerated() -> bool:
    """Whether jax has more than a CPU here; asked in a process of its own, which lets go of it."""
    code = "import jax; print(jax.default_backend())"
    made = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return made.stdout.split()[-1] != "cpu"


def main(words: list[str] | None = None) -> int:
    """Measure and print."""
    head = (__doc__ or "").splitlines()[0]
    parser = argparse.ArgumentParser(prog="python -m benchmarks.accelerator", description=head)
    parser.add_argument("--only", default=",".join(RIGS), help=f"of: {', '.join(RIGS)}")
    parser.add_argument("--designs", type=int, default=65536, help="a process")
    parser.add_argument("--cores", type=int, default=os.cpu_count(), help="processes on CPUs")
    parser.add_argument("--gradient", action="store_true", help="with derivatives in four numbers")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows there too")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    options = parser.parse_args(words)
    if options.child:
        _child(json.loads(options.child))
        return 0
    wanted = options.only.split(",")
    if unknown := [rig for rig in wanted if rig not in RIGS]:
        parser.error(f"no such rig: {', '.join(unknown)}; there are {', '.join(RIGS)}.")
    rows = []
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        for rig in wanted:
            for row in rows_of(rig, options.gradient, options.designs, options.cores, Path(folder)):
                print(
                    f"{row['rig']:10} {row['asked']:14} {row['on']:16} {row['precision']:8}"
                    f"{row['us']:9.3f} us a design, error {row['error']:.1e}, "
                    f"{row['other_statuses']} other statuses, first call {row['first_s']:.1f} s, "
                    f"{row['memory_gib']:.2f} GiB",
                    flush=True,
                )
                rows.append(row)
                if options.json:
                    options.json.write_text(json.dumps({"machine": machine(), "rows": rows}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
