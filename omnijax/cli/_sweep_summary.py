"""What a sweep came to, for machines and for people."""

from typing import Any

from ._console import paragraph

SHOWN = 5  # failed designs that are listed


def summarise(result: Any) -> dict[str, Any]:
    """What a sweep came to, for machines."""
    best = {}
    for name in result.spec.metrics:
        index = result.best(name)
        if index is not None:
            best[name] = {"design": index, "unit": result.unit(name)} | result.design(index)
            best[name]["status"] = result.status(index)
            best[name]["left_out"] = result.left_out(name)
    return {
        "designs": result.size,
        "method": result.spec.method,
        "why": result.method,
        "status": result.counts(),
        "best": best,
        "failed": [{"design": i, "rerun": result.command(i)} for i in result.failed(SHOWN)],
        "out": None if result.store.folder is None else str(result.store.folder),
    }


def show(result: Any, summary: dict[str, Any]) -> None:
    """The summary for people."""
    from .._status import FAILED
    from .._text import quantity_text
    from ..study import status_text

    print(paragraph(f"{summary['designs']} designs by {summary['why']}."))
    print(f"status: {status_text(summary['status'])}")
    for name, best in summary["best"].items():
        at = ", ".join(
            f"{path} = {quantity_text(best[path], unit)}" for path, unit, _ in result.spec.vary
        )
        print(paragraph(_best(name, best, at), "  "))
    for entry in summary["failed"]:
        print(f"design {entry['design']} failed; again: {entry['rerun']}")
    more = sum(summary["status"].get(k, 0) for k in (x.text for x in FAILED))
    if more > SHOWN:
        print(f"... and {more - SHOWN} more failed designs.")
    if summary.get("plot"):
        print(f"plot: {summary['plot']}")
    if summary.get("report"):
        print(f"report: {summary['report']}")
    if summary["out"]:
        print(f"store: {summary['out']}")


def _best(name: str, best: dict[str, Any], at: str) -> str:
    """The best design in a sentence, and what it is worth."""
    from .._text import quantity_text

    told = (
        f"best {name}: {quantity_text(best[name], best['unit'])} at {at} (design {best['design']})"
    )
    if best["status"] != "ok":
        return f"{told}: {best['status']}, as every design with a figure slips or lifts off"
    if best["left_out"]:
        return f"{told}; {best['left_out']} with a better figure slip or lift off: left out"
    return told
