"""The machine, the designs and the converged references that every tool is held against."""

import numpy as np

R, RB, N, M, MW, KP, CM = 1.22, 0.0758, 14, 5.0, 0.25, 1e4, 50.0
SPEEDS = np.array([0.1, 1.2, 0.3])  # rad/s
TORQUE = np.array([0.02, 0.1, 0.05])  # N m
DURATION, SAMPLES = 2.0, 1000
STEP = DURATION / SAMPLES
MANY = 1_000_000  # designs in all, for which ours compiles its programs
DAMPINGS = {"transient C=120": 120.0, "transient C=8500": 8500.0, "transient C=20000": 20000.0}


def designs(count: int, damping: float) -> np.ndarray:
    """Rows (eta, K, k, C): roundness 0.2 to 0.6, stiffness spread by the golden ratio."""
    i = np.arange(count)
    stiffness = 188208.0 * (0.5 + 1.5 * np.mod(0.6180339887498949 * i, 1.0))
    columns = [
        0.2 + 0.4 * (i + 0.5) / count,
        stiffness,
        np.full(count, 1e6),
        np.full(count, damping),
    ]
    return np.stack(columns, axis=1)


def gap(eta):
    """Gap angle and depth."""
    width = 2 * np.pi * eta / N
    q = RB / R * np.sin(width / 2)
    return width, R * q * q / (1 + np.sqrt(1 - q * q)) + 2 * RB * np.sin(width / 4) ** 2


def shape(angle, eta):
    """rho in m."""
    width, depth = gap(eta)
    into = np.mod(angle, 2 * np.pi / N)
    return np.where(into < width, -depth * np.sin(2 * np.pi / width * into), 0.0)


def matrices(K, k, C):
    """dy/dt = A y + b rho for y = (x, Delta, p, pi) of one contact."""
    A = np.array(
        [
            [0, 0, 1 / M, 0],
            [0, 0, 0, 1 / MW],
            [-K - KP, K, -C / M, C / MW],
            [K, -K - k, C / M, -(C + CM) / MW],
        ]
    )
    v = C * (1 / M + 1 / MW)
    return A, np.array([C / M, -C / MW, K - C * v, -K + C * v + CM * C / MW])


def response(design, time):
    """dR at `time`, (3, t): modes, each passage's sine in closed form, edge by edge."""
    eta, K, k, C = design
    width, depth = gap(eta)
    A, b = matrices(K, k, C)
    pole, V = np.linalg.eig(A)
    strength = V[0] * np.linalg.solve(V, b.astype(complex))
    out = []
    for speed in SPEEDS:
        tau, period, nu = width / speed, 2 * np.pi / N / speed, 2 * np.pi / width * speed
        free = np.zeros(4, complex)  # at the last edge
        coefficient = depth * strength / (pole**2 + nu**2)
        x = np.zeros(len(time))
        for j in range(int(time[-1] / period) + 1):
            since = time - j * period
            here = (since >= 0) & (since < tau)
            z = (free - coefficient * nu)[:, None] * np.exp(np.outer(pole, since[here]))
            z = z + coefficient[:, None] * (
                np.outer(pole, np.sin(nu * since[here])) + nu * np.cos(nu * since[here])
            )
            x[here] = z.sum(0).real
            free = (free - coefficient * nu) * np.exp(pole * tau) + coefficient * nu
            here = (since >= tau) & (since < period)
            x[here] = (free[:, None] * np.exp(np.outer(pole, since[here] - tau))).sum(0).real
            free = free * np.exp(pole * (period - tau))
        out.append(x)
    return np.array(out)


TIMES = STEP * np.arange(1, SAMPLES + 1)


def figures(dR) -> np.ndarray:
    """RMS and peak of |dR|; dR (..., 3, t)."""
    square = (np.asarray(dR) ** 2).sum(-2)
    return np.stack([np.sqrt(square.mean(-1)), np.sqrt(square.max(-1))], -1)


def reference(rows) -> np.ndarray:
    """RMS and peak of every design, from rest."""
    return np.array([figures(response(row, TIMES)) for row in rows])


def reference_gradient(rows, dR=lambda row: response(row, TIMES)) -> np.ndarray:
    """(designs, 2, 4): sixth-order differences of RMS and peak, this at its own sample.

    `dR(row)` (3, t) are the samples.
    """
    weights, out = {1: 0.75, 2: -0.15, 3: 1 / 60}, np.zeros((len(rows), 2, 4))
    for i, row in enumerate(rows):
        top = int(np.argmax((dR(row) ** 2).sum(0)))

        def value(d, top=top):
            square = (dR(d) ** 2).sum(0)
            return np.array([np.sqrt(square.mean()), np.sqrt(square[top])])

        for p in range(4):
            way = np.zeros(4)
            way[p] = row[p] * 1e-3
            total = sum(
                w * (value(row + m * way) - value(row - m * way)) for m, w in weights.items()
            )
            out[i, :, p] = total / way[p]
    return out


def error(found, expected) -> float:
    """Largest relative error over designs and figures; infinite where a solver gave up."""
    with np.errstate(invalid="ignore"):
        reached = float(np.max(np.abs(np.asarray(found) / expected - 1)))
    return reached if np.isfinite(reached) else np.inf


def gradient_error(found, expected) -> float:
    """Largest error over the largest derivative of that figure in that parameter."""
    scale = np.abs(expected).max(0, keepdims=True)
    return float(np.max(np.abs(np.asarray(found) - expected) / scale))
