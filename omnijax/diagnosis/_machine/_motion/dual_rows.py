"""Which row of a dual-row wheel touches the sphere, where the measured angle does not tell.

At a switch the driven axis jumps, and the wheel's speed with it.  Where both speeds lead to the
switch the contact stays there, changing its row all the time (a sliding mode): the wheel stands,
and the sphere turns as if the axis lay between both.  There, and where the wheel turns back just
behind a switch, an error of the angle below an encoder's noise means the wrong row for so long that
it is seen; Omega tells the row instead.
"""

import jax
import numpy as np

from ...._programs import kept
from ....dynamics import spin_axes
from ....laws import DualRow
from ....rig import Rig


def two_rows(rig: Rig) -> bool:
    """Whether a wheel has two rows."""
    return any(isinstance(profile, DualRow) for profile in rig.profiles)


def shares_behind(
    rig: Rig, theta: np.ndarray, radius: np.ndarray, Omega: np.ndarray, blur: np.ndarray,
    step: float,
) -> np.ndarray:  # fmt: skip
    """Share of each moment (t, n) that a dual-row wheel spends behind the switch it is at.

    NaN where its angle of `theta` (t, n) tells: further than `blur` (n,) rad from every switch.
    `radius` (t, n) m is the one at which the wheels roll, `Omega` (t, 3) rad/s, `step` s.
    """
    shares = np.full(theta.shape, np.nan)
    for i, (switch, quarter) in _switches(rig, theta).items():
        apart = theta[:, i] - switch
        near = np.abs(apart) < min(blur[i], quarter)
        ends = np.flatnonzero(np.diff(near, prepend=False, append=False))
        if not len(ends):
            continue
        before, after = (
            np.einsum("tj,tj->t", axes, Omega) * float(rig.sphere.radius) / radius[:, i]
            for axes in _both_rows(rig, theta, i, switch, quarter)
        )
        for first, last in ends.reshape(-1, 2):
            part = slice(first, last)
            shares[part, i] = _passed(float(apart[first]), before[part], after[part], step)
    return shares


def driven_axes(rig: Rig, theta: np.ndarray, shares: np.ndarray | None) -> np.ndarray:
    """Driven axes (t or 1, n, 3) at angles (t, n); with `shares`, between those of both rows."""
    if not two_rows(rig):
        return np.asarray(rig.wheels.spin_axis)[None]
    axes = np.array(_axes_along(rig.with_effects(()), theta))
    if shares is None:
        return axes
    for i, (switch, quarter) in _switches(rig, theta).items():
        at = np.isfinite(shares[:, i])
        if at.any():
            before, after = (x[at] for x in _both_rows(rig, theta, i, switch, quarter))
            axes[at, i] = before + shares[at, i, None] * (after - before)
    return axes


def _switches(rig: Rig, theta: np.ndarray) -> dict[int, tuple[np.ndarray, float]]:
    """By dual-row wheel the switch (t,) next to its angles of (t, n), and a quarter pitch, rad."""
    out = {}
    for i, profile in enumerate(rig.profiles):
        if isinstance(profile, DualRow):
            gap = jax.tree.map(lambda x, i=i: x[i], rig.gaps)
            out[i] = np.asarray(profile.switch(theta[:, i], gap)), float(gap.pitch) / 4
    return out


def _both_rows(rig: Rig, theta: np.ndarray, wheel: int, switch: np.ndarray, quarter: float):
    """Axes (t, 3) that a wheel drives before a switch (t,) and those behind it."""
    for side in (-1, 1):
        at = theta.copy()
        at[:, wheel] = switch + side * quarter
        yield np.asarray(_axes_along(rig.with_effects(()), at))[:, wheel]


@kept
def _axes_along(rig: Rig, theta):
    return jax.vmap(lambda angle: spin_axes(rig, angle))(theta)


def _passed(apart: float, before: np.ndarray, after: np.ndarray, step: float) -> np.ndarray:
    """Shares (t,) behind a switch of a wheel that begins `apart` rad from it.

    It turns at `before` (t,) rad/s before the switch and at `after` (t,) rad/s behind it.
    """
    behind, shares = apart > 0, np.empty(len(before))
    for k, rates in enumerate(zip(before.tolist(), after.tolist(), strict=True)):
        left, spent = step, 0.0
        while left > 0:
            if apart == 0 and rates[0] > 0 > rates[1]:
                spent += left * rates[0] / (rates[0] - rates[1])
                break
            behind = apart > 0 if apart else rates[behind] > 0
            rate = rates[behind]
            reach = -apart / rate if apart * rate < 0 else np.inf
            lasts = min(left, reach)
            apart = 0.0 if lasts == reach else apart + rate * lasts
            spent += behind * lasts
            left -= lasts
        shares[k] = spent / step
    return np.concatenate([shares[:1], (shares[1:] + shares[:-1]) / 2])
