"""Hold, mobility, weight, small systems and matrices against numbers of their own."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from machines import ORTHOGONAL, SKEW, machine
from moment_cases import PARTS, SKEW4
from moments import slope
from test_formulas import made, near

from omnijax._errors import InputError
from omnijax.dynamics import (
    Coupled,
    ElasticState,
    Paper,
    Pointwise,
    PortInputs,
    check_model,
    fitting_speeds,
    flatten,
    free_projector,
    free_system,
    held,
    held_directions,
    hold_obstacle,
    linear_system,
    minimum_normal_force,
    mobility,
    same_contacts,
    sliding,
    sliding_of,
    sliding_remarks,
    weight,
)
from omnijax.dynamics._hold import PARALLEL
from omnijax.dynamics._kinematics import Rolling
from omnijax.dynamics._remarks import _components
from omnijax.dynamics._rotation import rotation_response
from omnijax.dynamics._small import inverse, pseudoinverse, solve
from omnijax.laws._shapes import is_turn
from omnijax.simulation import Signal, is_constant, speeds, table
from omnijax.simulation._drives import check_drive

pytestmark = pytest.mark.brief


def with_normals(normal):
    """A rig whose normals are `normal` (n, 3)."""
    normal = np.asarray(normal, float)
    rig = machine((normal, np.zeros_like(normal)))
    return eqx.tree_at(lambda r: r.wheels.normal, rig, jnp.asarray(normal))


def check_hold():
    """Product over sum of pairwise products of the eigenvalues of sum r r^T, against 1e-12."""
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    for share, holds in ((0.8, False), (1.25, True), (1e6, True)):
        for first, second in ((1.0, 1.0), (3.0, 0.7), (0.4, 0.2)):
            # L1 L2 L3/(L1 L2 + (L1 + L2) L3) = t  ->  L3 = t/(1 - t (1/L1 + 1/L2))
            t = share * 1e-12
            third = t / (1 - t * (1 / first + 1 / second))
            rig = with_normals(np.sqrt([[first], [second], [third]]) * turn)
            assert bool(held(rig)) == holds, (share, first)
    for drawn in np.random.default_rng(1).normal(size=(20, 3)):  # parallel, but for rounding
        axis = drawn / np.linalg.norm(drawn)
        assert not held(with_normals([axis, -axis, axis * (1 + 1e-15)]))
    plane = [[1, 0, 0], [0, 1, 0], [0.6, 0.8, 0]]
    for normal, count in ((np.eye(3), 3), (plane, 2), ([[0, 1, 0]] * 3, 1)):
        rig = with_normals(normal)
        assert held_directions(rig) == count and bool(held(rig)) == (count == 3)
        assert bool(held(rig, "paper")) is True


def check_free_directions():
    """Across the plane of the normals, however many; both directions across parallel ones."""
    up, tilted = np.diag([0.0, 0.0, 1.0]), np.array([0.36, 0.48, 0.8])
    plane = [[1, 0, 0], [0.6, 0.8, 0], [0, -1, 0], [-0.8, 0.6, 0]]
    near(free_projector(with_normals(plane[:2])), up)
    near(free_projector(with_normals(plane)), up)
    for normals in ([tilted], [tilted, -tilted], [tilted] * 4):
        near(free_projector(with_normals(normals)), np.eye(3) - np.outer(tilted, tilted))
    near(free_projector(with_normals(np.eye(3))), np.zeros((3, 3)))
    for share, across in ((0.8, False), (1.25, True)):  # of what counts as parallel
        sine = np.sqrt(share * PARALLEL)
        pair = np.array([[1.0, 0.0, 0.0], [np.sqrt(1 - sine**2), sine, 0.0]])
        mean = np.eye(3) - pair.T @ pair / 2
        near(free_projector(with_normals(pair)), up if across else mean)


def check_mobility():
    """Orthogonal wheels of unlike radii; four skewed ones, whose conflicts turn nothing."""
    radius = np.array([0.05, 0.06, 0.08])
    found = mobility(machine(ORTHOGONAL, radius=radius))
    axes = np.eye(3)[[1, 2, 0]]  # drive x normal
    near(found.to_wheels, 1.22 / radius[:, None] * axes)
    near(found.to_sphere, (axes * radius[:, None] / 1.22).T)
    near(found.strength, [1, 1, 1])
    turned = fitting_speeds(machine(ORTHOGONAL, radius=radius), [0.3, -0.2, 0.5])
    near(turned, 1.22 * np.array([-0.2, 0.5, 0.3]) / radius)
    assert found.driven == 3 and found.condition == pytest.approx(1) and not len(found.conflicts)
    unlike = mobility(machine((SKEW4[0], SKEW4[1]), radius=[0.05, 0.06, 0.08, 0.07]))
    spins = -np.cross(*map(np.array, SKEW4))
    squares = np.sort(np.linalg.eigvalsh(spins.T @ spins))[::-1]
    near(unlike.strength, np.sqrt(squares / squares[0]), 1e-9)
    assert unlike.condition == pytest.approx(np.sqrt(squares[0] / squares[2]))
    (conflict,) = unlike.conflicts
    np.testing.assert_allclose(unlike.to_sphere @ conflict, 0, atol=1e-12)
    near(np.linalg.norm(conflict * [0.05, 0.06, 0.08, 0.07]), 1.22)
    np.testing.assert_allclose(unlike.to_sphere @ unlike.to_wheels, np.eye(3), atol=1e-12)
    thin = mobility(machine([part[:2] for part in SKEW]))
    assert thin.driven == 2 and len(thin.undriven()) == 1
    np.testing.assert_allclose(thin.to_wheels @ thin.undriven()[0], 0, atol=1e-12)


def check_weight():
    """5 kg under (3, 4, 12) m/s^2: 65 N on wheels below; 6.825 kg of platform and wheels above."""
    given = {"gravity": [-3.0, -4.0, -12.0]}
    below = weight(machine(ORTHOGONAL, **given))
    near(below.normal, [15, 20, 60])
    assert (below.what, below.force) == ("the sphere on the wheels", pytest.approx(65.0))
    assert below.missing == pytest.approx(0, abs=1e-12)
    above = weight(machine(ORTHOGONAL, gravity=[3.0, 4.0, 12.0]))
    near(above.normal, [20.475, 27.3, 81.9])
    assert above.what == "platform and wheels on the sphere"
    assert above.force == pytest.approx(88.725)
    two = weight(machine([part[:2] for part in ORTHOGONAL], **given))
    near(two.normal, [15, 20])
    assert two.missing == pytest.approx(60)
    assert weight(machine()) is None


def check_sliding():
    """What is left of rim speeds after the nearest turn of the sphere."""
    radius, speed = np.array([0.05, 0.06, 0.08, 0.07]), np.array([3.0, -2.0, 5.0, 1.0])
    rig = machine(SKEW4, radius=radius)
    axes, rim = 1.22 * -np.cross(*map(np.array, SKEW4)), radius * speed
    slid = axes @ np.linalg.lstsq(axes, rim, rcond=None)[0] - rim
    near(sliding(rig, speed), slid, 1e-10)
    several = sliding_of(rig, np.stack([speed, 2 * speed, 0.5 * speed]))
    near(several.speed, 2 * np.abs(slid), 1e-9)
    assert several.share == pytest.approx(np.abs(slid).max() / np.abs(rim).max())
    (said,) = sliding_remarks(rig.names, several)
    each = (f"{name} {1e3 * x:.3g} mm/s" for name, x in zip(rig.names, several.speed, strict=True))
    assert f"the contacts slide by {', '.join(each)}. " in said
    assert sliding_remarks(rig.names, sliding_of(rig, np.zeros((1, 4)))) == []
    assert _components(np.array([-1e-9, 0.25, -0.5])) == "0, 0.25, -0.5"


def check_small_systems():
    """Whole numbers: A (1, -2, 3) and A (0, 1, 2), with a zero where the first pivot would be."""
    matrix = jnp.array([[0.0, 2.0, 1.0], [4.0, 1.0, 0.0], [2.0, 0.0, 5.0]])
    right = jnp.array([-1.0, 2.0, 17.0])
    near(solve(matrix, right), [1, -2, 3])
    near(inverse(matrix) * -42, [[5, -10, -1], [-20, -2, 4], [-2, 4, -8]])
    near(solve(jnp.diag(jnp.array([2.0, 4.0, 5.0, 8.0])), jnp.ones(4)), [0.5, 0.25, 0.2, 0.125])
    near(pseudoinverse(jnp.array([[3.0, 0, 0], [4.0, 0, 0]])), [[0.12, 0.16], [0, 0], [0, 0]])


def check_rotation_response():
    """A unit of every torque in the un-eliminated equations of shafts, sphere and no slip."""
    rig = machine(SKEW4, **PARTS)
    axes = -np.cross(*map(np.array, SKEW4))
    radius, I_w = np.array([0.05, 0.06, 0.08, 0.07]), np.asarray(rig.wheels.inertia)
    inertia, zero = np.asarray(PARTS["sphere_inertia"]), np.zeros
    rows = np.vstack([
        np.hstack([np.diag(radius), np.diag(I_w), zero((4, 3))]),
        np.hstack([-1.22 * axes.T, zero((3, 4)), inertia]),
        np.hstack([zero((4, 4)), -np.diag(radius), 1.22 * axes]),
    ])  # fmt: skip
    causes = np.diag([1.0] * 4 + [-1.0] * 3 + [0.0] * 4)[:, :7]
    expected = np.linalg.solve(rows, causes)[[0, 1, 2, 3, 8, 9, 10]].T
    geometry = Rolling(jnp.asarray(radius), jnp.asarray(axes))
    near(rotation_response(rig, geometry, jnp.asarray(inertia)), expected, 1e-9)


def check_minimum_normal_force():
    near(minimum_normal_force(jnp.array([-3.0, 4.0]), jnp.array([0.5, 0.8])), [6.0, 5.0])


def check_still():
    """Deflected and at rest: neither body moves, whatever the dampers' shifts hold."""
    rig = machine(SKEW)
    shape, mount = jnp.array([1e-4, -2e-4, 3e-4]), jnp.array([1e-5, 2e-5, -3e-5])
    for model in (Coupled(rig), Paper(rig)):
        found = model.motion(model.still(jnp.array([3e-4, 1e-4, -2e-4]), mount, shape), shape)
        for part in (found.velocity, found.approach_rate, found.mount_rate, found.platform):
            np.testing.assert_allclose(part, 0, atol=1e-14)
        near(found.mount, mount)


