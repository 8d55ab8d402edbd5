"""A method gives, for everything that may be varied, the figures of `simulate` on each design.

All quantities of a rig, of its effects and of its drive are columns of one program for a method: a
row changes one of them, to one value or three, the others as drawn.  What a method drops makes its
row equal the row of nothing changed, while `simulate` moves.
"""

import dataclasses
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import ANY_SPEEDS, ORTHOGONAL, SKEW, drawn_machine, machine
from seeds import drawn_anew

from omnijax import laws, load_laws, set_parameter, sweep
from omnijax.rig import get_parameter, parameter_info
from omnijax.simulation import TorqueDrive, ramp, simulate, speeds, steady_state, torques
from omnijax.study import Variable, parse_study
from omnijax.study._design.cases import RigCases
from omnijax.study._evaluation import (
    Evaluation,
    Question,
    Rows,
    apply,
    drive_quantities,
    samples_of,
)
from omnijax.study._evaluation.fixed_steps import (
    TOLERANCE,
    checked_after,
    fine_enough,
    sample_to_check,
)
from omnijax.study._evaluation.methods import METHODS, gathers, obstacle
from omnijax.study._file.study import LoadCase
from omnijax.study._parameters import scalar_parameters
from omnijax.vibration import evaluate

pytestmark = [pytest.mark.long, ANY_SPEEDS]

METRICS = ("rms", "peak")

OTHERS = (  # one of each channel, read from samples
    "elastic_rms", "peak_to_peak_y", "sphere_acceleration_peak", "platform_acceleration_rms",
    "lift_off_margin", "slip_margin",
)  # fmt: skip


def way(method: str, rig, names, times, substeps: int) -> Evaluation:
    """An evaluation by a method, as it is chosen."""
    gathered = gathers(method, rig, "coupled", names)
    return Evaluation(method, names, times=times, substeps=substeps, gathered=gathered)


def around(*degrees):
    """Normals and drive directions of wheels around the sphere."""
    angles = np.deg2rad(degrees)
    normals = [[-0.7 * np.cos(a), -0.7 * np.sin(a), np.sqrt(0.51)] for a in angles]
    return normals, [[-np.sin(a), np.cos(a), 0.0] for a in angles]


LAYOUTS = {
    "orthogonal": ORTHOGONAL,
    "tripod": SKEW,
    "four": around(10.0, 95.0, 190.0, 280.0),
    "five": around(10.0, 80.0, 155.0, 220.0, 290.0),
}


def plain(rig):
    """The rig as it is."""
    return rig


def linear_effects(rig):
    """What a closed form honours, of periods of one pitch."""
    number = jnp.asarray
    floor = laws.FloorVibration(
        number(0.3), number(7.5), number(0.2), jnp.array([0.6, 0.0, 0.8])
    )  # fmt: skip
    relaxing = laws.ContactRelaxation(number(4e4), number(90.0))
    rig = rig.add(relaxing, "w2").add(floor, "platform")
    return rig.add(laws.WheelRadius(number(0.01)), "w1").add(laws.Creep(number(0.02)), "w3")


def effects_of_a_turn(rig):
    """What a closed form honours, of periods of one turn of a wheel."""
    number = jnp.asarray
    runout = laws.WheelRunout(number(6e-5), number(0.4))
    damaged = laws.DamagedRoller(number(2.0), number(0.5))
    return rig.add(runout, "w1").add(damaged, "w2")


def effects_under_torques(rig):
    """What fixed steps follow beside the linear model, without laws that are still under constant
    torques: a slow drive begins settled.
    """
    number = jnp.asarray
    everywhere = (
        laws.ContactCubic(number(3e11)), laws.MountCubic(number(3e13)),
        laws.BearingViscous(number(0.02)), laws.RollingResistance(number(5e-4)),
    )  # fmt: skip
    for law in everywhere:
        rig = rig.add(law, "all")
    rig = rig.add(laws.MotorRipple(number(0.1), number(3.0), number(0.4)), "w1")
    rig = rig.add(laws.TorqueOffset(number(0.2)), "w2").add(laws.AirDrag(number(100.0)), "sphere")
    return linear_effects(rig.add(laws.MotorGain(number(0.05)), "w3"))


