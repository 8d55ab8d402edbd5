"""The forced linear system of a rig at constant speeds, in a form where only rho enters.

The model's own formulas give, by differentiation (exact: they are linear in the supported rigs),

    dy/dt = A y + B0 rho + B1 drho/dt + E a + P_in P        out = C y + D0 rho + D1 drho/dt + ...

drho/dt comes from the drive forces that prescribed speeds need.  It is removed by y = s + B1 rho:

    ds/dt = A s + (A B1 + B0) rho                    out = C s + (C B1 + D0) rho + D1 drho/dt
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ...dynamics import (
    ELASTIC_PORTS,
    TRANSLATIONS,
    AbstractTranslation,
    PortInputs,
    check_model,
    free_projector,
    initial_memory,
    port_forces,
    pseudoinverse,
)
from ...laws import (
    EFFECTS,
    AbstractLaw,
    DamagedRoller,
    FloorVibration,
    TableShape,
    WheelRunout,
    has_pieces,
    of_library,
)
from ...rig import Rig, over_wheels
from .._signals import is_traced
from .forcing import period_kind, room_obstacle
from .linear_laws import linear_obstacle, says_linear

OUTPUTS = ("dR", "dR_elastic", "approach", "a_sphere")
ACCELERATIONS = ("a_sphere",)  # of these: what wheels at rest leave at 0


class ForcedSystem(NamedTuple):
    """A, the input columns and the outputs, one row a signal of the forcing."""

    A: Float[Array, "m m"]
    column: Float[Array, "g m"]  # of ds/dt
    shift: Float[Array, "g m"]  # B1: y = s + shift rho
    state: dict[str, Float[Array, "o m"]]  # C
    direct: dict[str, Float[Array, "g o"]]  # C B1 + D0
    rate: dict[str, Float[Array, "g o"]]  # D1
    push: dict[str, Float[Array, "o 3"]]  # of a constant force on the platform
    force: Float[Array, "m 3"]  # into ds/dt, of that force
    drift: Float[Array, "3 3"]  # into dU/dt, of that force
    rest: Float[Array, "m g"]  # -A^-1 B0: y at static equilibrium per unit of rho

    def of_signals(self, index: np.ndarray) -> "ForcedSystem":
        """The system under some of its signals alone."""
        return self._replace(
            column=self.column[index],
            shift=self.shift[index],
            direct={name: x[index] for name, x in self.direct.items()},
            rate={name: x[index] for name, x in self.rate.items()},
            rest=self.rest[:, index],
        )


def exact_obstacle(rig: Rig, model: str = "coupled") -> str | None:
    """Why the exact path does not take this rig, in words; None where it does.

    Raises `InputError` for an unknown `model`.
    """
    check_model(model)
    reason = _shape_obstacle(rig) or _law_obstacle(rig, model)
    return reason or (None if model == "paper" else _turning_obstacle(rig))


def _shape_obstacle(rig: Rig) -> str | None:
    for i, profile in enumerate(rig.profiles):
        if not has_pieces(profile):
            return f"wheel {rig.names[i]}'s profile `{profile.id}` has no closed form"
        laws = [p.law for p in rig.at("shape") if i in p.wheels]
        kind, damaged = period_kind(rig, i), any(isinstance(law, DamagedRoller) for law in laws)
        if damaged and kind != "pitch":
            return f"a damaged roller on wheel {rig.names[i]}, whose profile is not one pitch long"
        if damaged and isinstance(profile, TableShape):
            return f"a damaged roller on wheel {rig.names[i]}, whose profile is a table"
        if kind == "own" and laws and isinstance(profile, TableShape):
            return f"wheel {rig.names[i]}'s table repeats after neither its pitch nor a turn"
        if laws and kind == "pitch" and (full := room_obstacle(rig, i)) is not None:
            return full
    return None


def _law_obstacle(rig: Rig, model: str) -> str | None:
    known = {
        "shape": (DamagedRoller, WheelRunout),
        "platform": (FloorVibration,),
        "radius": object,
        "command": object,
        "actuator": object,
        "shaft": object,
        "sensor": object,
        "kinematics": object,
    }
    if model == "paper":  # what only turns the sphere does not enter its translation there
        known |= {"sphere": object, "rolling": object}
    for placed in rig.effects:
        if placed.law.port in ELASTIC_PORTS and says_linear(placed.law):
            if (reason := linear_obstacle(placed.law)) is not None:
                return reason
            continue
        kinds = known.get(placed.law.port, ())
        if kinds is not object and type(placed.law) not in kinds:  # one below them is another law
            return f"law `{placed.law.id}` {_why_not(placed.law)}"
    return None


def _why_not(law: AbstractLaw) -> str:
    """Why a law is outside the linear class, in words.

    A sphere out of round shows P2(e . Q^T R_i) of its attitude Q, and Q' = Omega x Q with Omega =
    J(r_b + rho) omega: gaps and runout move Omega, so that Q follows no sum of the wheels' lines.
    """
    if of_library(law, EFFECTS):
        turning = "is not linear in the sphere's rate, which the wheels' shapes move"
        attitude = (
            "hangs on the sphere's attitude, which is no function of the wheels' angles (the "
            "sphere's rate follows their rolling radii, gaps included)"
        )
        of_port = {"surface": attitude, "sphere": turning, "rolling": turning}
        return of_port.get(law.port, "is not linear in the elastic state")
    silent = ", as it does not say `linear = True`" if law.port in ELASTIC_PORTS else ""
    return f"has no closed form here{silent}"


def _turning_obstacle(rig: Rig) -> str | None:
    inertia = rig.sphere.inertia
    if jnp.ndim(inertia) == 2 and not is_traced(inertia):
        matrix = np.asarray(inertia)
        if not np.allclose(matrix, matrix[0, 0] * np.eye(3), rtol=1e-12, atol=0):
            return "the sphere's inertia is not the same about every axis"
    offset = rig.sphere.centre_of_mass
    if not is_traced(offset) and np.any(np.asarray(offset)):
        return "the sphere's centre of mass is off its centre"
    return None


def drive_gain(rig: Rig, speeds: Float[Array, " n"], creep: bool = True):
    """f = gain drho/dt: (I_s/R^2) [axes^T]^+ [axes]^+ diag(omega (1 + creep)), equal inertias."""
    factor = 1 + over_wheels(rig.at("kinematics") if creep else (), speeds, rig.size)
    back = pseudoinverse(rig.wheels.spin_axis)
    inertia = rig.sphere.inertia_matrix[0, 0] / rig.sphere.radius**2
    return inertia * back.T @ back * (speeds * factor)


def responses(translation: AbstractTranslation, gain):
    """(y, rho, drho/dt, floor, force) -> (dy/dt, outputs); linear in all of them."""
    rig = translation.rig
    _, unravel = ravel_pytree((translation.rest(), initial_memory(rig)))
    normal = rig.wheels.normal

    def respond(y, shape, shape_rate, floor, force):
        state, memory = unravel(y)
        motion = translation.motion(state, shape)
        contact, mount, tension, memory_rate = port_forces(rig, motion, shape_rate, memory)
        drive = gain @ shape_rate
        ports = PortInputs(shape, contact, mount, drive, force, floor)
        rate = ravel_pytree((translation.rate(state, ports), memory_rate))[0]
        closure = rig.wheels.closure.preload + rig.wheels.closure.stiffness * motion.approach
        sphere = normal.T @ (tension - closure) + rig.wheels.drive.T @ drive
        outputs = {
            "dR": motion.displacement,
            "dR_rate": motion.velocity,
            "dR_elastic": normal.T @ (motion.deflection + motion.mount),
            "approach": motion.approach,
            "a_sphere": sphere / rig.sphere.mass,
            "a": translation.platform_acceleration(state, ports),
            "normal_force": tension,
            "drive_force": drive,
            "platform": motion.platform,
            "drift": translation.drift_acceleration(ports),
        }
        return rate, outputs

    return respond


def forced_system(rig: Rig, model: str, speeds, wheel: tuple[int, ...]) -> ForcedSystem:
    """The system behind the signals of `wheel` (-1: the floor), at constant `speeds` (rad/s)."""
    translation = TRANSLATIONS[model](rig)
    respond = responses(translation, drive_gain(rig, speeds))
    n = rig.size
    y = ravel_pytree((translation.rest(), initial_memory(rig)))[0]
    zero = (y, jnp.zeros(n), jnp.zeros(n), jnp.zeros(3), jnp.zeros(3))
    # what nobody asks of the floor or the force is then not worked out
    parts = [jax.jacfwd(respond, argnums=some)(*zero) for some in ((0, 1, 2), (3,), (4,))]
    A, B0, B1, floor_in, force_in = (rate for rates, _ in parts for rate in rates)
    outputs = {k: [x for _, each in parts for x in each[k]] for k in parts[0][1]}

    def columns(by_wheel, by_floor):
        wheels = [None if i < 0 else by_wheel[:, i] for i in wheel]
        directions = iter(_floor_directions(rig))
        return jnp.stack([by_floor @ next(directions) if w is None else w for w in wheels])

    column = columns(A @ B1 + B0, floor_in)
    shift = columns(B1, 0 * floor_in)
    return ForcedSystem(
        A,
        column,
        shift,
        {k: v[0] for k, v in outputs.items()},
        {k: columns(v[0] @ B1 + v[1], v[3]) for k, v in outputs.items()},
        {k: columns(v[2], 0 * v[3]) for k, v in outputs.items()},
        {k: v[4] for k, v in outputs.items()},
        force_in,
        outputs["drift"][4],
        columns(static_rest(rig, model, A, B0), 0 * floor_in).T,
    )


def static_rest(rig: Rig, model: str, A, B0) -> Float[Array, "m n"]:
    """-A^-1 B0, y at static equilibrium per unit of rho: only deflections and memory are unknown.

    The momenta are those of a machine in which nothing moves (`AbstractTranslation.still`).  Where
    the wheels leave the sphere free to move it stays.  `static_start` solves for the same unknowns
    from the formulas, where laws need not be linear and angles are known.
    """
    translation, n = TRANSLATIONS[model](rig), rig.size
    state = translation.rest()
    still = jax.jacfwd(lambda rho: ravel_pytree(translation.still(*state[:2], rho))[0])
    half = n + len(state.approach)  # deflections, then as many momenta, then memory
    whole = jnp.pad(still(jnp.zeros(n)), ((0, len(A) - 2 * half), (0, 0)))
    unknown = np.r_[:half, 2 * half : len(A)]
    forces, right = A[half:], A[half:] @ whole + B0[half:]
    matrix = forces[:, unknown]
    if model == "coupled":  # approach and momentum come first
        matrix = matrix.at[:3, :3].add(-rig.wheels.contact.stiffness[0] * free_projector(rig))
    return whole.at[unknown].add(-jnp.linalg.solve(matrix, right))


def _floor_directions(rig: Rig) -> list[Array]:
    laws: list[Any] = [placed.law for placed in rig.at("platform")]
    return [law.direction / jnp.sqrt(law.direction @ law.direction) for law in laws]


def balanced(system: ForcedSystem) -> tuple[ForcedSystem, Float[Array, " m"]]:
    """The same system in state units that make A's rows and columns of equal size; the units."""
    unit = state_units(system.A)
    scaled = system._replace(
        A=system.A * unit[None, :] / unit[:, None],
        column=system.column / unit,
        shift=system.shift / unit,
        state={k: v * unit for k, v in system.state.items()},
        force=system.force / unit[:, None],
    )
    return scaled, unit


