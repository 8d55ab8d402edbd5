"""How far does a sweep scale?  Measures what a chunk costs beside its designs; predicts the rest.

    python -m benchmarks.scaling [--json FILE] [--designs 1e9] [--us-per-design X]

Measured on the machine at hand, in seconds (CPU time, of the store wall time):

    design    one design, in batches, on one device (t)
    points    values of a chunk's designs        = a + b x designs
    store     writing a chunk's region           = a + b x designs (p: the sum of both a, b)
    task      what Dask's scheduler and client, in one process, spend on one task (s)

Predicted for W workers and N designs in chunks of c: each worker has ceil(N / c / W) chunks of
c t + p seconds; the one scheduler needs (N / c) s, the one store at most (N / c) p_store where it
takes one writer at a time (a shared disk takes more: this is the worst case).  The largest of the
three is the time, and efficiency is N t / (W x time).
"""

import argparse
import json
import math
import platform
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

WORKERS = (1, 10, 100, 1000)
CHUNKS = (512, 2048, 8192, 32768, 131072, 524288)
VARY = {"wheel.roundness": "0.1:0.6", "contact.stiffness": "log:5e4:1e6"}
QUESTION = {"speeds": (0.1, 1.2, 0.3), "sampler": "lhs", "metrics": ("peak", "rms")}


def _clock(f, repeat: int = 5, clock=time.process_time) -> float:
    """Least time of `f()`: what the work takes where nothing else is in the way."""
    times = []
    for _ in range(repeat):
        start = clock()
        f()
        times.append(clock() - start)
    return min(times)


def _affine(sizes, seconds) -> tuple[float, float]:
    """(a, b) of a + b x size, both at least 0."""
    b, a = np.polyfit(sizes, seconds, 1)
    return max(float(a), 0.0), max(float(b), 0.0)


def measure_design(duration: float | None) -> dict[str, Any]:
    """Seconds a design, and how it is evaluated."""
    from omnijax import sweep
    from omnijax.study import Evaluator

    result = sweep("atlas", VARY, samples=1, duration=duration, **QUESTION)
    evaluator = Evaluator(result.spec)
    batch = result.spec.batch
    index = np.zeros(batch, int)
    seconds = _clock(lambda: evaluator.designs(index), 3)
    return {"seconds": seconds / batch, "method": result.spec.method, "batch": batch}


def measure_chunk(folder: Path) -> dict[str, tuple[float, float]]:
    """Affine costs of a chunk's points and of its region in the store."""
    import dataclasses

    from omnijax import sweep
    from omnijax.study._sweep.evaluator import quantities
    from omnijax.study._sweep.store import create_store

    spec = sweep("atlas", VARY, samples=1, **QUESTION).spec
    points, store, sizes = [], [], (1024, 8192, 65536)
    for size in sizes:
        here = dataclasses.replace(spec, samples=size, chunk=size)
        index = np.arange(size)
        points.append(_clock(lambda p=here.points, i=index: p.at(i)))
        target = create_store(folder / f"{size}.zarr", here, quantities(here), {})
        values, status = np.random.default_rng(0).random(size), np.zeros(size, np.int8)
        columns = {n: status if n == "status" else values for n in target.names}
        store.append(_clock(lambda t=target, c=columns: t.write(0, c), clock=time.perf_counter))
    return {"points": _affine(sizes, points), "store": _affine(sizes, store)}


def _nothing(_: int) -> np.ndarray:
    return np.zeros(1, np.int8)


def measure_task(tasks: int = 2000) -> float | None:
    """CPU seconds of scheduler and client a task, workers apart; None without Dask."""
    try:
        from distributed import Client, LocalCluster, as_completed
    except ImportError:
        print("Dask is not installed: pip install 'omnijax[distributed]'; 1 ms a task is assumed.")
        return None
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
        Client(cluster) as client,
    ):
        client.gather(client.map(_nothing, range(100), pure=False))
        start, waiting = time.process_time(), iter(range(tasks))
        queue = as_completed([client.submit(_nothing, next(waiting), pure=False) for _ in range(8)])
        for future in queue:  # as a sweep does: a window of tasks, one more for each that ends
            future.result()
            following = next(waiting, None)
            if following is not None:
                queue.add(client.submit(_nothing, following, pure=False))
        return (time.process_time() - start) / tasks


