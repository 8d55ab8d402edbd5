"""What the encoders' noise leaves in dR and a: a covariance of low rank.

The elastic model is driven by smoothed angles.  Their error is smooth too: with S the smoother of
`smooth.py`, its covariance is sigma^2 S (a white-jerk angle's posterior).  Where a wheel's shape
has a slope the error moves the sphere, as an input rho'(theta) e that the elastic model answers
with G.  So whitened dR and a have the covariance I + B B^T, B = sigma G rho' S^(1/2), of a rank far
below their number.  Scores that took them for white called encoder noise an effect.

Noise of a colour, of covariance sigma^2 C, leaves sigma^2 (S C S + S (I - S)): what the smoother
passes of it, which of a walk is nearly all, and what it takes off the angle itself.
"""

import functools

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded

from ....recording import channels
from ..._recursion import recursion
from ..._search import Spectrum, to_waves
from ..._settings import SETTINGS
from .._elastic import OUTPUTS, OutputModes, hold_weights, real_rows
from .._motion import penalty
from ..runs import Run

MOST_MODES = SETTINGS.encoders.most_modes
LEAST_GAIN = SETTINGS.encoders.least_gain
CHUNK = 16  # modes pushed through the elastic model at once
PARTS = SETTINGS.encoders.parts
LEAST_VARIANCE = SETTINGS.encoders.least_variance
SPARE_MODES = SETTINGS.encoders.spare_modes


