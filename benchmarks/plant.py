"""A plant to be diagnosed: the machine of spec/physics.md written a second time, on its own.

It shares nothing with the package but the spec: classical Runge-Kutta of fixed step, its own
formulas, other friction widths, other profiles' code.  Every effect is a number in `Truth`; zero
is no effect.  One compiled function simulates every case.
"""

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)

RATE = 500.0  # Hz, of the recording
SUB = 20  # Runge-Kutta steps a sample: 1e-4 s
W0, V0, EPS = 0.07, 1.4e-3, 4e-3  # friction widths; the package's candidates start from others
NOISE = {"dR": 2e-6, "theta": 1e-4, "Omega": 1e-4, "a": 5e-3}


def nothing(n: int = 3) -> dict[str, Any]:
    """Every effect at zero."""

    def z():
        return np.zeros(n)

    return {
        "runout": z(), "runout_phase": z(), "roller": np.full(n, -1.0), "severity": z(),
        "round": 0.0, "round_axis": np.array([0.0, 0.0, 1.0]), "K3": z(), "hertz": z(), "K1": z(),
        "tau": np.full(n, 0.01), "lift": z(), "k3": z(), "backlash": z(), "dry": z(),
        "coulomb": z(), "viscous": z(), "ripple": z(), "ripple_order": z(), "ripple_phase": z(),
        "gain": z(), "arm": 0.0, "lever": 0.0, "drag": 0.0, "offset": np.zeros(3), "floor": 0.0,
        "floor_f": 1.0, "floor_phase": 0.0, "floor_d": np.array([1.0, 0, 0]), "creep": z(),
        "cross": 0.0, "K2": z(), "fade": z(),
    }  # fmt: skip


def tripod(rng, gravity: bool = True) -> dict[str, Any]:
    """Stated parameters of a random three-wheel machine."""
    tilt = np.arcsin(rng.uniform(0.45, 0.65))
    turn = 2 * np.pi * np.arange(3) / 3 + rng.uniform(0, 1)
    up = np.sin(tilt)
    normal = np.stack(
        [-np.cos(turn) * np.cos(tilt), -np.sin(turn) * np.cos(tilt), np.full(3, up)], 1
    )
    drive = np.stack([-np.sin(turn), np.cos(turn), np.zeros(3)], 1)
    mass = rng.uniform(8, 35)
    return {
        "R": 1.22, "M": mass, "I": mass * 0.992, "Ml": mass * rng.uniform(0.8, 1.7),
        "g": np.array([0, 0, -9.81]) if gravity else np.zeros(3), "normal": normal, "drive": drive,
        "r": 0.09, "m": rng.uniform(0.3, 0.6), "Iw": rng.uniform(1e-3, 2e-3),
        "n": float(rng.integers(10, 17)), "eta": rng.uniform(0.14, 0.2),
        "K": np.full(3, rng.uniform(1e5, 3.3e5)), "C": np.full(3, rng.uniform(200, 450)),
        "k": np.full(3, rng.uniform(4.5e5, 1.5e6)), "c": np.full(3, rng.uniform(50, 180)),
        "Kc": rng.uniform(1.5e4, 4e4), "N0": rng.uniform(220, 380), "mu": 0.9,
    }  # fmt: skip


def profile(angle, rig):
    """Gated sine."""
    pitch = 2 * jnp.pi / rig["n"]
    width = rig["eta"] * pitch
    half = jnp.arcsin(rig["r"] / rig["R"] * jnp.sin(width / 2))
    depth = rig["R"] * (1 - jnp.cos(half)) + rig["r"] * (1 - jnp.cos(width / 2))
    into = jnp.mod(angle, pitch)
    return jnp.where(into < width, -depth * jnp.sin(2 * jnp.pi * into / width), 0.0)


def shape(angle, rig, e):
    """rho of every wheel with runout and damaged roller."""
    bare = profile(angle, rig)
    gap = jnp.floor(jnp.mod(angle, 2 * jnp.pi) / (2 * jnp.pi / rig["n"]))
    return bare * (1 + e["severity"] * (gap == e["roller"])) + e["runout"] * jnp.cos(
        angle - e["runout_phase"]
    )


