"""Figures 11 to 14: the elastic cases."""

from typing import Any

import numpy as np

from ..report import COLOURS, MUTED, Figure, SpeedAxis, figure, legend_above, style
from ..vibration import norm
from ._case import DAMPING, ROUNDNESS, SPEEDS, STIFFNESS, gap_depths
from ._cycle import FASTEST, Metrics
from ._study import PaperStudy

SHOWN = (0.2, 0.4485, 0.7, 0.9)  # roundness of the spectra


def elastic(study: PaperStudy) -> Figure:
    """Fig. 11: the elastic part for the three dampings, from rest."""
    data: dict[str, Any] = {}
    largest = max(1e6 * np.max(norm(run.rest.elastic)) for run in study.elastic.values())
    with style():
        fig, axes = figure(3, height=6.4)
        for ax, (damping, run) in zip(axes, study.elastic.items(), strict=True):
            t, size = run.cycle.t, 1e6 * np.asarray(norm(run.rest.elastic))
            printed = 1e6 * np.asarray(norm(run.printed))
            ax.plot(t, size, color=COLOURS[0], linewidth=0.8, label="impulses kept")
            ax.plot(t, printed, color=COLOURS[1], linewidth=1.0, label="as printed")
            ax.set(ylabel="elastic part (µm)", xlim=(0, t[-1]), ylim=(0, 1.08 * largest))
            ax.set_title(f"C = {damping:g} N s/m", loc="right", fontweight="normal", pad=4)
            data |= {"t / s": t[::8], f"elastic C={damping:g} / µm": size[::8]}
            data[f"as printed C={damping:g} / µm"] = printed[::8]
        axes[-1].set_xlabel("time (s)")
        legend_above(axes[0])
    caption = (
        "Figure 11. Size of the elastic part |Σ(Δ+δ)r̂| from rest for three contact dampings, with "
        "the impulses at the gap edges (blue) and in the long run of the printed form, which drops "
        "them (orange). Without damping the sphere rings on the contact after every edge; with "
        "20000 N s/m the contact locks, and sphere and wheel ring together on the mount."
    )
    return Figure(fig, "fig11", caption, data)


def _peaks(axes: tuple[Any, Any], x: np.ndarray, scan: Metrics) -> dict[str, np.ndarray]:
    """Peaks (above) and elastic peaks (below) over `x`, a band of the samples a damping; in m."""
    data = {}
    for i, damping in enumerate(DAMPING):
        for ax, values in zip(axes, (scan.peak[i], scan.elastic_peak[i]), strict=True):
            size = 1e6 * values
            ax.fill_between(x, size.min(1), size.max(1), color=COLOURS[i], alpha=0.15, linewidth=0)
            ax.plot(
                x, size[:, 0], color=COLOURS[i], marker="o", markersize=3.5,
                label=f"C = {damping:g} N s/m",
            )  # fmt: skip
        data[f"peak C={damping:g} / m"] = scan.peak[i][:, 0]
        data[f"elastic peak C={damping:g} / m"] = scan.elastic_peak[i][:, 0]
    return data


def roundness(study: PaperStudy) -> Figure:
    """Fig. 12: peaks over the roundness ratio, with the band of the unknown parameters."""
    eta = np.asarray(ROUNDNESS)
    data: dict[str, Any] = {"eta": eta}
    rigid = np.sqrt(3) * gap_depths(study.rig)
    with style():
        fig, (top, bottom) = figure(2, height=5.8)
        data |= _peaks((top, bottom), eta, study.roundness["paper"])
        top.plot(eta, 1e6 * rigid, color=MUTED, linestyle="--", label="√3 Δr_w")
        top.set(ylabel="peak |ΔR| (µm)", ylim=(0, None))
        bottom.set(ylabel="peak elastic part (µm)", xlabel="roundness ratio η", ylim=(0, None))
        legend_above(top)
        fig.align_ylabels()
    caption = (
        "Figure 12. Peak of ΔR (above) and of its elastic part (below) over the roundness ratio. "
        "Bands: the parameters that the paper does not give, over their ranges. The total grows "
        "throughout where the contact is damped; the undamped elastic part peaks at resonances."
    )
    return Figure(fig, "fig12", caption, data)


def spectrum(study: PaperStudy, spectra: dict[float, tuple[np.ndarray, np.ndarray]]) -> Figure:
    """Fig. 13: the fastest wheel's lines of dR for several roundness ratios."""
    data: dict[str, Any] = {}
    with style():
        fig, axes = figure(len(SHOWN), height=6.6)
        for ax, (eta, (rate, size)) in zip(axes, spectra.items(), strict=True):
            shown = (rate > 0) & (rate < 160)
            x, y = rate[shown], 1e6 * size[shown]
            ax.vlines(x, 0, y, color=COLOURS[0], linewidth=2.4)
            top = np.argmax(y)
            ax.vlines(x[top], 0, y[top], color=COLOURS[1], linewidth=3.2)
            ax.plot(x[top], y[top], "v", color=COLOURS[1], markersize=7)
            ax.set(ylabel="ΔR (µm)", ylim=(0, 1.25 * y[top]), xlim=(0, 160))
            ax.set_title(f"η = {eta:g}", loc="right", fontweight="normal", pad=3)
            data |= {"rate / rad/s": x, f"dR eta={eta:g} / µm": y}
        axes[-1].set_xlabel("angular frequency (rad/s)")
    caption = (
        "Figure 13. Lines of ΔR that the fastest wheel (1.2 rad/s) raises, C = 8500 N s/m. Their "
        "spacing n ω = 16.8 rad/s never changes; which line is the strongest (marked) does: the "
        "narrower the gap, the higher."
    )
    return Figure(fig, "fig13", caption, data, SpeedAxis("frequency", "rad/s", SPEEDS[FASTEST]))


def stiffness(study: PaperStudy) -> Figure:
    """Fig. 14: peaks over the contact stiffness."""
    K = np.asarray(STIFFNESS)
    data: dict[str, Any] = {"K / N/m": K}
    own = float(study.rig.wheels.contact.stiffness[0]) / 1e3
    with style():
        fig, (top, bottom) = figure(2, height=5.8)
        data |= _peaks((top, bottom), K / 1e3, study.stiffness["paper"])
        for ax in (top, bottom):
            ax.axvline(own, color=MUTED, linestyle="--", linewidth=1)
        top.set(ylabel="peak |ΔR| (µm)", xscale="log", ylim=(0, None))
        bottom.set_yscale("log")
        bottom.set(ylabel="peak elastic part (µm)", xlabel="contact stiffness K (kN/m)")
        legend_above(top)
        fig.align_ylabels()
    caption = (
        "Figure 14. Influence of the contact stiffness (dashed: the measured 188.2 kN/m). The peak "
        "of ΔR hardly moves once the contact is damped, while its elastic part falls with K: "
        "“dominant” and “varied little” are true of different quantities."
    )
    return Figure(fig, "fig14", caption, data)
