"""`sweep`: metrics of many designs, chunk by chunk, into a store that survives being killed."""

import dataclasses
import errno
import functools
import platform
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ..._errors import InputError, tell
from ..._files import obstacle_of
from ..._interrupts import answer, end_children, interrupted, raise_lost, saying
from ...rig import Rig, as_rig
from ...simulation import AbstractDrive
from .._evaluation import checked_after, read_run, sample_to_check
from .._study_folder import tell_of_a_start
from .dask import check_cluster, over_cluster
from .evaluator import Evaluator, gradient_name, quantities
from .plan import Numerics, Sampling, plan, read_drive, read_numbers
from .result import SweepResult
from .spec import SweepSpec, differences_of
from .store import Store, clean, create_store, lock, open_store

Report = Callable[[Store, int, np.ndarray], None]  # after each chunk: store, chunk, its status


def sweep(
    rig: Rig | str | Path,
    vary: Mapping[str, Any] | Sequence[str] | str,
    metrics: Sequence[str] | str = ("peak", "rms"),
    *,
    speeds: Sequence[float | str] | str | None = None,
    drive: AbstractDrive | Sequence[float | str] | str | None = None,
    duration: float | str | None = None,
    rate: float | str | None = None,
    model: str = "coupled",
    solver: str = "auto",
    rtol: float | None = None,
    max_steps: int | None = None,
    sampler: str = "grid",
    samples: int | None = None,
    seed: int = 0,
    gradient: bool = False,
    out: str | Path | None = None,
    resume: bool = False,
    chunk: int | None = None,
    devices: int = 1,
    workers: int | None = None,
    scheduler: str | None = None,
    report: Report | None = None,
    command: str = "",
) -> SweepResult:
    """Metrics of `rig` over designs: every combination of `vary`, or samples of its ranges.

    `vary` maps parameter paths, or quantities of the drive (`speed.w1`, `speed.scale`, `force.x`),
    to ranges: "0.1:0.6:50", "log:5e4:1e6:40", a list, or "low:high" for the samplers `lhs` and
    `sobol`.  `speeds` (rad/s, one a wheel) or `drive` say how the wheels turn; without `duration`
    (s, or "2 s") the figures are those of the steady state.  `rate` is in samples per s ("1 kHz").

    The method of evaluation is chosen from rig and drive and is part of the result.  With `out` the
    results go to a zarr store, which `resume` continues; `devices` spreads a batch over local
    devices, `workers` or `scheduler` spread the chunks over processes by Dask.  `report` is called
    after each chunk.

    Each figure of the result is an array in SI: the grid's shape, one axis a varied quantity in the
    order of `vary`, or (samples,).  Raises `InputError` for what cannot be varied or measured, and
    for a store that exists or is of another sweep; `KeyboardInterrupt` says what is kept.
    """
    rig_file = str(rig) if isinstance(rig, str | Path) else None
    machine = as_rig(rig)
    sampling, numerics = read_numbers(
        Sampling(sampler, samples, seed, bool(gradient), chunk, devices),
        Numerics(model, solver, *read_run(duration, rate), rtol, max_steps),
    )
    asked, why = plan(
        machine, vary, metrics, read_drive(machine, speeds, drive), sampling, numerics
    )
    folder = None if out is None else Path(out)
    if folder is None and (resume or workers is not None or scheduler is not None):
        raise InputError("`resume`, `workers` and `scheduler` need a store: give `out`.")
    check_cluster(workers, scheduler)
    about = {"method_reason": why, "command": command, "rig_file": rig_file, **environment()}
    with _held(folder, asked, resume, chunk is not None, about) as store:
        spread = workers is not None or scheduler is not None
        run = over_cluster(store, workers, scheduler) if spread else _local(store, sampling.devices)
        with saying(store.kept):
            _run(store, run, report)
            _check_steps(store, sampling.devices)
    return SweepResult(store)


@contextmanager
def _held(
    folder: Path | None, asked: SweepSpec, resume: bool, fixed_chunk: bool, about: dict[str, Any]
) -> Iterator[Store]:
    """The store, which nobody else writes meanwhile; a new one goes again if nothing gets in."""
    begun = folder is not None and not folder.exists()
    try:
        store = _store(folder, asked, resume, fixed_chunk, about)
        held = lock(folder)
    except OSError as error:
        raise _no_space(error, folder) from None
    try:
        yield store
    except InputError:  # nothing was computed: a store of nothing helps nobody
        if begun and folder is not None and not store.done().any():
            shutil.rmtree(folder, ignore_errors=True)
        raise
    except OSError as error:
        raise _no_space(error, folder) from None
    finally:
        held.release()


