"""What all pictures share: colours, type, lines, units as people read them, axes of their own."""

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
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
INK, RULE = "#1b1f24", "#d8dde3"
SCALES = {  # of channels: one factor for all runs, so that pictures can be compared
    "m": (1e6, "µm"),
    "m/s": (1e3, "mm/s"),
    "m/s^2": (1.0, "m/s²"),
    "(m)^2": (1e12, "µm²"),
}

RC: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 11.0,
    "axes.titlesize": 11.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlecolor": INK,
    "axes.labelsize": 11.0,
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.use_mathtext": False,
    "axes.formatter.useoffset": False,
    "axes.unicode_minus": True,
    "grid.color": RULE,
    "grid.linewidth": 0.7,
    "text.color": INK,
    "text.parse_math": False,  # a name with dollars stays that name
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 10.0,
    "ytick.labelsize": 10.0,
    "lines.linewidth": 1.6,
    "legend.frameon": False,
    "legend.fontsize": 10.0,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "path.simplify": True,
    "path.simplify_threshold": 0.3,
    "svg.fonttype": "none",
    "svg.hashsalt": "omnijax",
}


@contextmanager
def style() -> Iterator[None]:
    """Matplotlib's settings of the product, for the block only."""
    import matplotlib as mpl
    from cycler import cycler

    with mpl.rc_context({**RC, "axes.prop_cycle": cycler(color=COLOURS)}):
        yield


def styled(draw: Callable[..., Any]) -> Callable[..., Any]:
    """Call `draw` in the product's style; axes of the caller's keep the style that they have."""

    @functools.wraps(draw)
    def drawn(*args: Any, **kwargs: Any) -> Any:
        if kwargs.get("ax") is not None:
            return draw(*args, **kwargs)
        with style():
            return draw(*args, **kwargs)

    return drawn


def new_axes(ax: Any, height: float = 4.2, width: float = 7.2) -> Any:
    """`ax`, or the axes of a new figure (inches) that no window system knows of."""
    if ax is None:
        from matplotlib.figure import Figure

        ax = Figure(figsize=(width, height), layout="constrained").subplots()
    return ax


SPREAD = 30.0  # ratio of scores above which a linear axis would hide the small ones


def bars_of_scores(ax: Any, scores: Sequence[Mapping[str, Any]], colour: str) -> None:
    """Gains of candidates as bars from zero; on a logarithmic axis where they differ much."""
    best = scores[::-1]
    gain = [max(s["gain"], 0.0) for s in best]
    far = max(gain, default=0.0) > SPREAD * max(min(gain, default=0.0), 1e-2)
    ax.barh([f"{s['id']} at {s['place']}" for s in best], gain, color=colour)
    ax.set(xscale="log" if far else "linear", xlabel="gain in χ²")
