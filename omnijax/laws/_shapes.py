"""Wheel shapes (eqs. 1-11): profiles of the gap between rollers, periodic in the pitch."""

import math
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._ports import AbstractShape


class Gap(eqx.Module):
    """Geometry of one wheel's gaps (eqs. 4-7 and 10).

    pitch 2 pi / n, width eta pitch, and the depth by which the sphere sinks into the gap,
    R (1 - cos theta_R/2) + r_b (1 - cos theta_s/2) with sin(theta_R/2) = (r_b/R) sin(theta_s/2).
    """

    sphere_radius: Float[Array, "..."]  # m, R
    wheel_radius: Float[Array, "..."]  # m, r_b
    rollers: Float[Array, "..."]  # n, rollers per row
    roundness: Float[Array, "..."]  # eta, gap angle over pitch angle

    @property
    def pitch(self) -> Float[Array, "..."]:
        """Angle from one gap to the next, rad."""
        return 2 * math.pi / self.rollers

    @property
    def width(self) -> Float[Array, "..."]:
        """Gap angle theta_s, rad."""
        return self.roundness * self.pitch

    @property
    def depth(self) -> Float[Array, "..."]:
        """Depth at mid-gap, m (eq. 7)."""
        return self.sagitta(self.width / 2)

    def sagitta(self, angle: Float[Array, "..."]) -> Float[Array, "..."]:
        """How far the sphere sinks below the roller circle over an edge `angle` rad away, m."""
        q = self.wheel_radius / self.sphere_radius * jnp.sin(angle)
        sphere = self.sphere_radius * q * q / (1 + jnp.sqrt(1 - q * q))
        return sphere + 2 * self.wheel_radius * jnp.sin(angle / 2) ** 2


def wrapped(angle, period):
    """`angle` less whole periods, in [0, period) up to rounding; a tenth of the cost of a mod."""
    return angle - period * jnp.floor(angle / period)


def _inside(angle, gap: Gap):
    """Angle into the gap, whether in the gap, and a width that is safe to divide by."""
    into = wrapped(angle, gap.pitch)
    return into, into < gap.width, jnp.where(gap.width > 0, gap.width, 1.0)


class GatedSine(AbstractShape):
    """rho = -depth sin(2 pi theta / width) in the gap, 0 on the roller (eq. 8)."""

    id: ClassVar[str] = "gated-sine"
    formula: ClassVar[str] = "ρ = −Δr sin(2πθ/θ_s) in the gap, 0 on the roller"

    def __call__(self, angle, gap):
        into, inside, width = _inside(angle, gap)
        return jnp.where(inside, -gap.depth * jnp.sin(2 * math.pi * into / width), 0.0)


class ContinuousSine(AbstractShape):
    """rho = -depth sin(n theta / eta) everywhere (eq. 11 as printed; not periodic in the pitch)."""

    id: ClassVar[str] = "continuous-sine"
    formula: ClassVar[str] = "ρ = −Δr sin(nθ/η) everywhere"

    def __call__(self, angle, gap):
        eta = jnp.where(gap.roundness > 0, gap.roundness, 1.0)
        return -gap.depth * jnp.sin(gap.rollers * angle / eta)


class HalfSine(AbstractShape):
    """rho = -depth sin(pi theta / width) in the gap: the sphere only falls in."""

    id: ClassVar[str] = "half-sine"
    formula: ClassVar[str] = "ρ = −Δr sin(πθ/θ_s) in the gap, 0 on the roller"

    def __call__(self, angle, gap):
        into, inside, width = _inside(angle, gap)
        return jnp.where(inside, -gap.depth * jnp.sin(math.pi * into / width), 0.0)