def check_outputs():
    """The rows of outputs are the motion and the platform's acceleration."""
    rig, rng = machine(SKEW, **PARTS), np.random.default_rng(6)
    coupled = Coupled(rig)
    state = ElasticState(*(jnp.asarray(rng.normal(size=3)) for _ in range(4)))
    inputs = PortInputs(*(jnp.asarray(rng.normal(size=3)) for _ in range(6)))
    system, y, u = linear_system(coupled), flatten(state), flatten(inputs)
    motion = coupled.motion(state, inputs.shape)
    expected = motion._asdict() | {"acceleration": coupled.platform_acceleration(state, inputs)}
    for name, value in expected.items():
        C, D = system.row(name)
        near(C @ y + D @ u, value, 1e-9)
    near(free_system(coupled)[0], system.A)
    near(free_system(coupled)[1], system.row("displacement")[0])
    assert (
        system.outputs["acceleration"].stop
        == len(system.C)
        == sum(len(value) for value in expected.values())
    )


def check_printed_matrices():
    """Columns of the printed form by differences of it, wheel by wheel."""
    form = Pointwise(machine(SKEW))
    A, b = form.matrices()
    zero = jnp.zeros((4, 3))
    for j in range(4):
        column = slope(lambda s, j=j: np.asarray(form.rate(zero.at[j].set(s), zero[0])), 0.0, 1.0)
        near(A[:, :, j], column.T, 1e-9)
    near(b, slope(lambda s: np.asarray(form.rate(zero, zero[0] + s)), 0.0, 1.0).T, 1e-9)