@functools.lru_cache(maxsize=16)
def smoother_modes(samples: int, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal modes (samples, k) of the smoother (I + ratio D^T D)^-1, and its gains (k,)."""
    ratio = max(ratio, (1 / LEAST_GAIN - 1) * (samples / (np.pi * MOST_MODES)) ** 6)
    edge = (1 / LEAST_GAIN - 1) / ratio  # (2 sin(w/2))^6 of the last mode that counts
    count = min(samples, int(samples / np.pi * edge ** (1 / 6)) + SPARE_MODES)
    matrix = ratio * penalty(samples)
    matrix[3] += 1.0
    factor = (cholesky_banded(matrix), False)
    basis = np.random.default_rng(0).normal(size=(samples, count))
    for _ in range(2):
        basis = np.linalg.qr(cho_solve_banded(factor, basis))[0]
    small = basis.T @ cho_solve_banded(factor, basis)
    gains, vectors = np.linalg.eigh((small + small.T) / 2)
    kept = gains > LEAST_GAIN
    return basis @ vectors[:, kept], np.minimum(gains[kept], 1.0)


def smoothed_errors(samples: int, ratio: float, spectrum: Spectrum | None) -> np.ndarray:
    """Columns (samples, k), a root of the covariance of a smoothed angle's error over sigma^2.

    `spectrum` is that of the angle's noise in waves, over sigma^2; None where it is white.
    """
    modes, gains = smoother_modes(samples, ratio)
    if spectrum is None:
        return modes * np.sqrt(gains)
    passed = np.sqrt(spectrum.power(samples))[:, None] * to_waves(modes) * gains
    values, vectors = np.linalg.eigh(passed.T @ passed + np.diag(gains * (1 - gains)))
    return modes @ (vectors * np.sqrt(np.maximum(values, 0.0)))


def walk_modes(samples: int, step: float, scatter: float) -> tuple[np.ndarray, np.ndarray]:
    """Modes and variances of the integral of white noise of 1-sigma `scatter` at the samples."""
    count = min(samples, MOST_MODES // 2)
    k = np.arange(count) + 0.5
    time = (np.arange(samples) + 0.5) / samples
    modes = np.sqrt(2 / samples) * np.sin(np.pi * np.outer(time, k))
    return modes, (scatter * step * samples / (np.pi * k)) ** 2


def turned_errors(run: Run, axis: np.ndarray, sigma: float) -> np.ndarray:
    """Columns (samples, k) in rad, a root of the covariance of an integral of Omega about an axis.

    `axis` (3,) is that of a wheel's spin, `sigma` the group's 1-sigma in rad/s; of noise of a
    colour a bias too that nobody knows.
    """
    n, level = run.samples, np.broadcast_to(run.level("Omega"), 3)
    modes, variances = walk_modes(n, run.step, sigma)
    f = (np.arange(len(variances)) + 0.5) / (2 * n)
    power, bias = np.zeros(len(f)), 0.0
    for share, name in zip((level * axis) ** 2, channels("Omega", len(run.torque.T)), strict=True):
        spectrum = run.spectra.get(name, Spectrum(1.0))
        power += share * spectrum.plain(f) * spectrum.beside(f)
        if name in run.spectra:
            bias += share * spectrum.power(n)[0] / n
    slope = sigma * np.sqrt(bias) * run.time[:, None]
    return np.concatenate([modes * np.sqrt(variances * power), slope], axis=1)


def shape_response(modes: OutputModes, step: float, wheel: int, signals: np.ndarray) -> np.ndarray:
    """dR and a (c, samples, 6) of shape inputs (c, PARTS points) under one wheel, from rest."""
    count, points = signals.shape
    samples = (points - 1) // PARTS + 1
    column = modes.inputs["shape"].start + wheel
    gains = modes.gains[:, column]
    weights = hold_weights(modes.rates, step, PARTS) * gains
    parts = signals[:, :-1].reshape(count * (samples - 1), PARTS)
    pair = np.concatenate([np.real(weights), np.imag(weights)], axis=1).T
    pushed = pair[:, :PARTS] @ parts.T
    pushed += pair[:, PARTS:] * signals[:, PARTS::PARTS].reshape(1, -1)
    real, imaginary = np.split(pushed.reshape(-1, count, samples - 1), 2)
    first = -gains[:, None] / modes.rates[:, None] * signals[:, 0]
    z, state = np.empty((len(gains), 2, count, samples)), np.empty((count, samples), complex)
    for k, rate in enumerate(modes.rates):
        state[:, 0] = first[k]
        state[:, 1:] = real[k] + 1j * imaginary[k]
        for one in state:
            recursion([complex(np.exp(rate * step))], one[:, None])
        z[k, 0], z[k, 1] = np.real(state), np.imag(state)
    out = (z.reshape(2 * len(gains), -1).T @ real_rows(modes, OUTPUTS)).reshape(count, samples, -1)
    return out + signals[:, ::PARTS, None] * modes.out(OUTPUTS)[1][:, column]


def response_rows(modes: OutputModes, run: Run, slopes, errors, weights) -> np.ndarray:
    """B^T: whitened dR and a (k, rows) of every wheel's error modes.

    `slopes` are rho'(theta) at the PARTS points, `errors` by wheel the modes (samples, k) of the
    angle's error in rad with their size, `weights` (samples, 6) 1/sigma.
    """
    out = np.empty((sum(error.shape[1] for error in errors), weights.size))
    share, row = np.arange(PARTS) / PARTS, 0
    for i, error in enumerate(errors):
        for at in range(0, error.shape[1], CHUNK):
            e = np.ascontiguousarray(error[:, at : at + CHUNK].T)
            fine = (e[:, :-1, None] * (1 - share) + e[:, 1:, None] * share).reshape(len(e), -1)
            fine = np.concatenate([fine, e[:, -1:]], axis=1) * slopes[:, i]
            change = shape_response(modes, run.step, i, fine) * weights
            out[row : row + len(e)] = change.reshape(len(e), -1)
            row += len(e)
    return out


def whitener(across: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(U, shrink) with (I + B B^T)^(-1/2) = I - U^T diag(shrink) U for `across` = B^T (k, rows)."""
    values, vectors = np.linalg.eigh(across @ across.T)
    kept = values > LEAST_VARIANCE
    U = (vectors[:, kept] / np.sqrt(values[kept])).T @ across
    return U, 1 - 1 / np.sqrt(1 + values[kept])