def surface(Q, rig, e):
    """What the sphere's shape adds, position input only."""
    axis = e["round_axis"] / jnp.linalg.norm(e["round_axis"])
    along = (-rig["normal"] @ Q) @ axis
    return e["round"] * (1.5 * along**2 - 0.5)


def turn_matrix(q):
    """Quaternion -> matrix."""
    w, x, y, z = q
    S = jnp.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return jnp.eye(3) + 2 * w * S + 2 * S @ S


def contact_extra(d, z, rig, e, time):
    """Contact tension beside K d + C d'."""
    reach = 1.5 * rig["N0"] / rig["K"]
    left = jnp.maximum(1 - d / reach, 0.0)
    hertz = rig["N0"] * (1 - left**1.5) - rig["K"] * d
    extra = e["K3"] * d**3 + e["K1"] * (d - z) + e["hertz"] * hertz + e["K2"] * d**2
    cross = jnp.array([e["cross"] * d[1], e["cross"] * d[0], 0.0])
    return extra + cross + e["fade"] * rig["K"] * d * time


def mount_extra(D, rate, rig, e):
    """Mount tension beside k D + c D'."""
    return (
        e["k3"] * D**3 - rig["k"] * jnp.clip(D, -e["backlash"], e["backlash"])
        + e["dry"] * jnp.tanh(rate / V0)
    )  # fmt: skip


def field(y, time, torque, rig, e):
    """Rates of the state, and the platform's acceleration."""
    x, D, p, pi, V, theta, omega, q, z = y
    normal, drive = rig["normal"], rig["drive"]
    axes = jnp.cross(drive, normal)
    Q = turn_matrix(q)
    roll = shape(theta, rig, e)
    rho = roll + surface(Q, rig, e)
    Vs = (p + normal.T @ (rig["C"] * rho)) / rig["M"]
    u = (pi - rig["C"] * rho) / rig["m"]
    rate = u - normal @ V
    d = normal @ x - D - rho
    smooth_rate = normal @ (Vs - V) - rate
    radius = (1 - e["creep"]) * (rig["r"] + roll)
    w = rig["R"] * (axes @ omega) / radius
    slope = jax.jvp(lambda a: shape(a, rig, e), (theta,), (w,))[1]
    extra = contact_extra(d, z, rig, e, time)
    tension = rig["K"] * d + rig["C"] * smooth_rate + extra
    N = rig["N0"] - tension + rig["C"] * slope
    lifted = jnp.where(e["lift"] > 0, jnp.minimum(N, 0.0), 0.0)
    tension = tension + lifted
    mount = rig["k"] * D + rig["c"] * rate + mount_extra(D, rate, rig, e)
    N = jnp.maximum(N, 0.0)
    rolling = e["arm"] * N * jnp.tanh(axes @ omega / EPS)
    spin = e["lever"] * rig["mu"] * N * jnp.tanh(-normal @ omega / EPS)
    g = axes.T @ rolling - normal.T @ spin
    g = g + e["drag"] * jnp.linalg.norm(omega + 1e-30) * omega
    g = g - jnp.cross(Q @ e["offset"], rig["M"] * rig["g"])
    T = torque * (1 + e["gain"]) - e["coulomb"] * jnp.tanh(w / W0) - e["viscous"] * w - rolling
    T = T + e["ripple"] * jnp.sin(e["ripple_order"] * theta + e["ripple_phase"])
    A = rig["R"] ** 2 * axes @ axes.T / rig["I"] + jnp.diag(radius**2 / rig["Iw"])
    f = jnp.linalg.solve(A, radius / rig["Iw"] * T + rig["R"] / rig["I"] * axes @ g)
    turn = (rig["R"] * axes.T @ f - g) / rig["I"]
    closing = rig["Kc"] * (normal @ x)
    across = jnp.eye(3) - normal[:, :, None] * normal[:, None, :]
    Mp = rig["Ml"] * jnp.eye(3) + rig["m"] * jnp.sum(across, axis=0)
    floor = e["floor"] * jnp.sin(2 * jnp.pi * e["floor_f"] * time + e["floor_phase"])
    a = jnp.linalg.solve(Mp, normal.T @ (mount + closing) - drive.T @ f) + floor * e["floor_d"]
    quat = jnp.concatenate([-(omega @ q[1:])[None], q[0] * omega + jnp.cross(omega, q[1:])]) / 2
    rates = (Vs - V, rate, drive.T @ f - normal.T @ (tension + closing), tension - mount, a,
             w, turn, quat, (d - z) / e["tau"])  # fmt: skip
    return rates, a