def columns_of(rig, drive):
    """Paths of all single numbers, and what each is."""
    quantities = drive_quantities(drive, rig.names)
    own = [p for p in quantities if not p.endswith(".scale")]
    paths = (*scalar_parameters(rig), *own, *(p for p in quantities if p.endswith(".scale")))
    given = {
        f"{name}.{end}": value
        for name, values in _values(drive).items()
        for end, value in zip(_ends(name, rig), values, strict=True)
    }
    base = [
        given[p] if p in given else 1.0 if p in quantities else float(get_parameter(rig, p))
        for p in paths
    ]
    return paths, np.array(base)


def _ends(name, rig):
    return "xyz" if name == "force" else rig.names


def kind_of(drive):
    return "torque" if isinstance(drive, TorqueDrive) else "speed"


def _values(drive):
    kind = kind_of(drive)
    return {
        kind: np.asarray(getattr(drive, kind).values[0]),
        "force": np.asarray(drive.force.values[0]),
        "angle": np.asarray(drive.initial_angle),
    }


def three(rig, path, value, rng, quantities):
    """Three values beside `value`, in the quantity's range."""
    if path in quantities:
        if path.endswith(".scale"):
            return value * rng.uniform(0.6, 1.5, 3)
        size = {"force": 40.0, "angle": 0.05}.get(path.split(".")[0], 0.5 * abs(value))
        return value + size * rng.uniform(0.3, 1.0, 3) * np.array([-1, 1, 0.5])
    info = parameter_info(rig, path)
    if info.whole:
        return value + np.array([-2, 1, 3])
    moved = value * rng.uniform([0.6, 1.1, 1.3], [0.9, 1.25, 1.6])
    return np.clip(moved, info.low, 0.95 * info.high if np.isfinite(info.high) else None)


def design(rig, drive, paths, row, base):
    """Rig and drive of a row, built anew, as a user would."""
    quantities = drive_quantities(drive, rig.names)
    at = dict(zip(paths, row, strict=True))
    parts = {
        name: np.array([at[f"{name}.{end}"] for end in _ends(name, rig)]) for name in _values(drive)
    }
    kind = kind_of(drive)
    turning, force = parts[kind] * at[f"{kind}.scale"], parts["force"] * at["force.scale"]
    for j in np.flatnonzero(row != base):
        if paths[j] not in quantities:
            rig = set_parameter(rig, paths[j], row[j])
    return rig, {"speed": speeds, "torque": torques}[kind](turning, force, parts["angle"])


def taken(how, rig, drive, paths):
    """The quantities that a method takes: halves of what it refuses, down to single ones."""
    duration = None if how.times is None else 1.0
    question = Question(rig, (drive,), tuple(paths), how.metrics, how.model, duration, rows=True)
    if how.method == "full" or obstacle(how.method, question) is None:
        return list(paths)
    if len(paths) == 1:
        return []
    half = len(paths) // 2
    return [p for part in (paths[:half], paths[half:]) for p in taken(how, rig, drive, part)]


def rows_of(how, rig, drive, rng, most):
    """Rows (b, d): nothing changed, then values of every quantity that the method takes.

    `most` of them, but three of an effect's own numbers.
    """
    paths, base = columns_of(rig, drive)
    quantities = drive_quantities(drive, rig.names)
    rows, changed, takes = [base], [""], set(taken(how, rig, drive, paths))
    for j, path in enumerate(paths):
        if path not in takes:
            continue
        values = three(rig, path, base[j], rng, quantities)
        for value in values[: 3 if path.startswith("effect.") else most]:
            rows.append(np.where(np.arange(len(base)) == j, value, base))
            changed.append(path)
    return paths, np.array(rows), changed


