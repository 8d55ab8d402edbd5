"""What a run came to, for machines and for people."""

from typing import Any

from .._console import paragraph

FIGURES = (  # metric of the summary -> label and unit of its line
    ("peak", "|ΔR| peak", "m"),
    ("rms", "|ΔR| RMS", "m"),
    ("elastic_peak", "elastic part peak", "m"),
    ("elastic_rms", "elastic part RMS", "m"),
    ("sphere_acceleration_rms", "acceleration RMS of the sphere", "m/s^2"),
    ("platform_acceleration_rms", "acceleration RMS of the platform", "m/s^2"),
    ("lift_off_margin", "normal force, least", "N"),
    ("slip_margin", "slip margin, least", "N"),
)


def summarise(run: Any, rig: Any) -> dict[str, Any]:
    """How the run ended, and its metrics as far as it got, under the names of `METRICS`."""
    import jax
    import numpy as np

    from ..._errors import tell
    from ..._status import Status
    from ...vibration import follows

    good = np.all(np.isfinite(np.asarray(run.dR)), axis=1)
    kept = run  # a copy of a long run is not made for nothing
    if not good.all():
        kept = jax.tree.map(lambda x: x[good] if np.ndim(x) and len(x) == len(good) else x, run)
    if good.sum() > 1 and not follows(kept.t, kept.dR, kept.dR_rate):
        rate = (good.sum() - 1) / float(kept.t[-1] - kept.t[0])
        tell([
            f"{rate:.4g} samples a second do not follow this vibration: what lies between them "
            "is not seen, peaks least of all. Give a higher `--rate`."
        ])  # fmt: skip
    names = [name for name, _, _ in FIGURES]
    figures = _figures(kept, rig, names) if good.any() else dict.fromkeys(names)
    return {
        "status": Status(int(run.status)).text,
        "message": run.message(),
        "time_reached": run.time_reached if good.any() else None,
        "samples": int(good.sum()),
        "steps": int(run.steps),
        "method": run.method,
        **{name: None if value is None else float(value) for name, value in figures.items()},
        "contacts": [event._asdict() for event in run.contact_losses()],
        "effects": [{"id": placed.law.id, "place": placed.place} for placed in rig.effects],
    }


def _figures(run: Any, rig: Any, names: list[str]) -> dict[str, Any]:
    """The metrics by one program, which is kept; one by one each formula would be compiled."""
    import equinox as eqx

    from ...vibration import evaluate

    return eqx.filter_jit(evaluate)(run, rig, tuple(names))


def not_believed(summary: dict[str, Any]) -> str:
    """From when on the run is not that of the machine, since no law of the rig describes it."""
    modelled = {effect["place"] for effect in summary["effects"] if effect["id"] == "lift-off"}
    apart = {
        loss["wheel"]: loss["time"] for loss in summary["contacts"]
        if loss["kind"] == "lifts off" and modelled & {loss["wheel"], "all"}
    }  # fmt: skip
    beyond = [  # an open contact slips too
        loss for loss in summary["contacts"]
        if not (loss["kind"] == "lifts off" and loss["wheel"] in apart)
        and loss["time"] < apart.get(loss["wheel"], float("inf"))
    ]  # fmt: skip
    if not beyond:
        return ""
    open_wheels = [loss["wheel"] for loss in beyond if loss["kind"] == "lifts off"]
    hint = f" Add the effect `lift-off` at {', '.join(open_wheels)}." if open_wheels else ""
    return (
        f"From t = {beyond[0]['time']:.4g} s on this run is not to be believed, nor are the "
        f"figures of the whole run below: the rig has no law for a contact that is lost.{hint}"
    )


def show(summary: dict[str, Any]) -> None:
    """The summary for people."""
    print(summary["message"])
    if told := not_believed(summary):
        print(paragraph(told))
    from ..._text import quantity_text

    for name, words, unit in FIGURES if summary["samples"] else ():
        print(f"{words:33s} {quantity_text(summary[name], unit)}")
    for loss in summary["contacts"]:
        print(f"{loss['wheel'] + ' ' + loss['kind']:33s} first at {loss['time']:.4g} s")
    for channel, difference in summary.get("differences", {}).items():
        left, unit = quantity_text(difference["rms"], difference["unit"]), difference["unit"]
        told = f"RMS {left} of {quantity_text(difference['rms_measured'], unit)}"
        print(f"{'measured less simulated ' + channel:33s} {told}")
    for key in ("out", "plot"):
        if key in summary:
            print(f"{key:33s} {summary[key]}")