class Rollers(AbstractShape):
    """The sphere pivots on the nearer gap edge: law of cosines over the angle to that edge.

    rho = r_b (cos a - 1) + R (sqrt(1 - (r_b/R)^2 sin^2 a) - 1), a the angle to the nearer edge;
    the geometry that eqs. 4-6 describe, with a kink at mid-gap.
    """

    id: ClassVar[str] = "rollers"
    formula: ClassVar[str] = "ρ from the law of cosines over the nearer gap edge"

    def __call__(self, angle, gap):
        into, inside, _ = _inside(angle, gap)
        nearer = jnp.minimum(into, gap.width - into)
        return jnp.where(inside, -gap.sagitta(jnp.where(inside, nearer, 0.0)), 0.0)


class DualRow(AbstractShape):
    """Two rows, half a pitch apart (section 2.1): rho = 0, the contact jumps sideways.

    `lateral` is the contact's offset along the wheel's axle: it is on the second row while the
    first row's gap passes, so it switches where the two rollers overlap.
    """

    row_spacing: Float[Array, ""]  # m, distance of the rows along the axle

    id: ClassVar[str] = "dual-row"
    formula: ClassVar[str] = "ρ = 0; the contact point jumps by the row spacing"

    def __call__(self, angle, gap):
        return jnp.zeros_like(angle * gap.pitch)

    def lateral(self, angle, gap) -> Float[Array, ""]:
        """Offset of the contact from the wheel's mid-plane along the axle, m."""
        quarter = gap.pitch / 4
        from_gap = wrapped(angle - gap.width / 2 + quarter, gap.pitch)
        return jnp.where(from_gap < 2 * quarter, -0.5, 0.5) * self.row_spacing

    def switch(self, angle, gap):
        """The angle next to `angle` at which the contact changes its row, rad."""
        half, first = gap.pitch / 2, gap.width / 2 - gap.pitch / 4
        return first + half * jnp.round((angle - first) / half)


def is_turn(period: float) -> bool:
    """Whether a period (rad) is a turn of the wheel."""
    return math.isclose(period, 2 * math.pi, rel_tol=1e-6)


class TableShape(AbstractShape):
    """A measured profile: periodic cubic spline through (theta, rho) over `period`."""

    knots: Float[Array, " k"]  # rad, first 0, last the period
    coefficients: Float[Array, "k-1 4"]  # m, in powers of (theta - knot), constant first
    whole_turn: bool = eqx.field(static=True)  # whether the period is a turn, else it is one pitch

    id: ClassVar[str] = "table"
    formula: ClassVar[str] = "ρ from a periodic cubic spline through the measured table"

    def __call__(self, angle, gap):
        into = wrapped(angle, self.knots[-1])
        piece = jnp.clip(
            jnp.searchsorted(self.knots, into, side="right") - 1, 0, len(self.knots) - 2
        )
        c, u = self.coefficients[piece], into - self.knots[piece]
        return c[0] + u * (c[1] + u * (c[2] + u * c[3]))

    @classmethod
    def fit(cls, theta, rho, period: float) -> "TableShape":
        """Spline through samples `theta` (rad, increasing, within one `period`) and `rho` (m).

        Fitted twice: the first fit tells rho at 0, the second has a knot there, and so gives the
        same numbers again of its own knots.
        """
        from scipy.interpolate import CubicSpline

        theta, rho = np.asarray(theta, float), np.asarray(rho, float)
        x = np.append(theta, theta[0] + period)
        through = CubicSpline(x, np.append(rho, rho[0]), bc_type="periodic")
        inside, near = np.mod(theta, period), 0.01 * np.median(np.diff(x))
        others = np.unique(inside[(inside > near) & (inside < period - near)])
        knots = np.concatenate([[0.0], others, [period]])
        at = np.where(knots[:-1] < theta[0], knots[:-1] + period, knots[:-1])
        again = CubicSpline(knots, np.append(through(at), through(at[0])), bc_type="periodic")
        return cls(jnp.asarray(knots), jnp.asarray(again.c[::-1].T), is_turn(period))


PROFILES: dict[str, type[AbstractShape]] = {
    law.id: law for law in (GatedSine, ContinuousSine, HalfSine, Rollers, DualRow, TableShape)
}