def at_rest(theta, rig, e):
    """State at static rest: the linear balance, the effects' tensions by iteration."""
    normal = rig["normal"]
    q = jnp.array([1.0, 0, 0, 0])
    rho = shape(theta, rig, e) + surface(jnp.eye(3), rig, e)

    def balance(v):
        x, D = v[:3], v[3:]
        d = normal @ x - D - rho
        t = rig["K"] * d + contact_extra(d, d, rig, e, 0.0)
        m = rig["k"] * D + mount_extra(D, 0 * D, rig, e)
        return jnp.concatenate([normal.T @ (t + rig["Kc"] * normal @ x), t - m])

    v = jnp.zeros(6)
    for _ in range(12):
        v = v - jnp.linalg.solve(jax.jacfwd(balance)(v), balance(v))
    x, D = v[:3], v[3:]
    d = normal @ x - D - rho
    return (
        x,
        D,
        -normal.T @ (rig["C"] * rho),
        rig["C"] * rho,
        jnp.zeros(3),
        theta,
        jnp.zeros(3),
        q,
        d,
    )


@jax.jit
def simulate(theta, torque, rig, e):
    """Noise-free outputs (samples, 12): dR, theta, Omega, a; torque (samples, 3) linear between."""
    h = 1 / RATE / SUB

    def add(y, k, s):
        return jax.tree.map(lambda a, b: a + s * b, y, k)

    def sample(y, pair):
        k, t0, t1 = pair

        def sub(y, j):
            time = (k * SUB + j) * h

            def at(s):
                return t0 + (t1 - t0) * (j + s) / SUB

            k1 = field(y, time, at(0.0), rig, e)[0]
            k2 = field(add(y, k1, h / 2), time + h / 2, at(0.5), rig, e)[0]
            k3 = field(add(y, k2, h / 2), time + h / 2, at(0.5), rig, e)[0]
            k4 = field(add(y, k3, h), time + h, at(1.0), rig, e)[0]
            mean = jax.tree.map(lambda a, b, c, d: (a + 2 * b + 2 * c + d) / 6, k1, k2, k3, k4)
            return add(y, mean, h), None

        out = measure(y, k * SUB * h, t0)
        return jax.lax.scan(sub, y, jnp.arange(SUB))[0], out

    def measure(y, time, t):
        return jnp.concatenate([y[0], y[5], y[6], field(y, time, t, rig, e)[1]])

    count = len(torque)
    pairs = (jnp.arange(count - 1), torque[:-1], torque[1:])
    last, out = jax.lax.scan(sample, at_rest(theta, rig, e), pairs)
    return jnp.concatenate([out, measure(last, (count - 1) / RATE, torque[-1])[None]])


def torques(rng, rig, seconds: float, peak: float = 0.55) -> np.ndarray:
    """Torques (samples, 3) of a smooth random turning of the sphere, after 0.3 s of rest."""
    t = np.arange(int(seconds * RATE) + 1) / RATE
    since = np.maximum(t - 0.3, 0.0)
    turning = np.zeros((len(t), 3))
    for axis in range(3):
        for _ in range(4):
            f = rng.uniform(0.1, 0.7)
            turning[:, axis] += (
                rng.uniform(0.3, 1.0) / f**0.5 * np.sin(2 * np.pi * f * since + rng.uniform(0, 6.3))
            )
    turning *= (1 - np.exp(-((since / 0.5) ** 3)))[:, None]
    turning *= peak / np.abs(turning).max()
    change = np.gradient(turning, 1 / RATE, axis=0)
    axes = np.cross(rig["drive"], rig["normal"])
    force = np.linalg.solve(rig["R"] * axes.T, (rig["I"] * change).T).T
    spin = rig["R"] * change @ axes.T / rig["r"]
    return rig["r"] * force + rig["Iw"] * spin


