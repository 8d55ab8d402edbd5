"""The axis: its motion against exact solutions, its files, its logs, and what it lacks."""

import dataclasses
import json
import sys
import tomllib

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm
from seeds import drawn_anew
from tiers import tiered

from omnijax import cli
from omnijax.diagnosis import diagnose
from omnijax.diagnosis._ode.build import build_model, priors_of
from omnijax.laws import EFFECTS, GENERIC, LoadFriction, MotorRipple, ShaftSignal, load_laws
from omnijax.machine import (
    Axis,
    LogFile,
    MachineFile,
    PlacedLaw,
    axis_unit,
    free_run,
    guess,
    load_machine,
    load_model,
    machine_text,
    parse_machine,
    read_log,
    read_machine_case,
    with_numbers,
)
from omnijax.machine._file import field_names
from omnijax.rig import InputError

STEP = 2e-3


def drawn(seed: int) -> dict:
    """A machine file of a random axis without a spring."""
    rng = np.random.default_rng(seed)
    return {
        "kind": "axis",
        "axis": {"inertia": float(10 ** rng.uniform(-3, 0)), "damping": 0.0},
        "motor": {"input": "torque"},
        "uncertainty": {"axis.inertia": 0.3, "axis.damping": 0.01, "axis.offset": 0.01},
    }


def torque(rng, count: int) -> np.ndarray:
    """A sum of slow sines, so that speeds of both signs are there."""
    t = np.arange(count) * STEP
    return sum(np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in rng.uniform(0.2, 1.5, 4))


def recorded(folder, data: dict, placed, seed: int, count: int = 4000, noise: float = 1e-5):
    """A case of one log: a free run with white noise on the position."""
    rng, file = np.random.default_rng(seed), parse_machine(data)
    u = 4 * float(file.machine.inertia) * torque(rng, count)
    got = free_run(file.machine, placed, {"position": (0.0, 0.0)}, {"input": u}, STEP)["position"]
    table = np.stack([np.arange(count) * STEP, u, got + noise * rng.normal(size=count)], 1)
    np.savetxt(folder / "log.csv", table, delimiter=",", header="t,input,position", comments="")
    (folder / "machine.toml").write_text(machine_text(file))
    return read_machine_case(folder)


@pytest.mark.parametrize("seed", range(3))
def test_a_linear_axis_moves_as_the_matrix_exponential_says(seed):
    rng = np.random.default_rng(seed)
    J, d, k = rng.uniform(0.1, 2, 3) * [1e-2, 1e-2, 1.0]
    n = 200
    axis = Axis(J, damping=d, stiffness=k)
    got = free_run(axis, (), {"position": (0.3, -0.2)}, {"input": np.ones(n)}, STEP)["position"]
    A = np.array([[0, 1, 0], [-k / J, -d / J, 1 / J], [0, 0, 0]])
    exact = [(expm(A * STEP * i) @ [0.3, -0.2, 1.0])[0] for i in range(n)]
    np.testing.assert_allclose(got, exact, atol=2e-6)


def test_a_second_inertia_keeps_the_momentum():
    axis = Axis(2e-3, second_inertia=5e-3, second_stiffness=30.0, second_damping=0.01)
    u = {"input": np.full(400, 0.05)}
    got = free_run(axis, (), {"position": (0.0, 0.0)}, u, STEP)
    t = np.arange(400) * STEP
    mean = 0.5 * 0.05 / 7e-3 * t**2  # of the centre of inertia
    # the first inertia swings about the centre by at most twice its static lead
    assert np.max(np.abs(got["position"] - mean)) < 2 * 0.05 * (5 / 7) ** 2 / 30.0 * 1.1
    assert np.max(np.abs(got["position"] - mean)) > 0.2 * 0.05 * (5 / 7) ** 2 / 30.0