def check_numbers_of_a_rig():
    """Inertia of one number is the same about every axis; a radius is 2 % larger by its law."""
    rig = machine(ORTHOGONAL, radius=[0.05, 0.06, 0.08])
    near(rig.sphere.inertia_matrix, 4.961 * np.eye(3))
    rig = rig.add(made("wheel-radius", {"s": 0.02}), "w2")
    near(rig.wheel_radius, [0.05, 0.0612, 0.08])


def check_times_from_a_start():
    """Speeds with a ramp and a jump, and a force, counted from 0.3 s on: read 0.3 s earlier."""
    turning = table([0.1, 0.5, 0.5], [[1.0, -2.0], [3.0, 6.0], [-1.0, 0.5]])
    drive = speeds(turning, table([0.2, 0.9], [[1.0, 2.0, 3.0], [4.0, -1.0, 0.0]]), [0.4, -0.7])
    moved = drive.since(0.3)
    near(moved.speed(0.1), [2.5, 4.0])  # three quarters up the ramp
    for t in (-0.35, -0.1, 0.1, 0.25, 0.7):
        near(moved.speed(t), drive.speed(t + 0.3))
        near(moved.force(t), drive.force(t + 0.3))
    near(moved.initial_angle, [0.4, -0.7])


def check_hold_in_words():
    parallel = with_normals([[0, 0, 1], [0, 0, 1], [0, 0, -1]])
    across = with_normals(np.eye(3))  # their drive directions span nothing
    for rig, holds in ((parallel, False), (across, True)):
        assert (hold_obstacle(rig) is None) == holds == bool(held(rig))
        assert hold_obstacle(rig, "paper") is None