def designed(rig, drive, paths, rows):
    """What `design` says of rows (b, d), and `tolerances` where the same changes are deviations.

    Both (b, metrics) and by one program; the second is NaN where a row changes no part, one that
    is 0 or one that takes whole numbers.  The first row is the nominal design.
    """
    given = {kind: tuple(values) for kind, values in _values(drive).items()}
    case = LoadCase("", kind_of(drive), given[kind_of(drive)], given["force"])
    turns = {f"angle.{n}" for n, x in zip(rig.names, given[kind_of(drive)], strict=True) if x != 0}
    kept = [i for i, path in enumerate(paths) if path not in turns]  # without influence, refused
    paths, rows = [paths[i] for i in kept], rows[:, kept]
    base, own = rows[0], scalar_parameters(rig)
    parts = tuple(
        p for p, b in zip(paths, base, strict=True)
        if p in own and b != 0 and not parameter_info(rig, p).whole
    )  # fmt: skip
    study = dataclasses.replace(
        parse_study({"rig": "atlas", "drive": [{"speed": [1, 2, 3]}]}),
        rig=rig,
        drives=(case,),
        variables=tuple(Variable(p, b - 1, b + 1) for p, b in zip(paths, base, strict=True)),
        tolerances=tuple((part, 0.1) for part in parts),
    )
    cases = RigCases(study, METRICS)
    assert cases.parts == parts
    column = [paths.index(part) for part in parts]
    off = rows[:, column] / base[column] - 1
    asked = jnp.concatenate([rows, np.tile(base, (len(rows), 1))])
    draws = jnp.concatenate([np.zeros_like(off), off])

    def one(both):
        return cases.every(both[0], both[1][None])[0][0, 0]

    figures = np.asarray(jax.jit(lambda all: jax.lax.map(one, all))((asked, draws)))
    found, again = np.split(figures, 2)
    no_part = (rows != base).any(axis=1) & (off == 0).all(axis=1)
    return found, np.where(no_part[:, None], np.nan, again)


def compared(hows, rig, drive, reference, rng, most, designs=False, accuracy=None):
    """The quantities that move a figure, of each way; asserts that all rows are `reference`'s.

    The ways take the same quantities, `most` values of each, but three of an effect's numbers.
    `designs`: `design` and `tolerances` say the same of a row of each quantity.
    """
    paths, rows, changed = rows_of(hows[0], rig, drive, rng, most)
    built = [design(rig, drive, paths, row, rows[0]) for row in rows]
    stacked = jax.tree.map(lambda *xs: jnp.stack([jnp.asarray(x, float) for x in xs]), *built)
    several = jax.jit(lambda all: jax.lax.map(lambda both: reference(*both), all))
    expected = np.asarray(several(stacked))
    for how in hows:
        assert taken(how, rig, drive, paths) == taken(hows[0], rig, drive, paths)
        tolerance = accuracy or ACCURACY.get(how.method, 1e-7)
        figures, _, status = Rows(how, rig, drive, paths).all(rows, len(rows))
        ended = np.isfinite(figures).all(axis=1)
        assert ended.all(), [(changed[i], status[i], expected[i]) for i in np.flatnonzero(~ended)]
        error = np.abs(figures - expected) / np.abs(expected)
        worst = int(error.max(axis=1).argmax())
        both = figures[worst], expected[worst]
        assert error.max() < tolerance, (how.method, changed[worst], error[worst], both)
        moved = np.abs(expected / expected[0] - 1).max(axis=1) > 10 * ACCURACY.get(how.method, 1e-7)
        yield {path for path, by in zip(changed, moved, strict=True) if by}
    if designs:
        first = [i for i, path in enumerate(changed) if path != changed[i - 1]]
        figures, again = designed(rig, drive, paths, rows[first])
        np.testing.assert_allclose(figures, expected[first], rtol=1e-7)
        same = np.isfinite(again[:, 0])
        assert sum(changed[i].startswith("wheel.") for i in np.array(first)[same]) > 30
        np.testing.assert_allclose(again[same], expected[first][same], rtol=1e-7)


def run_figures(ts, names):
    """The figures of `simulate` at the samples `ts`."""

    def reference(rig, drive):
        figures = evaluate(simulate(rig, drive, ts), rig, names)
        return jnp.stack([figures[name] for name in names])

    return reference


def drawn_drive(rig, rng, kind="speed"):
    n = rig.size
    if kind == "torque":
        return torques(rng.uniform(0.5, 2, n), rng.uniform(-30, 30, 3), rng.uniform(0.0, 0.2, n))
    return speeds(rng.uniform(2, 9, n), rng.uniform(-30, 30, 3), rng.uniform(0.0, 0.2, n))


