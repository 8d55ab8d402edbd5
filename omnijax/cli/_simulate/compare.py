"""A measured run over the simulated one: in figures, and in one picture."""

import sys
from pathlib import Path
from typing import Any

from ..._errors import InputError

DOTS = 1000  # of a channel, at most about twice as many
PANELS = ("dR", None, "Omega", "a")  # what the panels of a run's picture show of a recording


def compared(path: Path, rig: Any, plot: Path | None) -> Any:
    """The measured run; `InputError` where there is no picture to lay it over."""
    from ...recording import read_recording

    if plot is None:
        raise InputError("--compare needs --plot PICTURE, which shows both runs.")
    run = read_recording(path, rig)
    for fault in run.faults:
        print(f"warning: {fault}", file=sys.stderr)
    if not run.groups:
        raise InputError("measures no output: there is nothing to compare.", path)
    return run


def differences(run: Any, rig: Any, measured: Any) -> dict[str, Any]:
    """RMS of measured less simulated sensor readings, at the measured times of the run, in SI."""
    import numpy as np

    from ...recording import channels, unit_of
    from ...simulation import measured as readings

    own, time = readings(run, rig), np.asarray(run.t)
    at = measured.time - measured.time[0]
    inside = at <= time[-1]
    by_channel = {}
    for group in measured.groups:
        values = measured.group(group)
        for i, channel in enumerate(channels(group, rig.size)):
            model = np.interp(at[inside], time - time[0], np.asarray(own[group])[:, i])
            left = values[inside, i] - model
            left = left[np.isfinite(left)]
            if len(left):
                rms = {"rms": float(np.sqrt(np.mean(left**2)))}
                rms["rms_measured"] = float(np.sqrt(np.nanmean(values[inside, i] ** 2)))
                by_channel[channel] = rms | {"unit": unit_of(channel)}
    return by_channel


def lay_over(axes: Any, run: Any, measured: Any) -> None:
    """The measured channels as dots in the colour of the simulated line, which is made pale."""
    import numpy as np

    from ..._plot import COLOURS
    from ...simulation import channel_scale

    time = np.asarray(measured.time) - measured.time[0]
    few = max(1, len(time) // DOTS)
    for ax, group in zip(axes, PANELS, strict=True):
        if group is None or group not in measured.groups:
            continue
        factor, _ = channel_scale(run, group)
        values = factor * measured.group(group)
        for line in ax.get_lines():
            line.set(alpha=0.4, linewidth=0.9)
        for i in range(3):
            label = "measured" if i == 0 else None
            ax.plot(
                time[::few], values[::few, i], ".", ms=2.2, color=COLOURS[i], label=label, zorder=3
            )
    shown = [ax for ax in axes if ax.get_legend() is not None][:1]
    for ax in shown:
        columns = len(ax.get_legend_handles_labels()[1])
        ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, frameon=False,
                  borderaxespad=0.1, handlelength=1.4, columnspacing=1.2)  # fmt: skip