def test_files_say_everything_that_is_wrong():
    data = drawn(0) | {"motion": "rotation"}
    data["axis"] = {"inertia": -1, "dampin": 2}
    data["motor"] = {"input": "voltge"}
    with pytest.raises(InputError) as caught:
        parse_machine(data, "m.toml")
    said = str(caught.value)
    for text in ("`axis.inertia` must lie in (0, inf)", "Did you mean `damping`?", "voltage"):
        assert text in said
    with pytest.raises(InputError, match=r"`motor.resistance` is missing"):
        parse_machine(drawn(0) | {"motor": {"input": "voltage"}})
    wound = {"motor": {"input": "voltage", "resistance": 1}}
    with pytest.raises(InputError, match=r"`motor.torque_constant` is missing.* in N m/A"):
        parse_machine(drawn(0) | wound)
    with pytest.raises(InputError, match="`servo` is missing"):
        parse_machine(drawn(0) | {"motor": {"input": "goal", "resistance": 1}})
    weight = {"motion": "translation", "axis": {"inertia": 1, "gravity": 9.81}}
    with pytest.raises(InputError, match=r"`axis.gravity` is a pendulum's.*`axis.offset`, in N"):
        parse_machine(drawn(0) | weight)


def test_a_torque_constant_that_is_not_given_is_said():
    given = parse_machine(drawn(0) | {"motor": {"input": "current", "torque_constant": 0.1}})
    silent = parse_machine(drawn(0) | {"motor": {"input": "current"}})
    assert given.assumed == () and float(given.machine.torque_constant) == 0.1
    assert "taken for 1 N m/A" in silent.assumed[0]
    assert float(silent.machine.torque_constant) == 1.0
    (said,) = parse_machine(drawn(0) | {"motor": {"input": "command"}}).assumed
    assert "taken for 1 N m a unit of the command" in said
    assert parse_machine(drawn(0)).assumed == ()


def test_check_says_that_a_torque_constant_is_taken_for_one(tmp_path, capsys):
    path = tmp_path / "machine.toml"
    path.write_text('kind = "axis"\n[axis]\ninertia = 1\n[motor]\ninput = "current"\n')
    assert cli.run(["check", str(path)]) == 0
    assert "taken for 1 N m/A" in capsys.readouterr().out


def test_orders_of_an_axis_that_slides_are_in_rad_a_metre():
    order = MotorRipple.parameters["order"].unit
    assert axis_unit(order, "translation", "order") == "rad/m"
    assert axis_unit(order, "rotation", "order") == "1"
    assert axis_unit(LoadFriction.parameters["mu"].unit, "translation", "mu") == "1"


@pytest.mark.parametrize("seed", range(3))
def test_what_is_written_is_read_back(tmp_path, seed):
    data = drawn(seed)
    data["axis"]["stiffness"] = 0.7
    data["effect"] = [{"id": "motor-ripple", "place": "axis",
                       "parameters": {"amplitude": 0.1, "order": 7.5, "phase": 0.2}},
                      *({"id": k, "place": "axis", "parameters": dict.fromkeys(v.parameters, 0.3)}
                        for k, v in GENERIC.items())]  # fmt: skip
    path = tmp_path / "machine.toml"
    path.write_text(machine_text(parse_machine(data)))
    again = load_machine(path)
    assert machine_text(again) == path.read_text()
    assert float(again.machine.inertia) == data["axis"]["inertia"]
    assert [x.law.id for x in again.placed] == ["motor-ripple", *GENERIC]


def test_logs_with_strange_names_and_units_come_in_si(tmp_path):
    t = np.arange(100) * 5.0  # ms
    table = np.stack([t, np.sin(t / 100), 180 / np.pi * np.cos(t / 100)], 1)
    log = tmp_path / "x.csv"
    np.savetxt(log, table, delimiter=",", header="ms,tau_cmd,angle_deg", comments="")
    file = LogFile(tmp_path / "x.toml", log, channels={"t": "ms", "input": "tau_cmd",
                   "position": "angle_deg"}, units={"t": "ms", "position": "deg"})  # fmt: skip
    axis = Axis(1.0)
    run = read_log(file, axis.inputs, axis.outputs)
    assert run.step == pytest.approx(5e-3)
    np.testing.assert_allclose(run.outputs["position"], np.cos(t / 100), rtol=1e-9)
    found = guess(log)
    assert (found.time, found.input, found.position) == ("ms", "tau_cmd", "angle_deg")
    with pytest.raises(InputError, match="no column `input`"):
        read_log(LogFile(file.path, log, channels={"t": "ms"}), axis.inputs, axis.outputs)


