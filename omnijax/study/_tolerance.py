"""`tolerances`: how far the parts of each wheel may be off while the vibration stays below a limit.

To first order f = f0 + sum g_p d_p with d_p the relative deviation of a part.  Uniform deviations
within +-t_p add a variance of sum (g_p t_p)^2/3; the parts get equal shares of what the limit
leaves, g_p t_p equal, capped at the widest tolerance.  Where curvature spoils this, all tolerances
shrink until enough drawn machines stay below the limit, by the lower 95 % bound of their share.
New machines, drawn after the tolerances are set, then say what share these keep.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.stats import norm

from .._errors import InputError, RunError
from .._html import html_table
from ..vibration import METRICS
from ._amounts import amount
from ._design_rig import RigCases
from ._netcdf import read_result, write_result
from ._study_file import Study, study_of

DRAWS = 1024
WIDEST = 0.2  # relative
SHRINKS = 40  # down to 5 % of what the derivatives allow
PARTS = ("wheel.radius", "wheel.roundness", "contact.stiffness", "contact.damping",
         "mount.stiffness", "mount.damping", "closure.stiffness")  # fmt: skip


@dataclasses.dataclass(frozen=True, repr=False)
class Tolerances:
    """Relative half widths for every part, and what drawn machines say of them.

    `linear` is what the derivatives alone allow, `widths` what drawn machines bear out.  Of `draws`
    new machines, none of which set the widths, `share` stay below `limit` (95 % bounds `share_low`
    and `share_high`); `linear_share` is that of the widths by derivatives alone.
    """

    metric: str
    unit: str
    limit: float
    nominal: float
    confidence: float
    parts: tuple[str, ...]
    slopes: np.ndarray  # change of the metric per relative change of the part
    linear: np.ndarray
    widths: np.ndarray
    share: float
    share_low: float
    share_high: float
    linear_share: float
    draws: int

    @property
    def confirmed(self) -> bool:
        """Whether the new machines keep the limit as often as asked for."""
        return self.share >= self.confidence

    def __repr__(self) -> str:
        return "\n".join(self.sentences())

    def _repr_html_(self) -> str:
        percent = 100 * np.column_stack([self.linear, self.widths])
        rows = [(part, *map(float, row)) for part, row in zip(self.parts, percent, strict=True)]
        return html_table(self.sentences()[0], rows, ("part", "by derivatives / ± %", "± %"))

    def sentences(self) -> list[str]:
        """The tolerances in words."""
        lines = [
            f"{self.metric} is {amount(self.nominal, self.unit)} with nominal parts and stays "
            f"below {amount(self.limit, self.unit)} for {100 * self.share:.2f} % of {self.draws} "
            f"new machines (95 %: {100 * self.share_low:.2f} to {100 * self.share_high:.2f} %); "
            f"asked for: {100 * self.confidence:g} %."
            + ("" if self.confirmed else " The tolerances are NOT confirmed.")
        ]
        for part, width in zip(self.parts, self.widths, strict=True):
            more = ", as wide as was looked" if width >= WIDEST * (1 - 1e-9) else ""
            lines.append(f"`{part}` ± {100 * width:.3g} %{more}")
        ratio = float(np.min(self.widths / self.linear))
        if ratio < 1 - 1e-9:
            lines.append(
                f"the derivatives alone allow {1 / ratio:.3g} times as much, but then only "
                f"{100 * self.linear_share:.2f} % stay below the limit: the metric is curved."
            )
        return lines

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` over the parts."""
        import xarray as xr

        one = {"units": "1"}
        data = {
            "slope": ("part", self.slopes, {"units": self.unit}),
            "linear": ("part", self.linear, one),
            "width": ("part", self.widths, one),
        }
        keys = ("metric", "unit", "limit", "nominal", "confidence", "share", "share_low",
                "share_high", "linear_share", "draws")  # fmt: skip
        attrs = {"kind": "omnijax tolerances", **{k: getattr(self, k) for k in keys}}
        return xr.Dataset(data, {"part": list(self.parts)}, attrs)

    def save(self, path: str | Path) -> None:
        """Write netCDF that `Tolerances.load` reads back equal."""
        write_result(self.to_xarray(), path)

    @classmethod
    def load(cls, path: str | Path) -> "Tolerances":
        """What `save` wrote."""
        d = read_result(path, "omnijax tolerances", "tolerances")
        a = {k: v for k, v in d.attrs.items() if k != "kind"}
        numbers = {k: v if k in {"metric", "unit"} else float(v) for k, v in a.items()}
        numbers["draws"] = int(a["draws"])
        parts = tuple(str(x) for x in d["part"].values)
        found = {"slopes": d["slope"].values, "linear": d["linear"].values}
        return cls(parts=parts, widths=d["width"].values, **found, **numbers)  # pyright: ignore

    def plot_widths(self, ax: Any = None) -> Any:
        """Tolerances as bars, tightest on top."""
        from ._sensitivity_plot import new_axes

        order = np.argsort(-self.widths)
        ax = new_axes(ax, 1.4 + 0.27 * len(order))
        ax.barh(np.arange(len(order)), 100 * self.widths[order], color="#0072B2", height=0.7)
        ax.set_yticks(np.arange(len(order)), [self.parts[i] for i in order])
        ax.grid(axis="y", visible=False)
        ax.set_xlabel("tolerance (± %)")
        ax.set_title(f"{self.metric} below {amount(self.limit, self.unit)}")
        return ax


