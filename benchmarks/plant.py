"""A plant to be diagnosed: the machine of spec/physics.md written a second time, on its own.

It shares nothing with the package but the spec: classical Runge-Kutta of fixed step, its own
formulas, other friction widths, other profiles' code.  Every effect is a number in `Truth`; zero
is no effect.  One compiled function simulates every case.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)

RATE = 500.0  # Hz, of the recording
STEPS = 1e4  # Runge-Kutta steps a second
STAGES = np.array([0.0, 0.5, 0.5, 1.0]), np.array([1.0, 2.0, 2.0, 1.0]) / 6  # ahead, weight
ROOM = 4096  # samples: runs are padded to multiples of it, so that one program serves all lengths
W0, V0, EPS = 0.07, 1.4e-3, 4e-3  # friction widths; the package's candidates start from others
NOISE = {"dR": 2e-6, "theta": 1e-4, "Omega": 1e-4, "a": 5e-3}


def nothing(n: int = 3) -> dict[str, Any]:
    """Every effect at zero."""

    def z():
        return np.zeros(n)

    return {
        "runout": z(), "runout_phase": z(), "roller": np.full(n, -1.0), "severity": z(),
        "round": 0.0, "round_axis": np.array([0.0, 0.0, 1.0]), "K3": z(), "hertz": z(), "K1": z(),
        "power": 1.5,
        "tau": np.full(n, 0.01), "lift": z(), "k3": z(), "backlash": z(), "dry": z(),
        "coulomb": z(), "viscous": z(), "ripple": z(), "ripple_order": z(), "ripple_phase": z(),
        "gain": z(), "arm": 0.0, "lever": 0.0, "drag": 0.0, "offset": np.zeros(3), "floor": 0.0,
        "floor_f": 1.0, "floor_phase": 0.0, "floor_d": np.array([1.0, 0, 0]), "creep": z(),
        "cross": np.zeros((n, n)), "K2": z(), "fade": z(), "square": z(), "k2": z(),
        "bias": z(), "current": z(), "current_order": z(), "current_phase": z(), "radius": z(),
        "stribeck": z(), "stribeck_speed": np.ones(n), "load": z(), "asymmetry": z(),
        "cog": np.zeros((n, 2)), "cog_order": np.ones((n, 2)), "cog_phase": np.zeros((n, 2)),
        "w0": W0, "v0": V0, "eps": EPS, "delay": z(), "lag": z(), "limit": np.full(n, 1e9),
        "lies": np.eye(3),
    }  # fmt: skip


def machine(rng, wheels: int = 3, **changes) -> dict[str, Any]:
    """Stated parameters of a random machine; `changes` replace some of them."""
    tilt = np.arcsin(rng.uniform(0.45, 0.65))
    turn = 2 * np.pi * np.arange(wheels) / wheels + rng.uniform(0, 1)
    up = np.full(wheels, np.sin(tilt))
    normal = np.stack([-np.cos(turn) * np.cos(tilt), -np.sin(turn) * np.cos(tilt), up], 1)
    drive = np.stack([-np.sin(turn), np.cos(turn), np.zeros(wheels)], 1)
    mass, each = rng.uniform(8, 35), np.ones(wheels)
    rig = {
        "R": 1.22, "M": mass, "Ml": mass * rng.uniform(0.8, 1.7),
        "g": np.array([0, 0, -9.81]), "normal": normal, "drive": drive,
        "r": 0.09, "m": rng.uniform(0.3, 0.6), "Iw": rng.uniform(1e-3, 2e-3),
        "n": float(rng.integers(10, 17)), "eta": rng.uniform(0.14, 0.2), "half": 0.0, "wave": 0.0,
        "pivot": 0.0, "K": rng.uniform(1e5, 3.3e5) * each, "C": rng.uniform(200, 450) * each,
        "k": rng.uniform(4.5e5, 1.5e6) * each, "c": rng.uniform(50, 180) * each,
        "Kc": rng.uniform(1.5e4, 4e4), "N0": rng.uniform(220, 380), "mu": 0.9,
    } | changes  # fmt: skip
    return {"I": rig["M"] * rig["R"] ** 2 * 2 / 3, **rig}  # a thin shell


def profile(angle, rig):
    """Gated sine; half a wave instead of a whole one where `half` is 1, no gate where `wave` is.

    Where `pivot` is 1 the sphere rolls over the nearer edge of the gap.
    """
    pitch = 2 * jnp.pi / rig["n"]
    width = rig["eta"] * pitch
    half = jnp.arcsin(rig["r"] / rig["R"] * jnp.sin(width / 2))
    depth = rig["R"] * (1 - jnp.cos(half)) + rig["r"] * (1 - jnp.cos(width / 2))
    into = jnp.mod(angle, pitch)
    gated = jnp.where(into < width, jnp.sin((2 - rig["half"]) * jnp.pi * into / width), 0.0)
    edge = jnp.clip(jnp.minimum(into, width - into), 0.0)
    tilt = jnp.arcsin(rig["r"] / rig["R"] * jnp.sin(edge))
    over = rig["R"] * (1 - jnp.cos(tilt)) + rig["r"] * (1 - jnp.cos(edge))
    wave = -depth * jnp.where(rig["wave"] > 0, jnp.sin(rig["n"] * angle / rig["eta"]), gated)
    return jnp.where(rig["pivot"] > 0, -over, wave)


def shape(angle, rig, e):
    """rho of every wheel with runout and damaged roller."""
    bare = profile(angle, {**rig, "r": rig["r"] * (1 + e["radius"])})
    pitch, turn = 2 * jnp.pi / rig["n"], jnp.mod(angle, 2 * jnp.pi)
    gap = jnp.floor(turn / pitch)
    here = (gap == e["roller"]) & (turn - gap * pitch < rig["eta"] * pitch)
    return bare * (1 + e["severity"] * here) + e["runout"] * jnp.cos(angle - e["runout_phase"])


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
    reach = e["power"] * rig["N0"] / rig["K"]
    left = jnp.maximum(1 - d / reach, 0.0)
    hertz = rig["N0"] * (1 - left ** e["power"]) - rig["K"] * d
    extra = e["K3"] * d**3 + e["K1"] * (d - z) + e["hertz"] * hertz + e["K2"] * d**2
    return extra + e["cross"] @ d + e["fade"] * rig["K"] * d * time


def mount_extra(D, rate, rig, e):
    """Mount tension beside k D + c D'."""
    return (
        e["k3"] * D**3 + e["k2"] * D**2 - rig["k"] * jnp.clip(D, -e["backlash"], e["backlash"])
        + e["dry"] * jnp.tanh(rate / e["v0"])
    )  # fmt: skip


