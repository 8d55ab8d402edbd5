"""Random rigs from a ballbot to a person's size, and laws of any kind for them."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from machines import ORTHOGONAL, SINES, SKEW, machine

from omnijax.laws import EFFECTS, ContinuousSine, DualRow, TableShape
from omnijax.rig import Rig

Law = tuple[str, str, dict[str, Any]]  # id, place, parameters
DEFLECTION = 2e-5  # m, of contacts and mounts in such machines
SMOOTH = tuple(profile for profile in SINES if not isinstance(profile, ContinuousSine))
SMOOTH_CLASSES = tuple(map(type, SMOOTH))
TURNED = 75.0  # rad/s^2, of a wheel by the torques of `torque_size`


def any_rig(rng, wheels=(2, 3, 3, 3, 4, 5, 6)) -> Rig:
    """Some of `wheels` unlike wheels, orthogonal, as a tripod or around the sphere.

    With any profiles but those that jump, which a table over angles smears.
    """
    n, ballbot = int(rng.choice(wheels)), rng.random() < 0.5
    low, high = (0.02, 0.035) if ballbot else (0.06, 0.09)
    radius = float(rng.uniform(*((0.1, 0.16) if ballbot else (0.8, 1.4))))
    wheel, mass = rng.uniform(low, high, n), float(rng.uniform(*((1, 4) if ballbot else (4, 90))))
    wheel_mass = rng.uniform(*((0.05, 0.2) if ballbot else (0.2, 0.6)), n)
    contact, mount = rng.uniform(1e5, 8e5, n), rng.uniform(5e5, 3e6, n)
    rig = machine(
        _any_layout(rng, n),
        radius=wheel,
        mass=wheel_mass,
        inertia=wheel_mass * wheel**2 / 2,
        rollers=rng.integers(8, 18, n),
        roundness=rng.uniform(0.15, 0.6, n),
        contact_stiffness=contact,
        contact_damping=2 * rng.uniform(0.02, 0.3, n) * np.sqrt(contact * wheel_mass),
        mount_stiffness=mount,
        mount_damping=2 * rng.uniform(0.02, 0.3, n) * np.sqrt(mount * wheel_mass),
        closure_stiffness=rng.uniform(1e4, 4e4, n),
        preload=rng.uniform(60, 200, n),
        sphere_mass=mass,
        sphere_inertia=mass * radius**2 * rng.uniform(0.4, 0.67),
        platform_mass=rng.uniform(2, 12),
        centre_of_mass=1e-3 * rng.normal(size=3) * (rng.random() < 0.3),
        gravity=[0, 0, -9.81 * (rng.random() < 0.7)],
    )
    profiles = tuple(_any_profile(rng, float(r), float(b)) for r, b in
                     zip(rig.wheels.rollers, wheel, strict=True))  # fmt: skip
    return eqx.tree_at(
        lambda r: (r.sphere.radius, r.profiles), rig, (jnp.asarray(radius), profiles)
    )


def _any_layout(rng, n: int):
    if n == 3 and (kind := rng.integers(3)):
        return (ORTHOGONAL, SKEW)[kind - 1]
    around = 2 * np.pi * np.arange(n) / n + rng.uniform(-0.15, 0.15, n)
    tilt = rng.uniform(0.6, 1.1) + rng.uniform(-0.15, 0.15, n)
    across = np.sin(tilt)[:, None] * np.stack([np.cos(around), np.sin(around)], axis=1)
    normal = np.column_stack([-across, np.cos(tilt)])
    drive = np.stack([-np.sin(around), np.cos(around), 0 * around], axis=1)
    turn = (rng.uniform(-0.5, 0.5, n) * (rng.random() < 0.5))[:, None]
    return normal, np.cos(turn) * drive + np.sin(turn) * np.cross(normal, drive)


def _any_profile(rng, rollers: float, radius: float):
    kind = rng.random()
    if kind < 0.75:
        return SMOOTH[rng.integers(len(SMOOTH))]
    if kind < 0.95:
        return any_table(rng, rollers, 4e-4 * radius)
    return DualRow(jnp.asarray(radius * rng.uniform(0.05, 0.3)))


def any_table(rng, rollers: float, size: float) -> TableShape:
    """A measured profile of a pitch or of a whole turn, with harmonics of `size` (m) and less."""
    pitch = rng.random() < 0.5
    period, points = (2 * np.pi / rollers, rng.integers(5, 14)) if pitch else (
        2 * np.pi, rng.integers(24, 60))  # fmt: skip
    theta = (np.arange(points) + rng.uniform(-0.3, 0.3, points)) * period / points
    order = np.arange(1, 5)
    waves = np.sin(2 * np.pi * np.outer(theta, order) / period + rng.uniform(0, 6, 4))
    return TableShape.fit(np.sort(theta), waves @ (size * rng.normal(size=4) / order), period)


def torque_size(rig: Rig) -> float:
    """Torque (N m) that turns the least wheel by some `TURNED`, the sphere with it."""
    lever = np.asarray(rig.wheels.radius) / float(rig.sphere.radius)
    inertia = np.asarray(rig.wheels.inertia) + float(np.max(rig.sphere.inertia)) * lever**2
    return TURNED / rig.size * float(inertia.min())


def every_law(rng, rig: Rig) -> list[Law]:
    """One draw of each law that `any_laws` and `any_sensors` choose from."""
    laws = [draw() for draw in (*_elastic(rng, rig), *_turning(rng, rig))]
    for group in ("dR", "theta", "Omega", "a"):
        laws += _sensors(rng, rig, group, 1.0)
    return laws


def any_laws(rng, rig: Rig, port: str, count: int) -> list[Law]:
    """`count` laws without those of sensors: of the `elastic` machine or of its `turning`."""
    laws = (_elastic if port == "elastic" else _turning)(rng, rig)
    return [laws[k]() for k in rng.choice(len(laws), count, replace=False)]


def _elastic(rng, rig: Rig):
    def one():
        return f"w{rng.integers(rig.size) + 1}"

    def some():
        return one() if rng.random() < 0.6 else "all"

    u, w = rng.uniform, rig.wheels
    contact, mount = float(w.contact.stiffness.min()), float(w.mount.stiffness.min())
    sines = [f"w{i + 1}" for i, p in enumerate(rig.profiles) if isinstance(p, SMOOTH_CLASSES)]
    damaged = [lambda: ("damaged-roller", str(rng.choice(sines)),
                        {"roller": rng.integers(8), "severity": u(-0.3, 1)})]  # fmt: skip
    return [
        *(damaged if sines else ()),  # a table's ends are no round wheel: it would jump
        lambda: ("wheel-runout", one(), {"amplitude": u(1e-5, 1e-4), "phase": u(0, 6)}),
        lambda: ("sphere-out-of-round", "sphere",
                 {"amplitude": u(1e-5, 1e-4), "axis": rng.normal(size=3)}),
        lambda: ("contact-cubic", some(), {"K3": u(0.02, 0.5) * contact / DEFLECTION**2}),
        lambda: ("contact-hertz", some(), {"exponent": u(1.2, 1.7)}),
        lambda: ("contact-relaxation", some(),
                 {"K1": u(0.05, 0.5) * contact, "tau": 10 ** u(-2.5, -1)}),
        lambda: ("lift-off", some(), {}),
        lambda: ("mount-cubic", some(), {"k3": u(0.02, 0.5) * mount / DEFLECTION**2}),
        lambda: ("mount-backlash", one(), {"gap": u(0.05, 0.3) * DEFLECTION}),
        lambda: ("mount-friction", one(), {"force": u(0.1, 1) * float(w.mass.min())}),
        lambda: ("floor-vibration", "platform",
                 {"amplitude": u(0.1, 2), "frequency": u(2, 40), "phase": u(0, 6),
                  "direction": rng.normal(size=3)}),
    ]  # fmt: skip


def _turning(rng, rig: Rig):
    def one():
        return f"w{rng.integers(rig.size) + 1}"

    def some():
        return one() if rng.random() < 0.6 else "all"

    u, torque = rng.uniform, torque_size(rig)
    on_sphere = torque * float(rig.sphere.radius) / float(rig.wheels.radius.min())
    arm = on_sphere / float(rig.wheels.closure.preload.max())
    return [
        lambda: ("bearing-coulomb", some(), {"torque": u(0.02, 0.15) * torque}),
        lambda: ("bearing-viscous", some(), {"b": u(0.003, 0.02) * torque}),
        lambda: ("motor-ripple", one(), {"amplitude": u(0.02, 0.2) * torque,
                                         "order": rng.integers(1, 13), "phase": u(0, 6)}),
        lambda: ("motor-gain", one(), {"g": u(-0.1, 0.1)}),
        lambda: ("rolling-resistance", "all", {"arm": u(0.003, 0.03) * arm}),
        lambda: ("spin-resistance", "all", {"lever": u(0.003, 0.03) * arm}),
        lambda: ("air-drag", "sphere", {"D": u(0.01, 0.1) * on_sphere}),
        lambda: ("unbalance", "sphere", {"offset": rng.normal(size=3) * u(0.02, 0.2) * on_sphere
                                         / (9.81 * float(rig.sphere.mass))}),
        lambda: ("creep", one(), {"creepage": u(-0.03, 0.03)}),
        lambda: ("wheel-radius", one(), {"s": u(-0.01, 0.01)}),
        lambda: ("torque-offset", one(), {"torque": u(-0.1, 0.1) * torque}),
        lambda: ("actuator-delay", some(), {"delay": u(0.001, 0.02)}),
        lambda: ("actuator-lag", some(), {"tau": 10 ** u(-2.5, -1)}),
        lambda: ("actuator-saturation", one(), {"limit": u(0.4, 1.1) * torque}),
        lambda: ("cogging", one(), {"amplitudes": rng.uniform(0.01, 0.1, 2) * torque,
                                    "orders": rng.uniform(1, 14, 2), "phases": u(0, 6, 2)}),
        lambda: ("current-ripple", one(), {"g": u(0.01, 0.1), "order": rng.integers(1, 13),
                                           "phase": u(0, 6)}),
        lambda: ("stribeck", one(), {"torque": u(0.02, 0.15) * torque, "speed": u(0.1, 2)}),
        lambda: ("load-friction", some(), {"mu": u(0.01, 0.1)}),
        lambda: ("friction-asymmetry", one(), {"torque": u(0.01, 0.1) * torque}),
    ]  # fmt: skip


def any_sensors(rng, rig: Rig, sizes: dict[str, float], count: int) -> list[Law]:
    """`count` laws of sensors in any order, most at one group; `sizes`: of the groups' signals."""
    out: list[Law] = []
    while len(out) < count:
        group = out[0][1].split("_")[0] if out and rng.random() < 0.7 else rng.choice([*sizes])
        laws = _sensors(rng, rig, str(group), sizes[group])
        law = laws[rng.integers(len(laws))]
        if law[:2] not in [one[:2] for one in out]:
            out.append(law)
    return out