def predict(costs: dict[str, float], designs: float, workers: int, chunk: int) -> dict[str, float]:
    """Wall time and efficiency, and which of workers, scheduler and store sets them."""
    chunks = math.ceil(designs / chunk)
    evaluate = chunk * costs["design"]
    around = costs["fixed"] + chunk * costs["each"]
    turns = math.ceil(chunks / workers)
    limits = {
        "workers": turns * (evaluate + around),
        "scheduler": chunks * costs["task"],
        "store": chunks * (costs["store_fixed"] + chunk * costs["store_each"]),
    }
    limit = max(limits, key=lambda k: limits[k])
    seconds = limits[limit]
    efficiency = designs * costs["design"] / (workers * seconds)
    return {"seconds": seconds, "efficiency": efficiency, "limit": limit}  # pyright: ignore


def bounds(costs: dict[str, float], workers: int) -> dict[str, float]:
    """Chunk below which the scheduler, or the store, is slower than the workers."""
    spare = costs["design"] + costs["each"]
    task = (workers * costs["task"] - costs["fixed"]) / spare
    left = spare - workers * costs["store_each"]  # what a design leaves beside its bytes
    fixed = workers * costs["store_fixed"] - costs["fixed"]
    store = fixed / left if left > 0 else math.inf
    return {"scheduler": max(task, 0.0), "store": max(store, 0.0)}


def measure(duration: float | None, seconds: float | None) -> dict[str, Any]:
    """All costs, in seconds."""
    design = {"seconds": seconds, "method": "given", "batch": 0}
    if seconds is None:
        design = measure_design(duration)
    with tempfile.TemporaryDirectory() as folder:
        chunk = measure_chunk(Path(folder))
    task = measure_task()
    (pa, pb), (sa, sb) = chunk["points"], chunk["store"]
    return {
        "design": design["seconds"],
        "method": design["method"],
        "batch": design["batch"],
        "fixed": pa + sa,
        "each": pb + sb,
        "store_fixed": sa,
        "store_each": sb,
        "task": 1e-3 if task is None else task,
    }


def show(costs: dict[str, Any], designs: float) -> list[dict[str, Any]]:
    """Print costs and predictions; the rows."""
    us = {k: 1e6 * costs[k] for k in ("design", "fixed", "each", "store_fixed", "task")}
    print(f"{platform.processor() or platform.machine()}, Python {platform.python_version()}")
    print(f"design ({costs['method']}, batches of {costs['batch']}): {us['design']:.1f} us")
    print(f"chunk: {us['fixed']:.0f} us + {us['each']:.3f} us a design beside the evaluation")
    print(f"  of it the store: {us['store_fixed']:.0f} us + {1e6 * costs['store_each']:.3f} us")
    print(f"scheduler: {us['task']:.0f} us a task")
    rows = []
    print(f"\n{designs:.0e} designs: efficiency (time), s: scheduler, f: store limits")
    print("workers " + "".join(f"{f'chunk {c}':>20}" for c in CHUNKS))
    for workers in WORKERS:
        cells = []
        for chunk in CHUNKS:
            found = predict(costs, designs, workers, chunk)
            rows.append({"workers": workers, "chunk": chunk, "designs": designs, **found})
            mark = {"workers": " ", "scheduler": "s", "store": "f"}[found["limit"]]  # pyright: ignore
            cells.append(f"{found['efficiency']:8.1%} ({_hours(found['seconds']):>7}){mark}")
        print(f"{workers:7d} " + "".join(f"{cell:>20}" for cell in cells))
    for workers in WORKERS:
        b = bounds(costs, workers)
        print(
            f"{workers} workers: the scheduler is the limit below {b['scheduler']:.0f} designs a "
            f"chunk, a store with one writer at a time {_count(b['store'])}"
        )
    total = designs * (costs["design"] + costs["each"]) / 3600
    print(f"{designs:.0e} designs cost {total:.3g} core hours.")
    return rows


def _hours(seconds: float) -> str:
    for size, unit in ((86400, "d"), (3600, "h"), (60, "min")):
        if seconds >= size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.1f} s"


def _count(x: float) -> str:
    return "at any size" if math.isinf(x) else f"below {x:.0f}"


def main(words: list[str] | None = None) -> int:
    """Measure, predict, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", type=Path, help="write costs and predictions to this file")
    parser.add_argument("--designs", type=float, default=1e9)
    parser.add_argument("--duration", type=float, help="runs of this length in s (else steady)")
    parser.add_argument("--us-per-design", type=float, help="take this figure, measure the rest")
    options = parser.parse_args(words)
    given = None if options.us_per_design is None else options.us_per_design * 1e-6
    costs = measure(options.duration, given)
    rows = show(costs, options.designs)
    if options.json:
        options.json.write_text(json.dumps({"costs": costs, "rows": rows}, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
