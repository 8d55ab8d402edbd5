"""Rigs of any layout with unlike wheels, in numpy alone: the coupled elastic model, closed form.

A design is (eta, K, k, C) as in `_problem`; every wheel has K and C of its own about them.  At
constant speeds, with an isotropic sphere and no resistance, the drive forces are those that the
wheel's shape asks for, f = G rho', R [axes] f = I_s dOmega/dt, and everything is linear in the
deflections z = (dR, Delta_1 ... Delta_n) with the inputs rho_i:

    z'' = A0 z + A1 z' + b0 rho + b1 rho'

which with z' = w + b1 rho needs no rate of rho.
"""

import ctypes
from typing import NamedTuple

import numpy as np

from . import _c
from . import _problem as problem

PLATFORM = 5.0  # kg, without wheels
INERTIA = 4.96  # kg m^2, of the sphere
SPREAD = 0.2  # of the wheels' stiffness and damping about the design's
SPEEDS = np.array([0.1, 1.2, 0.3, 0.7, 0.5, 0.9])  # rad/s
SKEW = {3: 0.0, 4: 0.2, 6: 0.1}  # rad, by which layouts of 3, 4 and 6 wheels are irregular


class Layout(NamedTuple):
    """Directions of the wheels, (n, 3)."""

    normal: np.ndarray
    drive: np.ndarray


def layout(count: int) -> Layout:
    """Wheels around the sphere, 45 degrees from the vertical, more or less irregular."""
    i, skew = np.arange(count), SKEW[count]
    around = 2 * np.pi * i / count + skew * np.sin(1.0 + 2.3 * i)
    zenith = np.pi / 4 + skew * 0.4 * np.cos(0.7 + 1.9 * i)
    into = np.stack([np.cos(around), np.sin(around), 0 * around], 1)
    normal = np.cos(zenith)[:, None] * [0, 0, 1] - np.sin(zenith)[:, None] * into
    drive = np.stack([-np.sin(around), np.cos(around), 0 * around], 1)
    return Layout(normal, drive)


def stiffness(count: int, row) -> tuple[np.ndarray, np.ndarray]:
    """K and C of every wheel; `row` may be traced."""
    i = np.arange(count)
    up, down = 1 + SPREAD * np.sin(1.3 + 2.1 * i), 1 + SPREAD * np.cos(0.4 + 1.7 * i)
    return row[1] * up, row[3] * down


def matrices(count: int, row) -> tuple[np.ndarray, np.ndarray]:
    """A (2 m, 2 m) and B (2 m, n) of (z, w), m = 3 + n."""
    r, (K, C), k = layout(count).normal, stiffness(count, row), row[2]
    n, m = count, 3 + count
    to_contact = np.hstack([r, -np.eye(n)])  # delta = to_contact z - rho
    pull = np.hstack([r, np.zeros((n, n))])  # r . dR
    sink = np.hstack([np.zeros((n, 3)), np.eye(n)])  # Delta

    # generalised forces on z at a resting platform; tension T = K delta + C delta'
    stiff = -to_contact.T @ (K[:, None] * to_contact) - pull.T @ (problem.KP * pull)
    stiff -= sink.T @ (k * sink)
    damp = -to_contact.T @ (C[:, None] * to_contact) - sink.T @ (problem.CM * sink)
    # (platform + wheels across their normals) A_l = sum of mount and closure forces
    heavy = PLATFORM * np.eye(3) + problem.MW * (n * np.eye(3) - r.T @ r)
    carried = np.linalg.solve(heavy, r.T @ (k * sink + problem.KP * pull))
    carried_rate = np.linalg.solve(heavy, r.T @ (problem.CM * sink))
    mass = np.concatenate([np.full(3, problem.M), np.full(n, problem.MW)])
    ride = np.vstack([np.eye(3), r])  # acceleration of z's frame where the platform moves
    A0 = stiff / mass[:, None] - ride @ carried
    A1 = damp / mass[:, None] - ride @ carried_rate
    b0, b1 = to_contact.T * K / mass[:, None], to_contact.T * C / mass[:, None]
    drive = layout(n).drive
    axes = np.cross(-r, drive).T  # (3, n)
    turn = np.linalg.pinv(axes.T) * SPEEDS[:n] / problem.R  # dOmega/dt per rho'
    push = drive.T @ np.linalg.pinv(problem.R * axes) @ (INERTIA * turn)  # sum of f v
    b1 = b1 + ride @ np.linalg.solve(heavy, push)
    b1[:3] += push / problem.M
    A = np.block([[np.zeros((m, m)), np.eye(m)], [A0, A1]])
    return A, np.vstack([b1, b0 + A1 @ b1])