def shaft(torque, theta, w, e):
    """Torque on the shafts: what the motors deliver, friction, lines."""
    given = torque * (1 + e["gain"])
    given = given * (1 + e["current"] * jnp.sin(e["current_order"] * theta + e["current_phase"]))
    given = jnp.clip(given, -e["limit"], e["limit"])
    sign = jnp.tanh(w / e["w0"])
    dry = e["coulomb"] + e["stribeck"] * jnp.exp(-((w / e["stribeck_speed"]) ** 2))
    T = given + e["bias"] - (dry + e["load"] * jnp.abs(given)) * sign
    T = T - e["asymmetry"] * jnp.abs(sign) - e["viscous"] * w - e["square"] * jnp.abs(w) * w
    T = T + e["ripple"] * jnp.sin(e["ripple_order"] * theta + e["ripple_phase"])
    return T + jnp.sum(e["cog"] * jnp.sin(e["cog_order"] * theta[:, None] + e["cog_phase"]), axis=1)


def field(y, time, torque, force, rig, e):
    """Rates of the state, and the platform's acceleration."""
    x, D, p, pi, V, theta, omega, q, z, late = y
    normal, drive = rig["normal"], rig["drive"]
    axes = jnp.cross(drive, normal)
    Q = turn_matrix(q) @ e["lies"]
    roll = shape(theta, rig, e)
    rho = roll + surface(Q, rig, e)
    Vs = (p + normal.T @ (rig["C"] * rho)) / rig["M"]
    u = (pi - rig["C"] * rho) / rig["m"]
    rate = u - normal @ V
    d = normal @ x - D - rho
    smooth_rate = normal @ (Vs - V) - rate
    radius = (1 - e["creep"]) * (rig["r"] * (1 + e["radius"]) + roll)
    w = rig["R"] * (axes @ omega) / radius
    slope = jax.jvp(lambda a: shape(a, rig, e), (theta,), (w,))[1]
    extra = contact_extra(d, z, rig, e, time)
    tension = rig["K"] * d + rig["C"] * smooth_rate + extra
    N = rig["N0"] - tension + rig["C"] * slope
    lifted = jnp.where(e["lift"] > 0, jnp.minimum(N, 0.0), 0.0)
    tension = tension + lifted
    mount = rig["k"] * D + rig["c"] * rate + mount_extra(D, rate, rig, e)
    N = jnp.maximum(N, 0.0)
    rolling = e["arm"] * N * jnp.tanh(axes @ omega / e["eps"])
    spin = e["lever"] * rig["mu"] * N * jnp.tanh(-normal @ omega / e["eps"])
    g = axes.T @ rolling - normal.T @ spin
    g = g + e["drag"] * jnp.linalg.norm(omega + 1e-30) * omega
    g = g - jnp.cross(Q @ e["offset"], rig["M"] * rig["g"])
    T = shaft(jnp.where(e["lag"] > 0, late, torque), theta, w, e) - rolling
    A = rig["R"] ** 2 * axes @ axes.T / rig["I"] + jnp.diag(radius**2 / rig["Iw"])
    f = jnp.linalg.solve(A, radius / rig["Iw"] * T + rig["R"] / rig["I"] * axes @ g)
    turn = (rig["R"] * axes.T @ f - g) / rig["I"]
    closing = rig["Kc"] * (normal @ x)
    across = jnp.eye(3) - normal[:, :, None] * normal[:, None, :]
    Mp = rig["Ml"] * jnp.eye(3) + jnp.einsum("i,iab->ab", rig["m"] + 0 * w, across)
    floor = e["floor"] * jnp.sin(2 * jnp.pi * e["floor_f"] * time + e["floor_phase"])
    push = normal.T @ (mount + closing) - drive.T @ f + force
    a = jnp.linalg.solve(Mp, push) + floor * e["floor_d"]
    quat = jnp.concatenate([-(omega @ q[1:])[None], q[0] * omega + jnp.cross(omega, q[1:])]) / 2
    rates = (Vs - V, rate, drive.T @ f - normal.T @ (tension + closing), tension - mount, a,
             w, turn, quat, (d - z) / e["tau"],
             (torque - late) / jnp.where(e["lag"] > 0, e["lag"], 1.0))  # fmt: skip
    return rates, a


