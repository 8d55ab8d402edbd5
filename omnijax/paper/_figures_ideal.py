"""Figures 7 to 10: the ideal case and the rigid part."""

import numpy as np

from ..report import COLOURS, INK, MUTED, Figure, figure, legend_above, style
from ..vibration import norm
from ._study import PaperStudy

AXES = "xyz"


def _with_powers(t, values, symbol: str, power: int, curve: str, label: str):
    """Components of `values` (t, 3) over t (s), with the multiples of t^power nearest to them."""
    wanted = t**power
    with style():
        fig, (ax,) = figure(1, height=3.6)
        for i, axis in enumerate(AXES):
            ax.plot(t, values[:, i], color=COLOURS[i], label=f"{symbol}{axis}")
            factor = (wanted @ values[:, i]) / (wanted @ wanted)
            ax.plot(t[::20], factor * wanted[::20], "o", color=COLOURS[i], markersize=4)
        ax.plot([], [], "o", color=MUTED, markersize=4, label=curve)
        ax.set(xlabel="time (s)", ylabel=label, xlim=(0, t[-1]))
        legend_above(ax)
    return fig


def velocity(study: PaperStudy) -> Figure:
    """Fig. 7: the sphere's angular velocity, with the straight lines it should follow."""
    t, omega = study.ideal.t, study.ideal.run.Omega[0]
    fig = _with_powers(t, omega, "Ω_", 1, "straight line", "angular velocity (rad/s)")
    data = {"t / s": t} | {f"Omega_{a} / rad/s": omega[:, i] for i, a in enumerate(AXES)}
    caption = (
        "Figure 7. Angular velocity of the sphere in the ideal case: round wheels, constant motor "
        "torques (0.1, 0.2, 0.3) N m. Every component is a straight line."
    )
    return Figure(fig, "fig07", caption, data)


def path(study: PaperStudy) -> Figure:
    """Fig. 8: the platform's position."""
    t, place = study.ideal.t, study.ideal.run.R_l[0]
    fig = _with_powers(t, place, "R_l,", 2, "parabola", "position (m)")
    data = {"t / s": t} | {f"R_l_{a} / m": place[:, i] for i, a in enumerate(AXES)}
    caption = (
        "Figure 8. Position of the platform in the ideal case under the constant force "
        "(0.1, 0.2, 0.3) N. Every component is a parabola; the motor torques do not enter."
    )
    return Figure(fig, "fig08", caption, data)


def attitude(study: PaperStudy) -> Figure:
    """Fig. 9: the quaternion against time and against the turn angle."""
    t, q = study.ideal.t, study.ideal.run.attitude[0]
    omega = study.ideal.run.Omega[0]
    turn = 0.5 * np.linalg.norm((t @ omega) / (t @ t)) * t**2 / (2 * np.pi)
    with style():
        fig, (top, bottom) = figure(2, height=5.6, sharex=False)
        for i in range(4):
            top.plot(t, q[:, i], color=COLOURS[i], label=f"q{i}")
            bottom.plot(turn, q[:, i], color=COLOURS[i])
        top.set(xlabel="time (s)", ylabel="quaternion", xlim=(0, t[-1]), ylim=(-1.05, 1.05))
        bottom.set(
            xlabel="turns of the sphere",
            ylabel="quaternion",
            xlim=(0, turn[-1]),
            ylim=(-1.05, 1.05),
        )
        legend_above(top)
    data = {"t / s": t, "turns": turn} | {f"q{i}": q[:, i] for i in range(4)}
    caption = (
        "Figure 9. Orientation quaternion in the ideal case. Over time (above) the oscillation "
        "quickens, since the turn angle grows as t²; over the turn angle (below) it is sinusoidal."
    )
    return Figure(fig, "fig09", caption, data)


def rigid(study: PaperStudy) -> Figure:
    """Fig. 10: the rigid part of dR and its size."""
    c = next(iter(study.elastic.values())).cycle
    depth = 1e3 * float(np.asarray(study.rig.gaps.depth)[0])
    end = float(c.t[-1])
    size = 1e3 * np.asarray(norm(c.rigid))
    with style():
        fig, axes = figure(4, height=7.2)
        for i, (axis, ax) in enumerate(zip(AXES, axes, strict=False)):
            ax.plot(c.t[::6], 1e3 * c.rigid[::6, i], color=COLOURS[i], linewidth=1.2)
            ax.set(ylabel=f"ΔR_{axis} (mm)", ylim=(-1.15 * depth, 1.15 * depth))
        last = axes[3]
        last.plot(c.t[::6], size[::6], color=INK, linewidth=1.0)
        for level, text in ((depth, "Δr_w"), (np.sqrt(3) * depth, "√3 Δr_w")):
            last.axhline(level, color=MUTED, linestyle="--", linewidth=1)
            last.text(end, float(level) + 0.02, text, ha="right", va="bottom", color=MUTED)
        last.set(ylabel="|ΔR| (mm)", xlabel="time (s)", xlim=(0, c.t[-1]), ylim=(0, 2.2 * depth))
        fig.align_ylabels()
    data = {"t / s": c.t[::8]} | {f"rigid_{a} / m": c.rigid[::8, i] for i, a in enumerate(AXES)}
    caption = (
        "Figure 10. Rigid part of ΔR at constant wheel speeds (0.1, 1.2, 0.3) rad/s over one "
        "common period of the wheels. It never leaves the bound of three depths at right angles."
    )
    return Figure(fig, "fig10", caption, data)
