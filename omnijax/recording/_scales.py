"""Wrong units: channels that are a thousand times, or degrees and rpm, off what the rig allows.

Four relations hold in every run, whatever effect hides in it: the wheels' angles and the sphere's
angle roll on each other (R s.Omega = r omega), torques turn the sphere, dR has the size of a gap,
and the platform's mean acceleration is that of the force on the whole machine.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy import special

from ._columns import channels, group_of, unit_of
from ._recording import Fault, Recording
from ._scale_factors import FACTORS, pieces
from ._scale_sizes import accelerations, gap_sizes, siblings

UNIT_NEAR = 5.0  # times off a thousand that torques may be, since friction is fitted beside them
SURE = 5.0  # sigma by which a factor of torques or of the force stands out
CLOSE = 0.1  # relative misfit of the rolling relation that a real machine stays below


class _Turned(NamedTuple):
    """What wheels (n, w) and sphere (n, 3) turned by in pieces, m of rolled length and rad."""

    wheels: np.ndarray
    sphere: np.ndarray
    axes: np.ndarray  # (w, 3), m of a wheel's rolled length per rad of the sphere

    @property
    def rolls(self) -> bool:
        """Whether either turned at all."""
        return max(_rms(self.wheels), _rms(self.sphere)) >= 1e-3

    def misfit(self, theta_scale, omega_scale) -> float:
        """The worst wheel's relative misfit with the columns scaled."""
        left, right = (self.sphere * omega_scale) @ self.axes.T, self.wheels * theta_scale
        size = _rms(left, 0) + _rms(right, 0) + 1e-4
        return float(np.max(_rms(left - right, 0) / size))


def mend_units(run: Recording, rig: Any, declared: set[str]) -> None:
    """Find columns in a wrong unit, bring them to SI and say so in `run.faults`.

    Columns or groups in `declared` have their unit from the user: they are named but left alone.
    """
    for check in (_rolling, siblings, gap_sizes, accelerations, _torques):
        for columns, factor in check(run, rig):
            _mend(run, columns, factor, declared)


def _mend(run: Recording, columns: tuple[str, ...], factor: float, declared: set[str]) -> None:
    first = next(iter(columns))
    group = group_of(first)
    whole = len(columns) > 1
    units = {name: f for name, f in FACTORS[group].items() if 0.4 < factor / f < 2.5}
    size = f"{factor:.3g} times too large" if factor > 1 else f"{1 / factor:.3g} times too small"
    name = group if whole else first
    if {*columns, group} & declared or not units:
        use = (
            "it is used as it stands" if not units else "it is used in the unit that NAME.toml says"
        )
    else:
        unit, exact = min(units.items(), key=lambda item: abs(np.log(factor / item[1])))
        for column in set(columns) & set(run.channels):
            run.channels[column] = run.channels[column] / exact
        use = f'it is read as {unit}; `units.{name} = "{unit_of(group)}"` in NAME.toml keeps it'
    what = f"the {'group' if whole else 'channel'} looks {size} for {unit_of(group)} (wrong unit?)"
    fault = Fault(run.path.name, name, (), "unit", what, use)
    if fault not in run.faults:  # two relations may say the same of a column that is left alone
        run.faults.append(fault)


def _rolled(run: Recording) -> np.ndarray:
    """Angle that the sphere turned about each axis, rad, (samples, 3); NaN samples add nothing."""
    omega = np.nan_to_num(run.group("Omega"))
    steps = 0.5 * (omega[1:] + omega[:-1]) * np.diff(run.time)[:, None]
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def _rolling(run: Recording, rig: Any):
    """theta and Omega that do not roll on each other, and the factor that makes them.

    Both sides are compared over half-second pieces; the single column or group is taken whose
    change of unit removes the misfit.
    """
    turned = _turned(run, rig)
    if turned is None or not turned.rolls or turned.misfit(1.0, 1.0) < 2 * CLOSE:
        return
    best = min(_hypotheses(run.wheels), key=lambda h: turned.misfit(h[2], h[3]))
    if turned.misfit(best[2], best[3]) < CLOSE:
        yield best[0], best[1]


def _turned(run: Recording, rig: Any) -> _Turned | None:
    """Wheels and sphere in the pieces where all angles are known; None where too few are."""
    if not {"theta", "Omega"} <= set(run.groups):
        return None
    stride = pieces(run)
    theta = run.group("theta")[::stride]
    turned = np.diff(np.where(np.isfinite(theta), theta, np.nan), axis=0)
    good = np.isfinite(turned).all(axis=1)
    if good.sum() < 4 or not np.isfinite(run.group("Omega")).mean() > 0.9:
        return None
    ratio = np.asarray(rig.wheel_radius / rig.sphere.radius)
    rolled = np.diff(_rolled(run)[::stride], axis=0)
    return _Turned(turned[good] * ratio, rolled[good], np.asarray(rig.wheels.spin_axis))