def state_units(A: Float[Array, "m m"]) -> Float[Array, " m"]:
    """Units in which the rows and columns of A are of equal size (not differentiated)."""
    size = jax.lax.stop_gradient(jnp.abs(A))
    size = size - jnp.diag(jnp.diag(size))

    def even(unit, _):
        scaled = size * unit[None, :] / unit[:, None]
        rows, cols = jnp.sum(scaled, axis=1), jnp.sum(scaled, axis=0)
        good = (rows > 0) & (cols > 0)
        ratio = jnp.where(good, rows, 1.0) / jnp.where(good, cols, 1.0)
        return unit * ratio**0.25, None

    unit = jax.lax.scan(even, jnp.ones(len(size)), None, length=30)[0]
    return jax.lax.stop_gradient(unit)


def with_integrals(system: ForcedSystem) -> ForcedSystem:
    """The system with the platform's place X, drift U and each signal's integrals L, LL as states.

    dX/dt = U + platform, dU/dt = drift, dL/dt = rho, dLL/dt = L; only A, the columns, `shift` and
    `force` are of this size.
    """
    m, g = len(system.A), len(system.column)
    A = jnp.zeros((m + 8, m + 8)).at[:m, :m].set(system.A)
    A = A.at[m : m + 3, :m].set(system.state["platform"])
    A = A.at[m : m + 3, m + 3 : m + 6].set(jnp.eye(3)).at[m + 7, m + 6].set(1.0)
    column = jnp.concatenate(
        [
            system.column,
            system.direct["platform"],
            system.direct["drift"],
            jnp.ones((g, 1)),
            jnp.zeros((g, 1)),
        ],
        axis=1,
    )
    force = jnp.concatenate([system.force, jnp.zeros((3, 3)), system.drift, jnp.zeros((2, 3))])
    shift = jnp.pad(system.shift, ((0, 0), (0, 8)))
    return system._replace(A=A, column=column, shift=shift, force=force, state={})