def check_same_contacts():
    """Of w1 and w3 by a part in 1e7; not of opposite wheels, nor of 6e-6 rad."""
    near_by = [1.0, 6e-6, 0.0]
    normal = [[1, 0, 0], [-1, 0, 0], [1, 1e-7, 0], near_by, [0, 0, 1]]
    assert same_contacts(with_normals(normal)) == [(0, 2)]


def check_periods_of_a_turn():
    """2 pi, also written in seven digits."""
    assert [is_turn(x) for x in (6.283185307, 6.283185, 6.2831, 3.14159265, 0.45)] == [
        True, True, False, False, False,
    ]  # fmt: skip
    assert not is_turn(-6.283185307)


def check_constant_signals():
    """A signal of several knots is constant where neither its values nor its slopes say else."""
    for values, slopes, constant in (
        ([[2.0], [2.0]], [[0.0], [0.0]], True),
        ([[0.0], [0.0]], [[3.0], [0.0]], False),
        ([[2.0], [5.0]], [[0.0], [0.0]], False),
        ([[2.0], [2.0]], [[1.0], [1.0]], False),
    ):
        signal = Signal(jnp.array([0.0, 1.0]), jnp.array(values), jnp.array(slopes))
        assert is_constant(signal) == constant


def check_numbers_of_a_drive():
    """A ramp of 2 a second from 1 over 3 s, then a jump to 5; what no drive may hold."""
    knots, values = jnp.array([0.0, 3.0]), jnp.array([[1.0], [5.0]])
    ramp = Signal(knots, values, jnp.array([[2.0], [0.0]]))
    near(np.sort(ramp.around_knots()[:, 0]), [1, 5, 7])
    rig = machine()
    check_drive(rig, speeds([1.0, 2.0, 3.0]))  # held, and not at 0
    on = speeds(Signal(knots, jnp.zeros((2, 3)), jnp.array([[0.0] * 3, [0.0, 0.5, 0.0]])))
    with pytest.raises(InputError, match=r"its last slopes are \[0.0, 0.5, 0.0\]"):
        check_drive(rig, on)
    with pytest.raises(InputError, match="must be finite, but is -inf"):
        check_drive(rig, speeds([1.0, -np.inf, 0.0]))
    with pytest.raises(InputError, match="must be one of coupled, paper, but is 'papers'"):
        check_model("papers")


CHECKS = {
    "constant signals": check_constant_signals,
    "numbers of a drive": check_numbers_of_a_drive,
    "hold": check_hold,
    "hold in words": check_hold_in_words,
    "same contacts": check_same_contacts,
    "periods of a turn": check_periods_of_a_turn,
    "free directions": check_free_directions,
    "mobility": check_mobility,
    "weight": check_weight,
    "sliding": check_sliding,
    "small systems": check_small_systems,
    "response of the rotation": check_rotation_response,
    "minimum normal force": check_minimum_normal_force,
    "still": check_still,
    "outputs": check_outputs,
    "matrices as printed": check_printed_matrices,
    "numbers of a rig": check_numbers_of_a_rig,
    "times from a start": check_times_from_a_start,
}


@pytest.mark.parametrize("name", list(CHECKS))
def test_mechanics(name):
    CHECKS[name]()