def modes(count: int, rows) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poles (b, 2 m), what dR shows of them (b, 3, 2 m), what rho gives to them (b, 2 m, n)."""
    made = [matrices(count, row) for row in rows]
    A, B = np.array([x[0] for x in made]), np.array([x[1] for x in made])
    unit = np.sqrt(np.abs(A[:, :, :]).sum(2) / np.maximum(np.abs(A).sum(1), 1e-300))
    A, B = A * unit[:, None, :] / unit[:, :, None], B / unit[:, :, None]
    pole, vector = np.linalg.eig(A)
    show = (vector * unit[:, :, None])[:, :3]
    return pole, show, np.linalg.solve(vector, B.astype(complex))


def response(count: int, row, time) -> tuple[np.ndarray, np.ndarray]:
    """dR and its rate (3, t) from rest: every passage's sinusoid and every past edge, summed."""
    (pole,), (show,), (give,) = (x for x in modes(count, np.asarray(row)[None]))
    width, depth = problem.gap(row[0])
    z, dz = np.zeros((2, len(pole), len(time)), complex)
    for i, speed in enumerate(SPEEDS[:count]):
        inside, period, nu = width / speed, 2 * np.pi / problem.N / speed, 2 * np.pi / width * speed
        since = np.mod(time, period)
        here = since < inside
        q = (depth * give[:, i] / (pole**2 + nu**2))[:, None]
        p = pole[:, None]
        z += np.where(here, q * (p * np.sin(nu * since) + nu * np.cos(nu * since)), 0)
        dz += np.where(here, q * nu * (p * np.cos(nu * since) - nu * np.sin(nu * since)), 0)
        for j in range(int(time[-1] / period) + 1):
            for edge, sign in ((j * period, -1), (j * period + inside, 1)):
                free = sign * nu * q * np.exp(p * np.maximum(time - edge, 0)) * (time >= edge)
                z += free
                dz += p * free
    return (show @ z).real, (show @ dz).real


TIMES = problem.STEP * np.arange(problem.SAMPLES + 1)


def figures(count: int, rows, refined: bool = False) -> np.ndarray:
    """RMS and peak of |dR| over the samples, the start among them.

    `refined`: the peak of the cubic of |dR|^2 and its rate at the samples beside the largest.
    """
    out = []
    for row in rows:
        dR, rate = response(count, row, TIMES)
        square, slope = (dR**2).sum(0), 2 * (dR * rate).sum(0)
        top = square.max()
        if refined:
            at = int(np.argmax(square))
            u = np.linspace(0, 1, 2001)
            for i in (max(at - 1, 0), min(at, len(square) - 2)):
                top = max(top, _hermite(square[i : i + 2], problem.STEP * slope[i : i + 2], u))
        out.append([np.sqrt(square.mean()), np.sqrt(top)])
    return np.array(out)