def steady_figures(rig, drive):
    """The figures of `steady_state`; lines of its spectrum, of which one is made, are none."""
    state = steady_state(
        rig, drive.speed.values[0], angles=drive.initial_angle, force=drive.force.values[0],
        harmonics=1,
    )  # fmt: skip
    return jnp.stack([getattr(state, name) for name in METRICS])


USERS = load_laws(Path(__file__).parent / "laws_of_a_user.py")
CLOSED = ("radius", "command", "actuator", "shaft", "sensor", "kinematics")  # ports
SILENT = ("command", "actuator", "shaft", "sensor")  # of them, where speeds are given


def users_law(rng, name, rig):
    """A user's law with numbers of its size, and a place of the rig."""
    u, unit = rng.uniform, rng.normal(size=3)
    values, place = {
        "swollen-tyre": ((u(-5e-4, 5e-4), u(0.06, 0.09)), None),
        "slow-clock": ((u(0.05, 0.3), u(0, 5e-3)), None),
        "warm-motor": ((u(0.01, 0.1), u(0.02, 0.1)), None),
        "loaded-seal": ((u(1e-3, 1e-2), u(1e-4, 1e-3)), None),
        "bent-scale": ((u(0.1, 0.4),), str(rng.choice(["dR", "theta_1", "Omega", "a_z"]))),
        "speed-slip": ((u(0.1, 0.2), u(1, 3)), None),
        "stiff-core": ((u(1e7, 1e8), u(0.01, 0.05)), None),
        "quadratic-mount": ((u(1e4, 1e5),), None),
        "soft-grip": ((u(1, 10),), None),
        "slick-patch": ((u(1e-3, 1e-2),), None if rng.random() < 0.5 else "sphere"),
        "side-wind": ((u(0.05, 0.5), unit), "sphere"),
        "chirp": ((u(0.1, 1), u(50, 200)), "platform"),
        "flat-spot": ((u(2e-5, 1e-4), u(0, 6)), None),
        "pear": ((u(2e-5, 1e-4),), "sphere"),
    }[name]
    anywhere = "all" if rng.random() < 0.4 else str(rng.choice(rig.names))
    return USERS[name](*(jnp.asarray(x) for x in values)), place or anywhere


def drawn_layout(rng):
    """A rig of like wheels, orthogonal or as a tripod, or of 3 to 6 unlike ones."""
    kind = rng.choice(["orthogonal", "tripod", "unlike", "unlike"])
    return (
        drawn_machine(rng, int(rng.integers(3, 7))) if kind == "unlike" else machine(LAYOUTS[kind])
    )


MIXED = (laws.Rollers(), laws.HalfSine(), laws.ContinuousSine())
BULK, STEADY, FIXED = ("bulk",), ("steady", "steady-bulk"), ("fixed",)
CASES = [  # methods, layout, profiles (none: all gated), effects, values of a quantity
    (BULK, "four", None, linear_effects, 3),
    (STEADY[1:], "tripod", None, linear_effects, 1),
    (FIXED, "orthogonal", None, effects_under_torques, 1),
]
GRID = [
    (methods, layout, None, effects, 1)
    for methods, effect in ((BULK, linear_effects), (STEADY, linear_effects),
                            (FIXED, effects_under_torques))
    for layout in ("orthogonal", "tripod", "four")
    for effects in (plain, effect)
]  # fmt: skip
MORE = [
    (BULK, "orthogonal", MIXED, effects_of_a_turn, 1),
    (BULK, "tripod", None, linear_effects, 3),
    (BULK, "five", None, linear_effects, 3),
    (STEADY, "tripod", None, linear_effects, 3),
    (FIXED, "tripod", None, plain, 3),
    *(case for case in GRID if case not in CASES),
]
ACCURACY = {"steady-bulk": 1e-6, "fixed": 1e-6}  # else 1e-7
SUBSTEPS = {plain: 8, effects_under_torques: 16}  # by which fixed steps are as near


def named(case, marks=()):
    """The case under a name such as `bulk-tripod-plain-3`."""
    methods, layout, _, effects, values = case
    return pytest.param(*case, id=f"{methods[0]}-{layout}-{effects.__name__}-{values}", marks=marks)