def _rms(values: np.ndarray, axis: int | None = None):
    return np.sqrt(np.mean(values**2, axis=axis))


def _hypotheses(wheels: int):
    """(columns, factor, scale of theta, scale of Omega) of every change of one column or group."""
    for group, size in (("theta", wheels), ("Omega", 3)):
        names = channels(group, wheels)
        groups = [
            (names, np.ones(size, bool)),
            *_one_by_one(names),
        ]
        for factor in FACTORS[group].values():
            for columns, mask in groups:
                scale, one = (
                    np.where(mask, 1 / factor, 1.0),
                    np.ones(3 if group == "theta" else wheels),
                )
                yield (columns, factor, *((scale, one) if group == "theta" else (one, scale)))


def _one_by_one(names: tuple[str, ...]):
    return (((name,), np.array([name == n for n in names])) for name in names)


def _torques(run: Recording, rig: Any):
    """Torques that are about a thousand times off what the sphere's turning shows.

    A wheel without torque says nothing.
    """
    factors, given = _torque_factors(run, rig), np.any(run.torque != 0, axis=0)
    if factors is None:
        return
    sure = np.where(given, factors, 1.0)
    off = np.abs(np.abs(np.log10(sure)) - 3) < np.log10(UNIT_NEAR)
    names = channels("torque", run.wheels)
    if given.any() and off[given].all():
        yield names, 1e3 if sure[given][0] < 1 else 1e-3
        return
    for i in np.flatnonzero(off):
        yield (names[i],), 1e3 if sure[i] < 1 else 1e-3


def _torque_factors(run: Recording, rig: Any) -> np.ndarray | None:
    """By wheel what its torque turns over what it should, 1 where that is not sure.

    Friction and drag are left free.  None where the run does not tell the wheels apart.
    """
    if "Omega" not in run.groups:
        return None
    stride = pieces(run)
    gained = np.diff(run.group("Omega")[::stride], axis=0)
    columns = np.concatenate([_given(run, rig, stride), _resisted(run, stride)], axis=2)
    good = np.isfinite(gained).all(axis=1)
    columns, target = columns[good].reshape(-1, run.wheels + 6), gained[good].ravel()
    size = np.sqrt(np.sum(columns**2, axis=0)) + 1e-300
    if len(target) < 2 * len(size):
        return None
    left, strength, right = np.linalg.svd(columns / size, full_matrices=False)
    rank = int(np.sum(strength > 1e-9 * strength[0]))
    if rank < run.wheels:
        return None
    inverse = right[:rank].T / strength[:rank]
    factors = inverse @ (left[:, :rank].T @ target)
    free = len(target) - rank
    scatter = np.linalg.norm(target - columns / size @ factors) / np.sqrt(free)
    sigma = scatter * np.linalg.norm(inverse, axis=1)
    surely = special.stdtrit(free, special.ndtr(SURE))  # few rows tell their own scatter badly
    factors, sigma = ((x / size)[: run.wheels] for x in (factors, sigma))
    return np.where(factors > surely * sigma, factors, 1.0)


def _given(run: Recording, rig: Any, stride: int) -> np.ndarray:
    """Change of Omega in each piece by each wheel's torque alone, (pieces, 3, wheels)."""
    axes = np.asarray(rig.wheels.spin_axis)
    lever = np.asarray(rig.sphere.radius / rig.wheel_radius)
    inertia = np.asarray(rig.sphere.inertia_matrix)
    inertia = inertia + axes.T @ np.diag(np.asarray(rig.wheels.inertia) * lever**2) @ axes
    per_wheel = np.linalg.solve(inertia, axes.T * lever)  # rad/s^2 per N m
    impulse = np.cumsum(run.torque * np.gradient(run.time)[:, None], axis=0)[::stride]
    return np.einsum("ti,ai->tai", np.diff(impulse, axis=0), per_wheel)


def _resisted(run: Recording, stride: int) -> np.ndarray:
    """What dry friction and drag about each axis take in each piece, (pieces, 3, 6)."""
    omega = np.nan_to_num(run.group("Omega"))
    terms = np.stack([np.tanh(omega / 0.01), omega], axis=2) * np.gradient(run.time)[:, None, None]
    pieces = np.diff(np.cumsum(terms, axis=0)[::stride], axis=0)
    return np.concatenate([pieces[:, :, :1] * np.eye(3), pieces[:, :, 1:] * np.eye(3)], axis=2)
