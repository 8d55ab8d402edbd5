"""All tasks in one run, on one core, into one table."""

import argparse
import datetime
import json
import os
import platform
import sys
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version

from ._page import put

TASKS = {
    "transient C=120": ("transient", (120.0,), 1e-4),
    "transient C=8500": ("transient", (8500.0,), 1e-4),
    "transient C=20000": ("transient", (20000.0,), 1e-4),
    "general tripod": ("general", (3,), 1e-4),
    "general four": ("general", (4,), 1e-4),
    "general six": ("general", (6,), 1e-4),
    "transient-gradient": ("gradient", (0,), 1e-4),
    "general-gradient tripod": ("gradient", (3,), 1e-4),
    "steady": ("steady", (0,), 1e-6),
    "steady tripod": ("steady", (3,), 1e-6),
    "tables tripod": ("tables", (3, "transient"), 1e-4),
    "tables-gradient tripod": ("tables", (3, "gradient"), 1e-4),
    "tables-steady tripod": ("tables", (3, "steady"), 1e-6),
    "dynamics": ("dynamics", (), 1e-4),
    "machine tripod": ("machine", (3, 0.0), 1e-4),
    "machine four, play": ("machine", (4, 2e-6), 1e-4),
    "cold": ("cold", (), 1e-4),
}
PACKAGES = ["jax", "jaxlib", "diffrax", "equinox", "numpy", "scipy", "numba", "casadi"]


def machine() -> str:
    """Processor and versions."""
    name = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo") as file:
            name = next(line.split(":")[1].strip() for line in file if "model name" in line)
    except OSError:
        pass
    versions = []
    for package in PACKAGES:
        try:
            versions.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            continue
    load = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    return f"{name}, {load}, Python {platform.python_version()}, {', '.join(versions)}"


def main() -> int:
    """Run, print, and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--json", metavar="FILE", help="write the rows there")
    parser.add_argument(
        "--write", action="store_true", help="put the table into README.md (all tasks only)"
    )
    parser.add_argument("--only", default="", help=f"of: {', '.join(TASKS)} (beginnings will do)")
    arguments = parser.parse_args()
    wanted = [x for x in arguments.only.split(",") if x]
    unknown = [x for x in wanted if not any(task.startswith(x) for task in TASKS)]
    if unknown:
        parser.error(f"no such task: {', '.join(unknown)}; there are {', '.join(TASKS)}.")
    if arguments.write and wanted:
        parser.error("--write is for a table of all tasks from one run: leave --only out.")
    _one_core()
    from ._clock import measure, table

    rows = []
    for task, (module, extra, accuracy) in TASKS.items():
        if wanted and not any(task.startswith(x) for x in wanted):
            continue

        def skip(what, task=task):
            print(f"{task}: skipping {what}", file=sys.stderr, flush=True)

        print(f"{task} …", file=sys.stderr, flush=True)
        tools = import_module(f".{module}", __package__).tools(*extra, skip)
        rows += measure(task, tools, accuracy)
    text = f"{machine()}\n\n{table(rows)}"
    print(text)
    if arguments.write:
        put("table", f"{datetime.date.today()}: {text}")
    if arguments.json:
        with open(arguments.json, "w") as file:
            json.dump({"machine": machine(), "rows": rows}, file, indent=1)
    return 0


def _one_core() -> None:
    """One core and one thread, before anything numerical is imported."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    flags = os.environ.get("XLA_FLAGS", "")
    os.environ["XLA_FLAGS"] = f"{flags} --xla_cpu_multi_thread_eigen=false".strip()
    import omnijax

    assert omnijax.simulate  # float64 and the compilation cache are set with the first of its names


if __name__ == "__main__":
    sys.exit(main())