@pytest.mark.parametrize(
    ("methods", "layout", "profiles", "effects", "values"),
    [*map(named, CASES), *(named(case, pytest.mark.full) for case in MORE)],
)
def test_figures_in_every_quantity(methods, layout, profiles, effects, values):
    """The methods and `simulate` are closed forms of one model: to rounding of the forms.

    Steady states are compared with `steady_state`, in bulk to the accuracy of its suprema; fixed
    steps under motor torques to theirs.
    """
    rng = np.random.default_rng(len(layout))
    rig = machine(LAYOUTS[layout])
    rig = effects(rig if profiles is None else eqx.tree_at(lambda r: r.profiles, rig, profiles))
    steady, kind = STEADY[1] in methods, "torque" if methods == FIXED else "speed"
    designs = methods == STEADY and effects is not plain
    turns = effects is effects_of_a_turn
    ts = None if steady else samples_of(*((0.3, 50.0) if turns else (0.08, 500.0)))
    names = (*METRICS, *OTHERS) if turns else METRICS
    substeps = SUBSTEPS[effects] if methods == FIXED else 1
    hows = [way(method, rig, names, ts, substeps) for method in methods]
    drive = drawn_drive(rig, rng, kind)
    reference = steady_figures if steady else run_figures(ts, names)
    for moved in compared(hows, rig, drive, reference, rng, values, designs):
        wanted = {
            f"{kind}.w2", f"{kind}.scale", "wheel.w1.roundness", "wheel.w2.contact.stiffness",
            "wheel.w3.mount.damping",
        }  # fmt: skip
        wanted |= set() if steady else {"angle.w1", "sphere.mass"}
        wanted |= {"force.x", "force.scale"}
        assert wanted <= moved
        assert {
            p.law.id for p in rig.effects if not any(p.law.id in path for path in moved)
        } == set()


MET = {("bulk",): 1e-7, ("steady", "steady-bulk"): 1e-6, ("fixed",): 1e-5}  # with users' laws


@pytest.mark.full
@pytest.mark.parametrize("methods", list(MET))
def test_figures_in_every_quantity_with_laws_of_a_user(methods):
    """A law file's laws, at every port that the method takes, on a rig drawn anew.

    Suprema of steady states are found to 1e-6; under motor torques fixed steps and the solver that
    controls its error meet at 1e-5.
    """
    rng = drawn_anew(f"a user's laws, {methods[0]}")
    steady, torque = "steady" in methods, methods == ("fixed",)
    rig = drawn_layout(rng)
    rig = linear_effects(rig) if rng.random() < 0.5 else rig
    chosen = [name for name, law in USERS.items() if torque or law.port in CLOSED]
    for name in rng.permutation(chosen):
        rig = rig.add(*users_law(rng, name, rig))
    ts = None if steady else samples_of(0.08, 500.0)
    hows = [way(method, rig, METRICS, ts, 64 if torque else 1) for method in methods]
    drive = drawn_drive(rig, rng, "torque" if torque else "speed")
    reference = steady_figures if steady else run_figures(ts, METRICS)
    # the times of a constant command; the sphere's turning hardly moves dR, if its mass is aside
    silent = ("sensor", "command") if torque else (*SILENT, "kinematics")
    felt = {name for name in chosen if USERS[name].port not in silent}
    for moved in compared(hows, rig, drive, reference, rng, 1, accuracy=MET[methods]):
        assert felt <= {path.split(".")[1] for path in moved}


def test_designs_that_fail_at_long_steps_ask_for_shorter_ones():
    """Those that fail at the finest step do not count: others were taken for such, and a sweep said
    `non-finite` of machines that `simulate` follows."""
    stable_from = np.array([1, 16, 1000])

    def figures(stable_from, substeps):
        return np.where(substeps < stable_from, np.nan, 1 + 1e-6 / substeps)[:, None]

    assert fine_enough(figures, stable_from, 8e-3)[0] == 16
    assert fine_enough(figures, stable_from[::2], 8e-3)[0] == 1
    assert fine_enough(figures, stable_from[2:], 8e-3) is None
    answer = figures(stable_from, 8)
    some = sample_to_check(answer)
    assert set(some) == {0, 1, 2}
    assert not checked_after(answer, figures(stable_from, 16))[1]
    assert checked_after(answer[::2], figures(stable_from[::2], 16))[1]