def share_bounds(good: int, total: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    z, p = 1.96, good / total
    centre = (p + z**2 / (2 * total)) / (1 + z**2 / total)
    half = z / (1 + z**2 / total) * np.sqrt(p * (1 - p) / total + z**2 / (4 * total**2))
    return float(centre - half), float(centre + half)


def allocate(slopes: np.ndarray, room: float, confidence: float) -> np.ndarray:
    """Relative half widths that use up `room`, to first order, at equal shares of the variance.

    z sqrt(sum (g t)^2/3) = room with z the confidence's quantile; capped parts leave theirs to the
    others.
    """
    spread = np.sqrt(3.0) * room / norm.ppf(confidence)
    width, open_ = np.full(len(slopes), WIDEST), np.abs(slopes) > 0
    for _ in range(len(slopes)):
        used = np.sum((slopes[~open_] * width[~open_]) ** 2)
        if used >= spread**2 or not open_.any():
            break
        each = np.sqrt((spread**2 - used) / open_.sum())
        fair = each / np.abs(np.where(open_, slopes, np.inf))
        over = open_ & (fair > WIDEST)
        if not over.any():
            width[open_] = fair[open_]
            break
        open_ &= ~over
    return width


def tolerances(
    study: str | Path | Mapping | Study, *, parts: tuple[str, ...] = (), draws: int = DRAWS
) -> Tolerances:
    """Tolerances of each wheel's parts that keep a metric below `[limit] max`.

    The parts are those of `[tolerance]`, or `parts`, or all of `PARTS`; deviations are independent
    and uniform.  Over several cases the metric is its worst.
    """
    asked = study_of(study)
    if asked.limit is None:
        raise InputError("tolerances need a [limit] with `metric` and `max`.")
    metric, limit = asked.limit
    chosen = parts or tuple(p for p, _ in asked.tolerances) or PARTS
    plain = dataclasses.replace(
        asked, variables=(), constraints=(), tolerances=tuple((p, 1.0) for p in chosen)
    )
    cases = RigCases(plain, (metric,))
    count = len(cases.parts)

    def worst(deviation):
        return jnp.max(cases.every(jnp.zeros(0), deviation[None])[0])

    forward = jax.jit(lambda x: jax.jvp(worst, (jnp.zeros(count),), (x,)))
    pairs = [forward(row) for row in jnp.eye(count)]
    nominal, slopes = float(pairs[0][0]), np.array([float(s) for _, s in pairs])
    unit = METRICS[metric].unit
    if not nominal < limit:
        raise RunError(
            f"no tolerance keeps {metric} below {amount(limit, unit)}: with nominal parts it is "
            f"{amount(nominal, unit)} already."
        )
    many = jax.jit(lambda d: jax.lax.map(worst, d, batch_size=64))

    def below(width, seed) -> int:
        noise = np.random.default_rng(seed).uniform(-1, 1, (draws, count))
        values = np.asarray(many(jnp.asarray(noise * width)))
        return int(np.sum(np.isfinite(values) & (values < limit)))

    linear = width = allocate(slopes, limit - nominal, asked.confidence)
    for _ in range(SHRINKS):
        if share_bounds(below(width, asked.seed), draws)[0] >= asked.confidence:
            break
        width = 0.93 * width
    fresh = asked.seed + 1
    good, first = below(width, fresh), below(linear, fresh)
    low, high = share_bounds(good, draws)
    return Tolerances(
        metric, unit, limit, nominal, asked.confidence, cases.parts, slopes, linear, width,
        good / draws, low, high, first / draws, draws,
    )  # fmt: skip
