"""The picture of the README: the Atlas machine and how its sphere shakes, drawn by omnijax.

    python experiments/atlas_picture.py docs/atlas.png

Left: the sphere on its three wheels, to scale except that the wheels are drawn larger.  Right: how
far the sphere's centre moves from the platform at wheel speeds (0.1, 1.2, 0.3) rad/s, and the same
for a wheel with half the gap.
"""

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from omnijax import load_rig, steady_state
from omnijax.report import PALETTE, style
from omnijax.rig import Rig, set_parameter
from omnijax.simulation import simulate, speeds

LARGER = 3.6  # the wheels' size in the drawing
SPEEDS = (0.1, 1.2, 0.3)  # rad/s
RIM, HUB = "#2f3a45", "#aeb8c2"


def upright(rig: Rig) -> np.ndarray:
    """Rotation that puts the machine on its wheels: the mean normal becomes +z."""
    up = np.asarray(rig.wheels.normal).sum(axis=0)
    up = up / np.linalg.norm(up)
    side = np.cross(up, [1.0, 0.0, 0.0])
    side = side / np.linalg.norm(side)
    return np.stack([side, np.cross(up, side), up])


def shade(normals: np.ndarray, colour: tuple[float, float, float]) -> np.ndarray:
    """Colours of faces under one lamp."""
    lamp = np.array([-0.35, -0.55, 0.76])
    light = 0.55 + 0.45 * np.clip(normals @ lamp, -0.6, 1.0)
    return np.clip(light[..., None] * np.asarray(colour), 0, 1)


def draw_sphere(ax, radius: float) -> None:
    """The sphere with meridians, so that one sees it turn."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 73), np.linspace(0, np.pi, 37))
    unit = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1)
    colours = shade(unit, (0.80, 0.88, 0.95))
    patch = ((u // (np.pi / 6)).astype(int) + (v // (np.pi / 6)).astype(int)) % 2 == 0
    colours[patch] = shade(unit, (0.36, 0.62, 0.82))[patch]
    x, y, z = np.moveaxis(radius * unit, -1, 0)
    ax.plot_surface(
        x, y, z, facecolors=colours[:-1, :-1], rstride=1, cstride=1, shade=False, linewidth=0,
        antialiased=False,
    )  # fmt: skip


def draw_wheel(ax, centre, axle, spoke, radius: float, rollers: int, roundness: float) -> None:
    """One wheel: a hub and its rollers, with the gaps between them."""
    across = np.cross(axle, spoke)
    half = 0.34 * radius
    pitch = 2 * np.pi / rollers
    faces, colours = [], []

    def ring(angle, r, offset):
        return centre + r * (np.cos(angle) * spoke + np.sin(angle) * across) + offset * axle

    for k in range(rollers):
        angles = np.linspace(k * pitch, (k + 1 - 0.35 * roundness) * pitch, 7)
        for a, b in pairwise(angles):
            for r, width, colour in ((radius, half, RIM), (0.72 * radius, 1.02 * half, HUB)):
                faces.append(
                    [ring(a, r, -width), ring(b, r, -width), ring(b, r, width), ring(a, r, width)]
                )
                colours.append(colour)
            for side in (-half, half):
                faces.append(
                    [ring(a, 0.72 * radius, side), ring(b, 0.72 * radius, side),
                     ring(b, radius, side), ring(a, radius, side)]
                )  # fmt: skip
                colours.append(RIM)
    for side in (-half, half):
        turn = np.linspace(0, 2 * np.pi, 40)
        faces.append([ring(a, 0.72 * radius, side) for a in turn])
        colours.append(HUB)
    ax.add_collection3d(
        Poly3DCollection(faces, facecolors=colours, edgecolors="white", linewidths=0.15)
    )


def draw_machine(ax, rig: Rig) -> None:
    """Sphere and wheels, standing."""
    turn, radius = upright(rig), float(rig.sphere.radius)
    draw_sphere(ax, radius)
    for i in range(rig.size):
        normal = turn @ np.asarray(rig.wheels.normal[i])
        drive = turn @ np.asarray(rig.wheels.drive[i])
        size = LARGER * float(rig.wheels.radius[i])
        centre = -(radius + size) * normal
        rollers, eta = int(rig.wheels.rollers[i]), float(rig.wheels.roundness[i])
        draw_wheel(ax, centre, np.cross(drive, normal), normal, size, rollers, eta)
    reach = 0.93 * radius
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), zlim=(-1.1 * reach, 0.9 * reach))
    ax.set_box_aspect((1, 1, 1), zoom=1.3)
    ax.view_init(elev=-13, azim=-62)
    ax.set_axis_off()


def picture(path: Path) -> Path:
    """Write the picture; returns its path."""
    rig = load_rig("atlas")
    half = set_parameter(rig, "wheel.roundness", 0.5 * float(rig.wheels.roundness[0]))
    ts = np.linspace(0.0, 4.0, 2001)
    with style():
        fig = Figure(figsize=(11, 4.6))
        draw_machine(
            fig.add_axes((0.0, 0.0, 0.42, 1.0), projection="3d", computed_zorder=True), rig
        )
        ax = fig.add_axes((0.485, 0.16, 0.495, 0.62))
        for machine, colour, words in (
            (rig, PALETTE["vermillion"], f"η = {float(rig.wheels.roundness[0]):g}"),
            (half, PALETTE["blue"], f"η = {float(half.wheels.roundness[0]):.3g}"),
        ):
            run = simulate(machine, speeds(SPEEDS), ts)
            peak = 1e6 * float(steady_state(machine, SPEEDS).peak)
            ax.plot(ts, 1e6 * np.asarray(run.distance), color=colour, linewidth=1.1)
            ax.axhline(peak, color=colour, linestyle="--", linewidth=1)
            ax.text(
                3.98, peak + 14, f"{words}: never above {peak:.0f} µm", color=colour, ha="right",
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.5},
            )  # fmt: skip
        ax.set(
            xlabel="time / s", ylabel="sphere centre from platform, |ΔR| / µm", xlim=(0, 4),
            ylim=(0, 740),
        )  # fmt: skip
        fig.text(
            0.485, 0.92, "A sphere on wheels with gaps shakes.", fontsize=17, fontweight="bold"
        )
        fig.text(
            0.485, 0.85, "Half the gap, about a quarter of the vibration.", fontsize=13,
            color="#57606a",
        )  # fmt: skip
        fig.savefig(path, dpi=150)
    return path


if __name__ == "__main__":
    print(picture(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/atlas.png")))