@functools.cache
def environment() -> dict[str, Any]:
    """Versions and device, for the store."""
    from importlib.metadata import version

    import jax

    packages = ("jax", "jaxlib", "diffrax", "equinox", "numpy", "scipy")
    versions = {"omnijax": __version__, "python": platform.python_version()}
    versions |= {name: version(name) for name in packages}
    device = jax.devices()[0]
    return {"versions": versions, "device": f"{device.platform} {device.device_kind}"}


def _store(
    folder: Path | None, asked: SweepSpec, resume: bool, fixed_chunk: bool, about: dict[str, Any]
) -> Store:
    if folder is not None and folder.exists() and not folder.is_dir():
        raise InputError("is a file, but a folder is to be written there.", folder)
    if folder is None or not folder.exists() or not any(folder.iterdir()):
        if folder is not None and (reason := obstacle_of(folder)) is not None:
            raise InputError(f"cannot be written: {reason}.", folder)
        if folder is not None and resume:
            tell_of_a_start(folder)
        created = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        return create_store(folder, asked, quantities(asked), {**about, "created": created})
    if not resume:
        raise InputError("exists already: continue it with --resume, or write elsewhere.", folder)
    store = open_store(folder)
    if not fixed_chunk:  # from the memory free at the time, so the store's own count
        stored = store.spec
        asked = dataclasses.replace(asked, batch=stored.batch, chunk=stored.chunk)
    differing = differences_of(store.spec, asked)
    if differing:
        keys = "\n  ".join(differing)
        raise InputError(
            f"holds another sweep and is left as it is. They differ in:\n  {keys}", folder
        )
    clean(folder)
    tell(store.damage())
    return store


def _local(store: Store, devices: int) -> Iterator[tuple[int, np.ndarray]]:
    """Evaluate and write the missing chunks one after the other."""
    evaluator = Evaluator(store.spec, devices)
    for chunk in np.flatnonzero(~store.done()).tolist():
        columns = evaluator.designs(np.arange(*store.bounds(chunk)))
        store.write(chunk, columns)
        yield chunk, columns["status"]


def _run(store: Store, finished: Iterator[tuple[int, np.ndarray]], report: Report | None) -> None:
    """Drive the evaluation; an interruption keeps what is done and says how to go on."""
    try:
        for chunk, status in finished:
            raise_lost()
            store.written(chunk)
            if report is not None:
                report(store, chunk, status)
    except KeyboardInterrupt:
        answer()
        if interrupted():  # workers too: what they were in is computed again
            end_children()
            raise KeyboardInterrupt(store.kept()) from None
        close = getattr(finished, "close", None)
        if close is not None:
            close()
        raise KeyboardInterrupt(store.kept()) from None


def _check_steps(store: Store, devices: int) -> None:
    """Try fixed steps against their half on designs of the answer; the store keeps what came out.

    The designs checked before are others: what is stiff between them shows here.
    """
    spec = store.spec
    if spec.method != "fixed" or "checked_after" in store.group.attrs:
        return
    slopes = [gradient_name(m, path) for m in spec.metrics for path, _, _ in spec.vary]
    figures = [*spec.metrics, *(slopes if spec.gradient else ())]
    columns = np.stack([store.read(name) for name in figures], axis=1)
    some = sample_to_check(columns)
    if not len(some):
        return
    finer = Evaluator(dataclasses.replace(spec, substeps=2 * (spec.substeps or 1)), devices)
    fine = finer.designs(some)
    told, good = checked_after(columns[some], np.stack([fine[name] for name in figures], axis=1))
    store.note("checked_after", told)
    if not good:
        tell([f"{told}: give `rtol` for runs by adaptive steps."])


def _no_space(error: OSError, folder: Path | None) -> Exception:
    """The error of a disk that takes no more, as a sentence; any other one as it is."""
    if error.errno not in {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM}:
        return error
    return InputError(
        f"cannot be written: {error.strerror}. Finished chunks are kept and readable; "
        "make room and continue with --resume.",
        folder,
    )