def _sensors(rng, rig: Rig, group: str, size: float) -> list[Law]:
    """One law of each kind for a group, whose signal is of that size."""
    u = rng.uniform
    end = rng.integers(rig.size) + 1 if group == "theta" else "xyz"[rng.integers(3)]
    channel = f"{group}_{end}"
    # an offset of Omega looks like a motion before the run, which a late sensor would show
    offset = 0.0 if group == "Omega" else u(-0.3, 0.3) * size
    limit = size * (u(0.8, 1.6) if group == "theta" else u(0.3, 1.2))
    gain = u(-0.1, 0.1) if rng.random() < 0.7 else u(-2.5, 0.5)
    pairs = rng.choice(["X_xy", "X_xz", "X_yx", "X_yz", "X_zx", "X_zy"], 3, replace=False)
    laws: list[Law] = [
        ("sensor-gain", group, {"g": gain}),
        ("sensor-delay", group, {"delay": u(0.0005, 0.008)}),
        ("sensor-lag", group, {"tau": 10 ** u(-3, -1.7)}),
        ("sensor-drift", channel, {"a": offset, "b": u(-0.3, 0.3) * size}),
        ("sensor-saturation", str(rng.choice([group, channel])), {"limit": limit}),
        ("sensor-rectified", channel, {}),
    ]
    if group == "dR":
        laws.append(("sensor-crosstalk", group, {str(k): u(-0.1, 0.1) for k in pairs}))
    if group == "theta":
        laws.append(("encoder-eccentricity", channel,
                     {"amplitude": u(5e-4, 5e-3), "phase": u(0, 6)}))  # fmt: skip
    return laws


def with_laws(rig: Rig, laws) -> Rig:
    """The rig with more laws."""
    for name, place, values in laws:
        law = EFFECTS[name](**{k: jnp.asarray(v, float) for k, v in values.items()})
        rig = rig.add(law, place)
    return rig