@dataclasses.dataclass(frozen=True)
class Truth:
    """A case before it is written: stated machine, true machine, effects, and what to find."""

    stated: dict
    true: dict
    effects: dict
    expected: tuple[tuple[str, str], ...]
    verdict: str
    sensor: tuple | None = None


def perturbed(rng, rig, spread=0.08) -> dict:
    """The true machine: stiffness and damping of every wheel off by the stated uncertainty."""

    def pick(s):
        return np.exp(np.clip(rng.normal(size=3), -1.5, 1.5) * s)

    out = dict(rig)
    for key, s in (("K", spread), ("k", spread), ("C", 2 * spread), ("c", 2 * spread)):
        out[key] = rig[key] * pick(s)
    return out


def rig_text(rig) -> str:
    """The stated machine as a rig file."""
    lines = [f"[sphere]\nradius = {rig['R']}\nmass = {rig['M']!r}\ninertia = {rig['I']!r}\n",
             f"[platform]\nmass = {rig['Ml']!r}\n"
             f"gravity = {np.ravel(rig['g']).tolist()}\n"]  # fmt: skip
    for i in range(3):
        K, C, k, c = (float(rig[key][i]) for key in ("K", "C", "k", "c"))
        lines.append(
            f'[[wheel]]\nname = "w{i + 1}"\nnormal = {rig["normal"][i].tolist()}\n'
            f"drive = {rig['drive'][i].tolist()}\nradius = {rig['r']}\nmass = {rig['m']!r}\n"
            f"inertia = {rig['Iw']!r}\nrollers = {int(rig['n'])}\nroundness = {rig['eta']!r}\n"
            f'profile = "gated-sine"\n'
            f"contact = {{ stiffness = {K!r}, damping = {C!r}, friction = {rig['mu']} }}\n"
            f"mount = {{ stiffness = {k!r}, damping = {c!r} }}\n"
            f"closure = {{ stiffness = {rig['Kc']!r}, preload = {rig['N0']!r} }}\n"
        )
    lines.append('[uncertainty]\n"contact.stiffness" = 0.08\n"contact.damping" = 0.16\n'
                 '"mount.stiffness" = 0.08\n"mount.damping" = 0.16\n')  # fmt: skip
    return "\n".join(lines)


NAMES = [f"dR_{a}" for a in "xyz"] + [f"theta_{i}" for i in (1, 2, 3)]
NAMES += [f"Omega_{a}" for a in "xyz"] + [f"a_{a}" for a in "xyz"]


def write_case(folder, truth: Truth, rng, seconds=(8.0, 8.0, 8.0), noise: float = 1.0) -> None:
    """Simulate the runs of a case and write rig, runs and sidecars into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.toml").write_text(rig_text(truth.stated))
    effects = jax.tree.map(jnp.asarray, {**nothing(), **truth.effects})
    true = jax.tree.map(jnp.asarray, truth.true)
    for k, length in enumerate(seconds):
        torque = torques(rng, truth.true, length)
        start = rng.uniform(0, 2 * np.pi, 3)
        out = np.array(simulate(jnp.asarray(start), jnp.asarray(torque), true, effects))
        t = np.arange(len(out)) / RATE
        if truth.sensor is not None:
            out = truth.sensor[0](t, out)
        for j, name in enumerate(NAMES):
            out[:, j] += noise * NOISE[name.split("_")[0]] * rng.normal(size=len(out))
        head = ["t", *(f"torque_{i}" for i in (1, 2, 3)), *NAMES]
        rows = np.column_stack([t, torque, out])
        np.savetxt(
            folder / f"run-{k + 1}.csv", rows, "%.10g", ",", header=",".join(head), comments=""
        )
        role = "held-out" if k == len(seconds) - 1 else "train"
        table = "\n".join(f"{g} = {noise * s!r}" for g, s in NOISE.items())
        (folder / f"run-{k + 1}.toml").write_text(
            f'rig = "rig.toml"\nrole = "{role}"\n[noise]\n{table}\n'
        )


@functools.cache
def wheel(i: int) -> np.ndarray:
    """Unit vector of one wheel."""
    return np.eye(3)[i]