def at_rest(theta, rig, e):
    """State at static rest: the linear balance, the effects' tensions by iteration."""
    normal = rig["normal"]
    q = jnp.array([1.0, 0, 0, 0])
    rho = shape(theta, rig, e) + surface(e["lies"], rig, e)

    def balance(v):
        x, D = v[:3], v[3:]
        d = normal @ x - D - rho
        t = rig["K"] * d + contact_extra(d, d, rig, e, 0.0)
        t = jnp.where(e["lift"] > 0, jnp.minimum(t, rig["N0"]), t)
        m = rig["k"] * D + mount_extra(D, 0 * D, rig, e)
        return jnp.concatenate([normal.T @ (t + rig["Kc"] * (normal @ x)), t - m])

    def newton(_, v):
        return v - jnp.linalg.lstsq(jax.jacfwd(balance)(v), balance(v))[0]

    v = jax.lax.fori_loop(0, 12, newton, jnp.zeros(3 + len(normal)))
    x, D = v[:3], v[3:]
    pulled = rig["C"] * rho
    zero, d = jnp.zeros(3), normal @ x - D - rho
    return (x, D, -normal.T @ pulled, pulled, zero, theta, zero, q, d)


def side_by_side(theta, torque, force, rig, e, rate=RATE, steps=STEPS):
    """As `simulate`, every run with a machine and effects of its own, in `steps` a second."""
    samples = torque.shape[1]
    room = ROOM * -(-samples // ROOM)
    wide = [np.pad(x, ((0, 0), (0, room - samples), (0, 0)), mode="edge") for x in (torque, force)]
    made = _side_by_side(theta, *wide, samples, rig, e, float(rate), float(steps))
    return np.asarray(made)[:, :samples]


def simulate(theta, torque, force, rig, e):
    """Noise-free outputs (runs, samples, ..): dR, theta, Omega, a of runs side by side.

    `theta` (runs, n) at the start; `torque` (runs, samples, n) and `force` (runs, samples, 3) on
    the platform are linear between samples.
    """
    runs = len(torque)
    every = jax.tree.map(lambda x: np.stack([np.asarray(x, float)] * runs), (rig, e))
    return side_by_side(theta, torque, force, *every)


@jax.jit
def _side_by_side(theta, torque, force, samples, rig, e, rate, steps):
    """Runs of `samples` in as much room as `torque` has: one program for all lengths and rates."""

    def one(theta, torque, force, rig, e):
        return _simulate(theta, torque, force, samples, rig, e, rate, steps)

    return jax.vmap(one)(theta, torque, force, rig, e)


def _simulate(theta, torque, force, samples, rig, e, rate, steps):
    count = jnp.round(steps / rate).astype(int)  # Runge-Kutta steps a sample
    h = 1 / rate / count

    def add(y, k, s):
        return jax.tree.map(lambda a, b: a + s * b, y, k)

    def sample(k, reached):
        y, out = reached
        start, end = force[k], force[jnp.minimum(k + 1, samples - 1)]

        def sub(j, y):
            def stage(reached, of):  # one body for four stages: a quarter of the program
                slope, mean = reached
                ahead, weight = of
                push = start + (end - start) * (j + ahead) / count
                time, given = (k * count + j + ahead) * h, commanded(k + (j + ahead) / count)
                slope = field(add(y, slope, ahead * h), time, given, push, rig, e)[0]
                return (slope, add(mean, slope, weight)), None

            rest = jax.tree.map(jnp.zeros_like, y)
            (_, mean), _ = jax.lax.scan(stage, (rest, rest), STAGES)
            return add(y, mean, h)

        out = out.at[k].set(measure(y, k, start))
        return jax.lax.fori_loop(0, count, sub, y), out

    def commanded(at):
        """What acts after each wheel's delay, `at` samples into the run."""
        at = jnp.maximum(at - e["delay"] * rate, 0.0)
        before = jnp.minimum(jnp.floor(at).astype(int), samples - 2)
        each = jnp.arange(torque.shape[1])
        rise = torque[before + 1, each] - torque[before, each]
        return torque[before, each] + rise * (at - before)

    def measure(y, k, push):
        acceleration = field(y, k / rate, commanded(k), push, rig, e)[1]
        return jnp.concatenate([y[0], y[5], y[6], acceleration])

    begun = (*at_rest(theta, rig, e), torque[0])
    out = jnp.zeros((len(torque), 9 + len(theta)))
    return jax.lax.fori_loop(0, samples, sample, (begun, out))[1]


def wander(rng, seconds: float, peak: float = 0.55, rate: float = RATE) -> np.ndarray:
    """Omega (samples, 3) of a smooth random turning of the sphere, after 0.3 s of rest."""
    t = np.arange(round(seconds * rate) + 1) / rate
    since = np.maximum(t - 0.3, 0.0)
    turning = np.zeros((len(t), 3))
    for axis in range(3):
        for _ in range(4):
            f = rng.uniform(0.1, 0.7)
            turning[:, axis] += (
                rng.uniform(0.3, 1.0) / f**0.5 * np.sin(2 * np.pi * f * since + rng.uniform(0, 6.3))
            )
    turning *= (1 - np.exp(-((since / 0.5) ** 3)))[:, None]
    return turning * peak / np.abs(turning).max()


def spin_up(seconds: float, speed: float, rate: float = RATE) -> np.ndarray:
    """Omega (samples, 3) of a turn about the vertical axis: up within 1 s, then constant."""
    t = np.arange(round(seconds * rate) + 1) / rate
    rise = np.clip(t - 0.2, 0.0, 1.0)
    return np.outer(speed * rise**2 * (3 - 2 * rise), [0.0, 0.0, 1.0])


def torques(rig, turning: np.ndarray, friction: float = 0.0, rate: float = RATE) -> np.ndarray:
    """Motor torques (samples, n) for Omega (samples, 3); `friction` in N m s/rad on the shafts."""
    change = np.gradient(turning, 1 / rate, axis=0)
    axes = np.cross(rig["drive"], rig["normal"])
    force = (rig["I"] * change) @ np.linalg.pinv(rig["R"] * axes.T).T
    spin = rig["R"] / rig["r"] * axes.T
    return rig["r"] * force + (rig["Iw"] * change + friction * turning) @ spin


def perturbed(rng, rig, spread=0.08) -> dict:
    """The true machine: stiffness and damping of every wheel off by the stated uncertainty."""

    def pick(s):
        return np.exp(np.clip(rng.normal(size=len(rig["K"])), -1.5, 1.5) * s)

    out = dict(rig)
    for key, s in (("K", spread), ("k", spread), ("C", 2 * spread), ("c", 2 * spread)):
        out[key] = rig[key] * pick(s)
    return out


SPREAD = {"contact.stiffness": 0.08, "contact.damping": 0.16,
          "mount.stiffness": 0.08, "mount.damping": 0.16}  # fmt: skip


def rig_text(rig, uncertainty: dict[str, float] = SPREAD) -> str:
    """The stated machine as a rig file; `uncertainty` relative 1-sigma by key."""
    lines = [f"[sphere]\nradius = {rig['R']}\nmass = {rig['M']!r}\ninertia = {rig['I']!r}\n",
             f"[platform]\nmass = {rig['Ml']!r}\n"
             f"gravity = {np.ravel(rig['g']).tolist()}\n"]  # fmt: skip
    words = {"pivot": "rollers", "half": "half-sine", "wave": "continuous-sine"}
    word = next((word for key, word in words.items() if rig[key]), "gated-sine")
    for i in range(len(rig["K"])):
        K, C, k, c = (float(rig[key][i]) for key in ("K", "C", "k", "c"))
        lines.append(
            f'[[wheel]]\nname = "w{i + 1}"\nnormal = {rig["normal"][i].tolist()}\n'
            f"drive = {rig['drive'][i].tolist()}\nradius = {rig['r']}\nmass = {rig['m']!r}\n"
            f"inertia = {rig['Iw']!r}\nrollers = {int(rig['n'])}\nroundness = {rig['eta']!r}\n"
            f'profile = "{word}"\n'
            f"contact = {{ stiffness = {K!r}, damping = {C!r}, friction = {rig['mu']} }}\n"
            f"mount = {{ stiffness = {k!r}, damping = {c!r} }}\n"
            f"closure = {{ stiffness = {rig['Kc']!r}, preload = {rig['N0']!r} }}\n"
        )
    lines += ["[uncertainty]", *(f'"{key}" = {sigma}' for key, sigma in uncertainty.items()), ""]
    return "\n".join(lines)


def columns(wheels: int) -> list[str]:
    """Names of the plant's outputs."""
    vectors = {g: [f"{g}_{a}" for a in "xyz"] for g in ("dR", "Omega", "a")}
    encoders = [f"theta_{i + 1}" for i in range(wheels)]
    return [*vectors["dR"], *encoders, *vectors["Omega"], *vectors["a"]]


def record(
    stated, true, effects, torque, rng, *, noise=1.0, sensor=None, cut=0.0, drop=(), over=None
):
    """Tables {column: values} of the runs under `torque` (runs, samples, n), with noise.

    The first `cut` seconds are not recorded: the recording begins while the sphere turns.
    Channels whose names begin with one of `drop` were not measured.  `over` = (wheel, gap): where
    the runs begin.
    """
    n, size = len(stated["K"]), torque.shape
    planted = jax.tree.map(jnp.asarray, {**nothing(n), **effects})
    start = rng.uniform(0, 2 * np.pi, (size[0], n))
    if over is not None:
        wheel, gap = over
        start[:, wheel] = (gap + start[:, wheel] / (2 * np.pi)) * 2 * np.pi / stated["n"]
    made = simulate(
        start, torque, np.zeros((*size[:2], 3)), jax.tree.map(jnp.asarray, true), planted
    )
    if not np.all(np.isfinite(made)):
        raise ValueError("the plant runs away: the planted effect is too strong for this machine.")
    tables, first = [], round(cut * RATE)
    for true_out, given in zip(np.array(made)[:, first:], torque[:, first:], strict=True):
        t = np.arange(len(true_out)) / RATE
        out = true_out if sensor is None else sensor(t, true_out)
        table = {"t": t} | {f"torque_{i + 1}": given[:, i] for i in range(n)}
        for j, name in enumerate(columns(n)):
            if not name.startswith(tuple(drop)):
                sigma = noise * NOISE[name.split("_")[0]]
                table[name] = out[:, j] + sigma * rng.normal(size=len(out))
        tables.append(table)
    return tables


def write_case(folder, stated, tables, noise=1.0, sigmas=None, uncertainty=SPREAD) -> None:
    """Rig file, runs and sidecars into `folder`; the last run is held out, if there are several.

    `sigmas` are declared (default: `noise` times `NOISE`; empty: none).
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.toml").write_text(rig_text(stated, uncertainty))
    sigmas = {g: noise * s for g, s in NOISE.items()} if sigmas is None else sigmas
    lines = ["[noise]", *(f"{g} = {float(s)!r}" for g, s in sigmas.items())] if sigmas else []
    for k, table in enumerate(tables):
        rows = np.column_stack(list(table.values()))
        path = folder / f"run-{k + 1}.csv"
        np.savetxt(path, rows, "%.10g", ",", header=",".join(table), comments="")
        role = "held-out" if 0 < k == len(tables) - 1 else "train"
        path.with_suffix(".toml").write_text(
            "\n".join(['rig = "rig.toml"', f'role = "{role}"', *lines, ""])
        )
