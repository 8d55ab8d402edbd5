"""What a run came to, for machines and for people."""

from typing import Any


def summarise(run: Any, rig: Any) -> dict[str, Any]:
    """How the run ended, and its main figures as far as it got."""
    import numpy as np

    from ..simulation import STATUS

    good = np.isfinite(np.asarray(run.dR)).all(axis=1)
    dR, elastic, a = (np.asarray(x)[good] for x in (run.dR, run.dR_elastic, run.a))
    figures = {"peak": dR, "elastic_peak": elastic}
    length = {name: np.linalg.norm(x, axis=1) for name, x in figures.items()}
    peak = {name: float(x.max()) if len(x) else None for name, x in length.items()}
    rms = {
        name: float(np.sqrt(np.mean(np.sum(x**2, axis=1)))) if len(x) else None
        for name, x in (("rms", dR), ("elastic_rms", elastic), ("acceleration_rms", a))
    }
    normal, margin = (np.asarray(x)[good] for x in (run.normal_force, run.slip_margin))
    return {
        "status": STATUS[int(run.status)],
        "message": run.message(),
        "time_reached": run.time_reached if len(dR) else None,
        "samples": int(good.sum()),
        "steps": int(run.steps),
        "method": run.method,
        **peak,
        **rms,
        "smallest_normal_force": float(normal.min()) if len(dR) else None,
        "smallest_slip_margin": float(margin.min()) if len(dR) else None,
        "effects": [{"id": placed.law.id, "place": placed.place} for placed in rig.effects],
    }


def show(summary: dict[str, Any]) -> None:
    """The summary for people."""
    print(summary["message"])
    if summary["samples"]:
        print(f"|ΔR|            peak {_micro(summary['peak'])}, RMS {_micro(summary['rms'])}")
        peak, rms = _micro(summary["elastic_peak"]), _micro(summary["elastic_rms"])
        print(f"elastic part    peak {peak}, RMS {rms}")
        print(f"acceleration    RMS {summary['acceleration_rms']:.4g} m/s²")
        normal, margin = summary["smallest_normal_force"], summary["smallest_slip_margin"]
        print(f"normal force    at least {normal:.4g} N{' (lift-off)' * (normal < 0)}")
        print(f"slip margin     at least {margin:.4g} N{' (slip)' * (margin < 0)}")
    for key in ("out", "plot"):
        if key in summary:
            print(f"{key:15s} {summary[key]}")


def _micro(value: float) -> str:
    return f"{1e6 * value:.4g} µm"