@pytest.mark.parametrize("method", sorted({*METHODS} - {"steady", "propagation", "fixed", "full"}))
def test_a_method_that_evaluates_no_single_design_is_refused(method):
    """It had been run as a full simulation, whatever it was called."""
    rig = machine()
    how = Evaluation(method, METRICS, times=samples_of(0.01, 500.0))
    with pytest.raises(ValueError, match=f"`{method}` evaluates no single design"):
        how.run(rig, speeds([1.0, 2.0, 3.0]))


SWEPT = {  # method: what a sweep asks for that takes it; three take a rig with a table
    "bulk": {"duration": 0.08},
    "propagation": {"duration": 0.08, "rate": 250_000.0},  # more samples than are kept in bulk
    "steady-bulk": {},
    "steady": {},
    "fixed": {"duration": 0.08},
    "full": {"duration": 0.08, "solver": "dopri8"},
}


@pytest.mark.full  # in the gate a sweep under a force: test_sweep; its methods, above
@pytest.mark.parametrize("method", SWEPT)
def test_a_sweep_gives_the_figures_of_single_runs(method):
    """Through the public functions alone, three designs with every way to evaluate them."""
    torque, how = method in ("fixed", "full"), SWEPT[method]
    rig = machine(LAYOUTS["four"])
    if method in ("bulk", "propagation", "steady-bulk"):
        angle = float(rig.gaps.pitch[0]) * np.linspace(0, 1, 9, endpoint=False)
        bumps = 1e-4 * np.cos(rig.wheels.rollers[0] * angle)
        measured = laws.TableShape.fit(angle, bumps, float(rig.gaps.pitch[0]))
        rig = eqx.tree_at(lambda r: r.profiles, rig, (measured, *rig.profiles[1:]))
    for roller in (3.0, 5.0) if method == "steady" else ():  # two are more than the core takes
        rig = rig.add(laws.DamagedRoller(jnp.asarray(roller), jnp.asarray(0.6)), "w2")
    rig = (effects_under_torques if torque else linear_effects)(rig)
    rng, path = np.random.default_rng(4), "wheel.w2.contact.stiffness"
    drive = drawn_drive(rig, rng, "torque" if torque else "speed")
    values = [float(get_parameter(rig, path)) * x for x in (0.7, 1.0, 1.4)]
    swept = sweep(rig, {path: values}, METRICS, drive=drive, **how)
    assert swept.spec.method == method
    for k, value in enumerate(values):
        changed = set_parameter(rig, path, value)
        if "duration" in how:
            run = simulate(changed, drive, duration=how["duration"], rate=how.get("rate"))
            expected = evaluate(run, changed, METRICS).values()
        else:
            expected = steady_figures(changed, drive)
        figures = [swept[name][k] for name in METRICS]
        promised = TOLERANCE if method == "fixed" else 1e-6
        np.testing.assert_allclose(figures, [*expected], rtol=promised)


@pytest.mark.full
def test_ramps_of_unlike_wheels_give_the_figures_of_the_closed_form():
    """A sweep steps them in time, where the speeds are traced; `simulate` has a closed form."""
    rng = drawn_anew("ramps")
    rig = linear_effects(drawn_machine(rng, 5))
    turning = ramp(0.02, 0.06, rng.uniform(-6, 9, 5), rng.uniform(-6, 9, 5))
    force = ramp(0.0, 0.08, rng.uniform(-30, 30, 3), rng.uniform(-30, 30, 3))
    drive = speeds(turning, force, rng.uniform(0.0, 0.3, 5))
    values = {"speed.scale": 1.3, "force.y": 12.0, "angle.w4": 0.15, "wheel.w5.roundness": 0.35}
    changed = apply(rig, drive, tuple(values), list(values.values()))
    run = simulate(*changed, duration=0.08)
    assert run.method == "exact"
    expected = evaluate(run, changed[0], METRICS)
    asked = {path: [value] for path, value in values.items()}
    swept = sweep(rig, asked, METRICS, drive=drive, duration=0.08)
    for name in METRICS:
        assert np.ravel(swept[name])[0] == pytest.approx(float(expected[name]), rel=1e-6)
