"""`omnijax sweep-status`: how far a sweep is, from another terminal; one design again."""

from pathlib import Path
from typing import Any

from .._reading import existing
from ._inputs import Json, MaybeWhole, emit


def sweep_status(store: Path, /, *, rerun: MaybeWhole = None, json: Json = False) -> int:
    """Show how far a stored sweep is, what failed, and the time left.

    Example: omnijax sweep-status sweep.zarr

    Parameters
    ----------
    store
        The folder that `omnijax sweep --out` writes.
    rerun
        Evaluate this design of the store again and print its figures.
    """
    from .._status import FAILED

    existing(store, "folder")
    from ..study import load_sweep

    result = load_sweep(store)
    if rerun is not None:
        design = _again(result, rerun)
        emit(json, design, lambda: _print_design(result, design))
        return 0 if design["status"] not in {x.text for x in FAILED} else 1
    from ..study import progress
    from ._sweep_summary import summarise

    state = progress(result.store)
    summary = {**state._asdict(), **summarise(result)}
    emit(json, summary, lambda: _print(result, summary))
    return 1 if result.store.damaged else 0


def _again(result: Any, index: int) -> dict[str, Any]:
    import numpy as np

    from .._status import Status
    from ..study import Evaluator

    result.design(index)  # refuses an index outside
    columns = Evaluator(result.spec).designs(np.array([index]))
    figures = {name: values[0].item() for name, values in columns.items()}
    return {"design": index} | figures | {"status": Status(int(figures["status"])).text}


def _print_design(result: Any, design: dict[str, Any]) -> None:
    from .._status import Status

    print(f"design {design['design']}: {design['status']}")
    for name in result.store.names[:-1]:
        print(f"  {name} = {design[name]:.9g} {result.unit(name)}")
    remedy = Status.of(design["status"]).remedy
    if remedy:
        print(remedy)


def _print(result: Any, summary: dict[str, Any]) -> None:
    from ..study import clock
    from ._sweep_summary import show

    done, size = summary["done"], summary["designs"]
    doing = "running" if summary["running"] else "finished" if done == size else "stopped"
    rate = f", {summary['rate']:.4g} designs/s" if summary["rate"] else ""
    left = f", {clock(summary['time_left'])} left" if summary["time_left"] else ""
    print(f"{doing}: {done} of {size} designs ({100 * done / size:.1f} %){rate}{left}")
    if summary["last_chunk"] is not None:
        print(f"latest chunk finished {clock(summary['last_chunk'])} ago")
    if doing == "stopped":
        print(f"continue with: {_resume(result)}")
    show(result, summary)


def _resume(result: Any) -> str:
    command = result.store.group.attrs.get("command") or "the same call and resume=True"
    return command if "--resume" in command or "resume=" in command else f"{command} --resume"