def _hermite(y, d, u) -> float:
    """Largest value on [0, 1], by a grid and one parabola about its largest point."""
    c2, c3 = 3 * (y[1] - y[0]) - 2 * d[0] - d[1], 2 * (y[0] - y[1]) + d[0] + d[1]
    values = y[0] + u * (d[0] + u * (c2 + u * c3))
    i = int(np.argmax(values))
    if i in (0, len(u) - 1):
        return float(values[i])
    before, here, after = values[i - 1 : i + 2]
    return float(here - (after - before) ** 2 / (8 * (before - 2 * here + after)))


class Program:
    """The C program on designs whose modes are laid out for it."""

    def __init__(self, library, count: int, rows):
        self._library, self._of, self._count = library, f"{3 + count}_{count}", count
        self.size, self._lanes = len(rows), library.lanes()
        pole, show, give = modes(count, rows)
        kind, first, second = _pairs(pole)
        take = np.take_along_axis
        a, b = take(pole, first, 1), take(pole, second, 1)
        ca, cb = (take(show, x[:, None], 2) for x in (first, second))
        ba, bb = (take(np.swapaxes(give, 1, 2), x[:, None], 2) for x in (first, second))
        complex_ = kind[:, None] > 0
        width, depth = problem.gap(np.asarray(rows)[:, :1] * np.ones(count))
        parts = (
            kind, a.real, np.where(kind > 0, a.imag, b.real),
            np.where(complex_, 2 * ca.real, ca.real), np.where(complex_, -2 * ca.imag, cb.real),
            ba.real, np.where(complex_, ba.imag, bb.real),
            width, depth, np.full_like(width, 2 * np.pi / problem.N),
            np.broadcast_to(SPEEDS[:count], width.shape),
        )  # fmt: skip
        self.parts = [_aligned(x, self._lanes) for x in parts]
        self.out, self.groups = np.zeros((self.size, 2)), self.size // self._lanes

    def __call__(self) -> np.ndarray:
        """RMS and peak of |dR| over the samples of a run from rest."""
        self._run("general", problem.SAMPLES, ctypes.c_double(problem.STEP))
        return self.out

    def steady(self, points: int, starts: int) -> np.ndarray:
        """Long-run RMS and supremum, from so many points a segment and directions."""
        shape = (self._lanes, 6 * self._count * (points + 1))
        room, aims = _aligned(np.zeros(shape), self._lanes), np.ravel(directions(starts))
        self._run("steady", points, starts, _c.pointer(aims), _c.pointer(room))
        return self.out.copy()

    def _run(self, name: str, *arguments) -> None:
        function = getattr(self._library, f"{name}_{self._of}")
        arrays = [_c.pointer(x) for x in self.parts]
        function(self.groups, *arguments, *arrays, _c.pointer(self.out))


def directions(count: int) -> np.ndarray:
    """Evenly over a sphere (count, 3): along a spiral by the golden angle."""
    i = np.arange(count)
    height, around = 1 - (2 * i + 1) / count, np.pi * (3 - np.sqrt(5)) * i
    level = np.sqrt(1 - height**2)
    return np.stack([level * np.cos(around), level * np.sin(around), height], 1)


def _pairs(pole) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Complex pairs first, then real poles two by two: kind, first and second (b, m)."""
    kind, first, second = [], [], []
    for row in pole:
        upper, real = np.flatnonzero(row.imag > 0), np.flatnonzero(row.imag == 0)
        kind.append([1.0] * len(upper) + [0.0] * (len(real) // 2))
        first.append([*upper, *real[0::2]])
        second.append([*upper, *real[1::2]])
    return np.array(kind), np.array(first), np.array(second)


def _aligned(x, lanes: int) -> np.ndarray:
    """(b, ...) as (groups, ..., lanes), on a boundary of 64 bytes."""
    grouped = np.moveaxis(np.reshape(x, (len(x) // lanes, lanes, -1)), 1, 2)
    room = np.empty(grouped.size + 8)
    begin = (-room.ctypes.data // 8) % 8
    out = room[begin : begin + grouped.size]
    out[:] = grouped.ravel()
    return out
