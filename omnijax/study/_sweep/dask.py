"""Chunks of a sweep as tasks of a Dask cluster; the result of a task is its region of the store.

Only the store's folder and a chunk's number travel, so every worker must see the folder.  Workers
are started by `spawn` (JAX deadlocks after `fork`).  A worker that dies costs the chunk it was in:
Dask gives it to another one.
"""

import functools
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import InputError, RunError, require
from ...rig import whole_number
from .evaluator import Evaluator
from .store import Store, open_store

WINDOW = 4  # chunks handed out ahead, a thread of the cluster
REACH = 10  # s to wait for a scheduler
PATIENCE = 30.0  # s to wait for a worker, the first one or another where all are gone


def run_chunk(folder: str, chunk: int) -> np.ndarray:
    """Evaluate one chunk and write it; the status of its designs."""
    store, evaluator = _prepared(folder)
    columns = evaluator.designs(np.arange(*store.bounds(chunk)))
    store.write(chunk, columns)
    return columns["status"]


@functools.lru_cache(maxsize=2)
def _prepared(folder: str) -> tuple[Store, Evaluator]:
    store = open_store(folder)
    return store, Evaluator(store.spec)


def over_cluster(
    store: Store, workers: int | None, scheduler: str | None
) -> Iterator[tuple[int, np.ndarray]]:
    """Evaluate the missing chunks on a cluster, in the order in which they finish."""
    return _finished(store, workers, scheduler)


def check_cluster(workers: int | None, scheduler: str | None) -> None:
    """`InputError` for a cluster that there cannot be."""
    if workers is not None and scheduler is not None:
        raise InputError("give `workers` for a local cluster or `scheduler` for another, not both.")
    if workers is not None:
        whole_number("workers", workers)
    if workers is not None or scheduler is not None:
        require("distributed", "distributed")


def _finished(store: Store, workers: int | None, scheduler: str | None):
    with _cluster(workers, scheduler) as client:
        try:
            yield from _hand_out(client, store)
        except CancelledError:
            raise RunError(_left_alone("its scheduler has gone")) from None


def _cluster(workers: int | None, scheduler: str | None) -> Any:
    """A client, of a new local cluster or of the one at an address."""
    import logging

    from dask import config
    from distributed import Client, LocalCluster

    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=REACH, set_as_default=False)
        except (OSError, ValueError, TypeError, ImportError) as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise InputError(f"the scheduler {scheduler} cannot be reached: {reason}") from None
        if not _has_worker(client):
            client.close()
            raise InputError(f"the scheduler {scheduler} has no workers.")
        return client
    config.set({"distributed.worker.multiprocessing-method": "spawn"})
    cluster = _deaf_to_interrupts(
        lambda: LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address="127.0.0.1:0",  # never on all interfaces
            host="127.0.0.1",
            silence_logs=logging.CRITICAL,
        )
    )
    return _Owned(cluster, Client(cluster, set_as_default=False))


def _deaf_to_interrupts(make: Callable[[], Any]) -> Any:
    """What `make` returns, called in a thread whose processes do not hear Ctrl-C.

    A terminal sends it to all; this process answers it, and ends the others.
    """
    import signal
    import threading
    from multiprocessing import resource_tracker

    if not hasattr(signal, "pthread_sigmask"):
        return make()
    resource_tracker.ensure_running()  # its start would take the mask off again
    future: Future[Any] = Future()

    def masked() -> None:
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            future.set_result(make())
        except BaseException as error:
            future.set_exception(error)

    threading.Thread(target=masked, daemon=True).start()
    return future.result()


class _Owned:
    """A local cluster and its client, closed together."""

    def __init__(self, cluster: Any, client: Any):
        self.cluster, self.client = cluster, client

    def __enter__(self) -> Any:
        return self.client

    def __exit__(self, *_: object) -> None:
        self.client.close()
        self.cluster.close()


def _has_worker(client: Any) -> bool:
    """Whether there is a worker, or one comes."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        return False
    return True


def _hand_out(client: Any, store: Store) -> Iterator[tuple[int, np.ndarray]]:
    """Keep a window of chunks in flight, so that a billion designs do not queue at once."""
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    folder = str(Path(store.folder or ".").resolve())
    waiting = iter(np.flatnonzero(~store.done()).tolist())
    threads = sum(client.nthreads().values())
    running: dict[Any, int] = {}
    lost: list[int] = []

    def ending() -> Any:
        return as_completed(running, loop=client.loop, timeout=PATIENCE)

    def submit() -> None:
        chunk = next(waiting, None)
        if chunk is not None:
            future = client.submit(run_chunk, folder, chunk, pure=False)
            running[future] = chunk
            queue.add(future)

    queue = ending()
    for _ in range(max(WINDOW * threads, WINDOW)):
        submit()
    while running:
        try:
            future = next(queue)
        except TimeoutError:  # long chunks, or nobody works
            if not _has_worker(client):
                raise RunError(_left_alone("all of its workers have gone")) from None
            queue = ending()
            continue
        chunk = running.pop(future)
        submit()
        try:
            status = future.result()
        except KilledWorker:
            lost.append(chunk)
            continue
        yield chunk, status
    if lost:
        raise RunError(_lost(store, lost))


def _left_alone(why: str) -> str:
    return f"the cluster does nothing: {why}. What is done is kept; continue with --resume."


def _lost(store: Store, chunks: list[int]) -> str:
    spans = ", ".join("{}-{}".format(*(np.array(store.bounds(c)) - [0, 1])) for c in chunks[:5])
    return (
        f"{len(chunks)} chunks killed every worker that took them (designs {spans}). The rest is "
        "kept; try a smaller --chunk in a new store, or continue with --resume."
    )