@pytest.mark.parametrize(("note", "said"), [
    ("machine = 3", "`machine` must be the path of a file, but is 3."),
    ("log = [1]", "`log` must be the path of a file, but is [1]."),
    ("noise = 1", "`noise` must be a table, but is 1."),
    ("noise.position = -1", "`noise.position` must lie in [0, inf), but is -1."),
    ("noise.position = 'ten'", "`noise.position` must be a number in rad or text with such a unit"),
    ("units.position = 3", "`units.position` must be a unit, but is 3."),
    ("channels.position = []", "`channels.position` must be the name of a column, or a number"),
])  # fmt: skip
def test_a_wrong_note_beside_a_log_is_one_sentence(tmp_path, note, said, capsys):
    """Most of these ended in a traceback; a negative noise was taken."""
    recorded(tmp_path, drawn(1), (), 1, count=200)
    (tmp_path / "log.toml").write_text(note)
    assert cli.run(["diagnose", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    assert said in " ".join(capsys.readouterr().err.split())


def test_noise_beside_a_log_may_have_a_unit(tmp_path):
    recorded(tmp_path, drawn(1), (), 1, count=200)
    unit = read_machine_case(tmp_path).file.machine.outputs["position"]
    (tmp_path / "log.toml").write_text(f"noise.position = '2 m{unit}'")
    assert read_machine_case(tmp_path).logs[0].noise == {"position": pytest.approx(2e-3)}


def law(id: str, **values):
    """An effect at the axis."""
    return PlacedLaw(EFFECTS[id](**{k: jnp.asarray(v, float) for k, v in values.items()}), "axis")


@pytest.mark.full
@pytest.mark.parametrize("seed", [1, 2])
def test_dry_friction_and_a_line_are_named(tmp_path, seed):
    rng, data = np.random.default_rng(seed), drawn(seed)
    J = data["axis"]["inertia"]
    order = float(rng.uniform(6, 20))
    placed = (law("bearing-coulomb", torque=0.5 * J),
              law("motor-ripple", amplitude=0.3 * J, order=order, phase=1.0))  # fmt: skip
    found = diagnose(recorded(tmp_path, data, placed, seed))
    assert {e.id for e in found.effects} == {"bearing-coulomb", "motor-ripple"}, found
    values = {e.id: e.parameters for e in found.effects}
    assert values["bearing-coulomb"]["torque"]["value"] == pytest.approx(0.5 * J, rel=0.05)
    assert values["motor-ripple"]["order"]["value"] == pytest.approx(order, rel=5e-3)
    assert {r["role"] for r in found.free_runs} == {"train", "held-out"}


@pytest.mark.parametrize("sure", tiered([False, True], bool))
def test_nothing_is_named_where_nothing_is_missing(tmp_path, sure):
    data = drawn(5)
    if sure:  # a file that calls no number uncertain
        data.pop("uncertainty")
    found = diagnose(recorded(tmp_path, data, (), 5))
    assert (found.verdict, found.effects) == ("none", []), found


@pytest.mark.full
def test_an_axis_at_one_speed_is_ambiguous_with_every_friction(tmp_path):
    """It was `none`: its inertia, at the end of its range, was taken to explain all that was left;
    a friction that was there stood behind by the colour of a noise as if the axis were at rest."""
    rng, data = drawn_anew("one speed"), drawn(5)
    data["uncertainty"] = {"axis.inertia": 0.1}
    file, count, speed = parse_machine(data), 3000, float(rng.uniform(1, 4))
    torque = float(rng.uniform(0.3, 1)) * float(file.machine.inertia)
    laws = {"bearing-coulomb": {"torque": torque}, "bearing-viscous": {"b": torque / speed},
            "torque-offset": {"torque": -torque}}  # fmt: skip
    id = str(rng.choice(list(laws)))
    u, start = np.full(count, torque), {"position": (0.0, speed)}
    q = free_run(file.machine, (law(id, **laws[id]),), start, {"input": u}, STEP)["position"]
    table = np.stack([np.arange(count) * STEP, u, q + 1e-5 * rng.normal(size=count)], 1)
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="t,input,position", comments="")
    (tmp_path / "machine.toml").write_text(machine_text(file))
    found = diagnose(read_machine_case(tmp_path))
    assert found.verdict == "ambiguous" and found.next_experiment["separation"] > 25
    names = {e.id for e in found.effects}
    assert set(laws) <= names, (id, names)
    for effect in found.effects:
        assert {o["id"] for o in effect.indistinguishable_from} == names - {effect.id}
        sigmas = [x["sigma"] for k, x in effect.parameters.items() if k in laws.get(effect.id, {})]
        assert all(s > 0 for s in sigmas)  # of its own refit: rivals once had none
    assert len({e.evidence["delta_bic"] for e in found.effects}) > 1
    said = " ".join(found.notes)
    assert "it changes too little to tell how it acts" in said
    _, _, unseen = said.partition("change no measured channel in these runs: ")
    assert "actuator-delay" in unseen and "stribeck" not in unseen


MODEL = """
import jax.numpy as jnp
from omnijax.laws import MountSignal, ShaftSignal
from omnijax.machine import AbstractMachine

class TwoMass(AbstractMachine):
    J1: float = 0.02
    J2: float = 0.05
    k: float = 60.0
    c: float = 0.05
    inputs = {"input": "N m"}
    outputs = {"position": "rad"}
    places = {"shaft": ("motor",), "mount": ("coupling",)}
    uncertainty = {"J1": 0.2, "J2": 0.2, "k": 0.2, "c": 0.5}

    def rate(self, x, u, ports):
        q1, v1, q2, v2 = x
        twist = MountSignal(q1 - q2, v1 - v2, self.k, self.c)
        drive = self.k * (q1 - q2) + self.c * (v1 - v2) + ports("mount", "coupling", twist)
        motor = u["input"] + ports("shaft", "motor", ShaftSignal(q1, v1, u["input"]))
        return v1, (motor - drive) / self.J1, v2, drive / self.J2

    def read(self, x, u):
        return {"position": x[0]}

    def start(self, first):
        q, v = first["position"]
        return q, v, q, v
"""


def test_a_machine_of_ones_own_is_read_and_moves(tmp_path):
    path = tmp_path / "two.py"
    path.write_text(MODEL)
    file = load_model(path)
    assert isinstance(file, MachineFile)
    axis = Axis(0.02, second_inertia=0.05, second_stiffness=60.0, second_damping=0.05)
    u = {"input": 0.2 * np.sin(np.arange(300) * 0.05)}
    one, other = (
        free_run(m, (), {"position": (0.1, 0.0)}, u, STEP)["position"] for m in (file.machine, axis)
    )
    np.testing.assert_allclose(one, other, atol=1e-12)
    path.write_text("x = 1")
    with pytest.raises(InputError, match="defines 0 machines"):
        load_model(path)


def test_a_diagnosed_machine_of_ones_own_is_written_whole(tmp_path):
    """Its numbers were written as jax prints them, and the named effect was left out."""
    path = tmp_path / "two.py"
    more = "    table: tuple = (1.0, 2.0)\n    on: bool = True\n    word: str = 'a \"b\"'\n"
    path.write_text(MODEL.replace("    k: float", f"{more}    k: float"))
    file = load_model(path)
    machine = dataclasses.replace(file.machine, J1=jnp.asarray(0.0221), k=np.float64(61.5))
    cogging = EFFECTS["cogging"](jnp.array([0.02, 0.01]), jnp.array([7.0, 14.0]), jnp.zeros(2))
    friction = EFFECTS["bearing-coulomb"](jnp.asarray(0.15), jnp.asarray(0.05))
    placed = (PlacedLaw(friction, "motor"), PlacedLaw(cogging, "motor"))
    made = tomllib.loads(machine_text(dataclasses.replace(file, machine=machine, placed=placed)))
    assert made["numbers"] == {"J1": 0.0221, "J2": 0.05, "table": [1.0, 2.0], "on": True,
                               "word": 'a "b"', "k": 61.5, "c": 0.05}  # fmt: skip
    assert made["model"] == "two.py" and made["uncertainty"] == dict(file.uncertainty)
    first, second = made["effect"]
    assert first == {"id": "bearing-coulomb", "place": "motor",
                     "parameters": {"torque": 0.15, "width": 0.05}}  # fmt: skip
    assert second["parameters"]["amplitudes"] == [0.02, 0.01]


@pytest.mark.parametrize("motion", ["rotation", "translation"])
def test_a_sigma_of_what_was_zero_means_the_same_in_the_diagnosed_file(motion):
    """Written beside the new value it was read as a share of it, which pinned the number."""
    rng = np.random.default_rng(7)
    fields = ["offset", "damping", "stiffness", "coulomb", *(["gravity"] * (motion == "rotation"))]
    sigmas = dict(zip(fields, rng.uniform(0.01, 0.1, len(fields)), strict=True))
    file = parse_machine({"kind": "axis", "motion": motion, "motor": {}, "axis": {"inertia": 0.2}})
    file = dataclasses.replace(file, uncertainty={"inertia": 0.3} | sigmas)
    values = dict(zip(fields, 10 ** rng.uniform(-6, -3, len(fields)), strict=True))
    numbers = {"inertia": 0.3} | values
    machine = dataclasses.replace(file.machine, **{k: jnp.asarray(v) for k, v in numbers.items()})
    made = with_numbers(dataclasses.replace(file, names=field_names()), machine)
    again = parse_machine(tomllib.loads(machine_text(made)))
    for prior in priors_of(again.machine, again.uncertainty):
        assert prior.relative is (prior.name == "inertia")
        assert prior.sigma == pytest.approx(sigmas.get(prior.name, 0.3))
        assert prior.value == pytest.approx(values.get(prior.name, 0.3))


@pytest.mark.parametrize("later", ["", "from __future__ import annotations\n"])
def test_a_users_file_may_put_its_annotations_off(tmp_path, later):
    """Its module is known by its own name while it runs, and nothing stays of it."""
    before = set(sys.modules)
    path, law = tmp_path / "two.py", tmp_path / "json.py"
    path.write_text(later + MODEL.replace("    J1: float", "    word: str = 'a'\n    J1: float"))
    law.write_text(later + LAW)
    made, again = load_model(path).machine, load_model(path).machine
    assert type(made).__module__ != type(again).__module__
    assert float(made.J1) == 0.02 and "inputs" not in {f.name for f in dataclasses.fields(made)}
    (drag,) = load_laws(law).values()
    assert drag(jnp.asarray(2.0))(ShaftSignal(0.0, 3.0, 0.0)) == -6.0
    assert [f.name for f in dataclasses.fields(drag)] == ["b"]
    assert not [name for name in set(sys.modules) - before if "two" in name or "json" in name]


LAW = """
import dataclasses
from typing import ClassVar

from omnijax.laws import AbstractShaft, Parameter


@dataclasses.dataclass
class Beside:
    x: ClassVar[int] = 1
    y: int = 2


class Drag(AbstractShaft):
    b: float
    id: ClassVar[str] = "my-drag"
    places: ClassVar[tuple[str, ...]] = ("wheel",)
    formula: ClassVar[str] = "shaft torque -b w"
    parameters: ClassVar[dict[str, Parameter]] = {"b": Parameter("N m s/rad", linear=True)}

    def __call__(self, signal, state=None):
        return -self.b * signal.speed
"""


@pytest.mark.parametrize("stated", ["auto", "free-run", "balance"])
@pytest.mark.parametrize("second", [False, True])
def test_check_says_how_a_diagnosis_compares(tmp_path, capsys, stated, second):
    path = tmp_path / "machine.toml"
    more = "[second]\ninertia = 0.1\nstiffness = 50.0\n" if second else ""
    path.write_text(f'kind = "axis"\n[axis]\ninertia = 0.2\n[motor]\n{more}'
                    f'[compare]\ncriterion = "{stated}"\n')  # fmt: skip
    expected = {"auto": "free-run" if second else "balance"}.get(stated, stated)
    assert cli.run(["check", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["criterion"] == expected
    assert cli.run(["check", str(path)]) == 0
    words = {"free-run": "by free runs", "balance": "by the balance of accelerations"}
    assert words[expected] in capsys.readouterr().out
    t = np.arange(200) * STEP
    table = np.stack([t, np.sin(9 * t), 0.1 * np.sin(9 * t)], 1)
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header="t,input,position", comments="")
    case = read_machine_case(tmp_path)
    if second and stated == "balance":
        with pytest.raises(InputError, match="balance needs one inertia"):
            build_model(case)
        return
    (how,) = build_model(case)[2]
    assert ("balance" in how) is (expected == "balance")
