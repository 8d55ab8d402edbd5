"""What does the linear baseline of a measured electronic oscillator lack?

Silverbox: T. Wigren, J. Schoukens, "Three free data sets for development and benchmarking in
nonlinear system identification", ECC 2013.  Baseline: m y'' + c y' + k y = u,
the zero of u's converter uncertain by 10 mV.
Answer, unaided: a cubic spring; then a small quadratic one.
"""

import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from scipy.linalg import expm
from scipy.signal import resample_poly

from omnijax.diagnosis import Prior, Search, SmallModel
from omnijax.laws import EFFECTS, GENERIC, MountSignal

DATA = Path(__file__).parents[1] / ".." / "shared" / "realdata" / "silverbox" / "SNLS80mV.csv"
STEP = 2**14 / 1e7  # s
PARTS = 4  # steps a sample, the input band-limited in between
ARROW, SINE = slice(100, 40575), slice(40650, 127400)
LAWS = ("mount-cubic", "mount-quadratic", "mount-friction", "mount-backlash")


@jax.jit
def respond(E, P, Q, k, c, laws, u):
    """y at every step: exact linear step, laws' tension linear over the step (Heun)."""

    def tension(x):
        signal = MountSignal(x[0], x[1], k, c)
        return sum((law(signal) for law in laws), jnp.zeros(()))

    def body(carry, pair):
        x, f = carry
        here = pair[0] - f
        guess = E @ x + P * here + Q * (pair[1] - f)
        f1 = tension(guess)
        x = E @ x + P * here + Q * (pair[1] - f1)
        return (x, tension(x)), x[0]

    start = (jnp.zeros(2), jnp.zeros(()))
    _, y = jax.lax.scan(body, start, jnp.stack([u[:-1], u[1:]], axis=1))
    return jnp.concatenate([jnp.zeros(1), y])


def step_matrices(m, c, k, h):
    """x_next = E x + P u + Q u_next for u linear over the step."""
    big = np.zeros((4, 4))
    big[:2, :2] = [[0, h], [-k / m * h, -c / m * h]]
    big[1, 2], big[2, 3] = h / m, 1.0
    e = expm(big)
    return e[:2, :2], e[:2, 2] - e[:2, 3], e[:2, 3]


def load(path: Path) -> dict[str, tuple[np.ndarray, np.ndarray, int]]:
    """(input, output, first sample that counts) of the parts in V; the official split.

    The test part of the multisine is simulated from the multisine's start, where the circuit rests.
    """
    u, y = np.genfromtxt(path, delimiter=",", skip_header=1)[:, :2].T
    cut = (SINE.stop - SINE.start) * 3 // 4
    train = slice(SINE.start, SINE.start + cut)
    parts = {"train": (train, 50), "held-out": (SINE, cut + 50), "arrow": (ARROW, 50)}
    return {k: (u[s], y[s], first) for k, (s, first) in parts.items()}


def simulate(p, laws, u) -> np.ndarray:
    """Simulated output at the samples."""
    fine = resample_poly(u, PARTS, 1)[: (len(u) - 1) * PARTS + 1]
    matrices = step_matrices(p["m"], p["c"], p["k"], STEP / PARTS)
    return np.asarray(respond(*matrices, p["k"], p["c"], laws, jnp.asarray(fine)))[::PARTS]


def start_values(u, y) -> tuple[float, float, float]:
    """m, c, k by least squares on the spectra of a train stretch."""
    w = 2 * np.pi * np.fft.rfftfreq(len(u), STEP)
    U, Y = np.fft.rfft(u * np.hanning(len(u))), np.fft.rfft(y * np.hanning(len(u)))
    use = (w > 0) & (w < 2 * np.pi * 150)
    A = np.stack([-(w**2) * Y, 1j * w * Y, Y], axis=1)[use]
    A, b = np.concatenate([A.real, A.imag]), np.concatenate([U[use].real, U[use].imag])
    size = np.linalg.norm(A, axis=0)
    return tuple(np.linalg.lstsq(A / size, b, rcond=None)[0] / size)


def model(path: Path):
    """The oscillator as a model; its candidate laws are those of a wheel's mount."""
    sets = load(path)
    noise = 2e-4  # V, about the data's own floor

    def residual(p, laws, split):
        u, y, first = sets[split]
        return (y - simulate(p, laws, u + p["zero"]))[first:] / noise

    values = start_values(*sets["train"][:2])
    units = ("V s^2/V", "V s/V", "V/V")
    priors = [Prior(n, v, 0.3, unit=q) for n, v, q in zip("mck", values, units, strict=True)]
    priors.append(Prior("zero", 0.0, 0.01, relative=False, unit="V"))  # of the input's converter
    laws = {k: v for k, v in {**EFFECTS, **GENERIC}.items() if k in LAWS}
    rms = float(np.std(sets["train"][1]))
    constants = {("mount-backlash", "gap"): [0.3 * rms, rms], ("mount-friction", "width"): [1.0]}
    return SmallModel(residual, priors, laws, "oscillator", constants), noise


def main(path: Path = DATA, tell=print) -> dict:
    """Search, print, and return simulation errors in mV."""
    built, noise = model(path)
    found = Search(built, tell).run()

    def error(point, split, last=None):
        (r,) = built.residuals([point], split)
        return 1e3 * noise * float(np.sqrt(np.mean(r[:last] ** 2)))

    before, after = found.baseline.point, found.fit.point
    names = [e.id for e in after.effects]
    result = {
        "linear multisine": error(before, "held-out"), "linear arrow": error(before, "arrow"),
        "multisine": error(after, "held-out"), "arrow": error(after, "arrow"),
        "arrow without extrapolation": error(after, "arrow", 32000),
    }  # fmt: skip
    tell(f"accepted: {', '.join(names)}")
    for effect in after.effects:
        tell(f"{effect.name}: {effect.values}")
    for key, value in result.items():
        tell(f"{key}: {value:.3f} mV")
    return result | {"order": names}


if __name__ == "__main__":
    if not DATA.is_file():
        sys.exit(f"{DATA} is absent: this experiment needs the measured data.")
    answer = main()
    assert "mount-cubic" in answer["order"], answer
    assert answer["multisine"] <= 0.40, answer
    assert answer["arrow"] <= 0.56, answer
