"""What all pictures share: colours, units as people read them, and axes where none are given."""

from typing import Any

# Okabe and Ito's colours, told apart with every common colour vision
PALETTE = {
    "blue": "#0072B2",
    "vermillion": "#D55E00",
    "green": "#009E73",
    "purple": "#CC79A7",
    "orange": "#E69F00",
    "sky": "#56B4E9",
    "black": "#222222",
}
COLOURS = tuple(PALETTE.values())
MUTED = "#57606a"
SCALES = {  # of channels: one factor for all runs, so that pictures can be compared
    "m": (1e6, "µm"),
    "m/s": (1e3, "mm/s"),
    "m/s^2": (1.0, "m/s²"),
    "(m)^2": (1e12, "µm²"),
}


def new_axes(ax: Any, height: float = 4.2, width: float = 7.2) -> Any:
    """`ax`, or the axes of a new figure (inches) that no window system knows of."""
    if ax is None:
        from matplotlib.figure import Figure

        ax = Figure(figsize=(width, height), layout="constrained").subplots()
    return ax
