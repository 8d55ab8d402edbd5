"""A new user's afternoon: from `init` to own results, on a ballbot and on four wheels.

Each test is what one person types, and asserts what that person would check.  `python
tests/help_texts.py` writes the golden help texts anew.
"""

import csv
import gzip
import json
import math
import re
from typing import get_args

import help_texts
import jax.numpy as jnp
import numpy as np
import pytest
from seeds import drawn_anew
from tiers import tiered

import omnijax
from omnijax.cli import run
from omnijax.cli.init import Studies

MACHINES = {
    "ballbot": (["--wheels", "3", "--zenith", "45", "--radius", "120mm"], 3, 0.12),
    "four-wheel": (["--example", "four-wheel"], 4, 0.6),
}


@pytest.fixture(scope="module", params=MACHINES)
def machine(request, tmp_path_factory):
    """(folder with rig.toml, number of wheels, the sphere's radius)."""
    options, wheels, radius = MACHINES[request.param]
    folder = tmp_path_factory.mktemp(request.param)
    assert run(["init", str(folder / "rig.toml"), *options]) == 0
    return folder, wheels, radius


def say(capsys, monkeypatch, folder, line, code=0):
    """What a command prints on both streams; typed in `folder`, ended as expected."""
    monkeypatch.chdir(folder)
    found = run(line.split(" "))
    out, err = capsys.readouterr()
    assert found == code, err
    return out, err


@pytest.fixture
def type_(capsys, monkeypatch, machine):
    return lambda line, code=0: say(capsys, monkeypatch, machine[0], line, code)


def speeds_of(machine, omega):
    """Wheel speeds that turn the sphere at `omega`, worked out from the angles of the file."""
    rig = omnijax.load_rig(machine[0] / "rig.toml")
    touch = -np.asarray(rig.wheels.normal)
    rim = np.cross(omega, touch) * machine[2]  # surface velocity at the contact
    along = np.sum(rim * np.asarray(rig.wheels.drive), axis=1)
    return along / np.asarray(rig.wheels.radius)


def test_check_tells_the_machine_and_fits_a_terminal(type_, machine):
    out, _ = type_("check rig.toml")
    assert f"rig.toml: right. {machine[1]} wheels." in out
    assert f"radius {machine[2]:g} m" in out and "All 3 rotation axes are driven" in out
    assert ("Wheel speeds must fit each other" in out) == (machine[1] > 3)
    assert max(map(len, out.splitlines())) <= 80
    found = json.loads(type_("check rig.toml --json")[0])
    omega = np.array([0.3, -0.5, 0.9])
    drives = np.array(found["kinematics"]["wheels_from_sphere"]) @ omega
    assert np.allclose(np.abs(drives), np.abs(speeds_of(machine, omega)))
    assert np.allclose(np.array(found["kinematics"]["sphere_from_wheels"]) @ drives, omega)
    normal = np.array([w["normal"] for w in found["wheels"]])
    force = np.array(found["weight"]["normal"]) @ normal  # the contacts' part of the weight
    assert np.allclose(force, [0, 0, -found["weight"]["force"]], atol=1e-6) or np.allclose(
        force, [0, 0, found["weight"]["force"]], atol=1e-6
    )


@pytest.mark.parametrize("machine", tiered(MACHINES, "four-wheel".__eq__), indirect=True)
def test_a_run_with_a_first_speed_below_zero(type_, machine):
    omega = np.array([0.2, 0.5, -1.0]) * 0.12 / machine[2]
    rig = json.loads(type_("check rig.toml --json")[0])
    drives = np.array(rig["kinematics"]["wheels_from_sphere"]) @ omega
    drives = drives if drives[0] < 0 else -drives
    typed = ",".join(f"{x:.12g}" for x in drives)
    out, err = type_(f"simulate rig.toml --speed {typed} --duration 1s --out run.nc --plot run.png")
    assert out.startswith("ok: 501 samples to 1 s") and "slide" not in err
    saved = omnijax.load_run(machine[0] / "run.nc")
    assert np.allclose(np.asarray(saved.theta[-1] - saved.theta[0]), drives)  # after 1 s
    turned = np.mean(np.asarray(saved.Omega), axis=0)
    assert np.linalg.norm(turned) == pytest.approx(np.linalg.norm(omega), rel=0.05)
    rms = float(np.sqrt(np.mean(np.sum(np.asarray(saved.dR) ** 2, axis=1))))
    shown = re.search(r"\|ΔR\| RMS +([0-9.]+) (µm|mm)", out)
    assert shown is not None
    assert float(shown[1]) * {"µm": 1e-6, "mm": 1e-3}[shown[2]] == pytest.approx(rms, rel=1e-3)
    assert (machine[0] / "run.png").stat().st_size > 10_000
    assert "exists already" in type_(f"simulate rig.toml --speed {typed} --out run.nc", 2)[1]


@pytest.mark.parametrize("machine", tiered(MACHINES, "four-wheel".__eq__), indirect=True)
def test_the_spheres_own_motion(type_, machine):
    out = type_("simulate rig.toml --omega 0,0,0.5 --duration 1s --json")[0]
    found = json.loads(out)
    assert found["status"] == "ok" and 0 < found["rms"] < 1e-2 and found["warnings"] == []


@pytest.mark.full  # in the gate: test_speed_misfits
def test_speeds_that_do_not_fit_are_told(type_, machine):
    if machine[1] == 3:
        pytest.skip("three wheels at these angles take any speeds")
    out, err = type_("simulate rig.toml --speed 2,1,2,-2 --duration 1s")
    told = " ".join(err.split())
    assert "The speeds do not fit each other" in told
    slide = abs(2 - 1 + 2 + 2) / 4 * 0.06 * 1e3  # mm/s: a quarter of the alternating sum
    assert f"w1 {slide:.3g} mm/s" in told
    assert out.startswith("ok")


@pytest.mark.parametrize("machine", tiered(MACHINES, "four-wheel".__eq__), indirect=True)
def test_orders_and_replay_of_the_run(type_, machine):
    typed = ",".join(["7"] * machine[1])  # a turn and a bit
    type_(f"simulate rig.toml --speed {typed} --duration 1s --out run.nc --overwrite")
    found = json.loads(type_("orders run.nc --channel distance --reference w1 --json")[0])
    assert found["orders"] and found["reference"]
    type_("replay run.nc")
    page = (machine[0] / "run.html").read_text(encoding="utf-8")
    assert "<html" in page and "http://" not in page.replace("http://www.w3.org", "")


def test_a_sweep_and_its_figures(type_, machine):
    """By a study file; the same asked by options takes up its finished store."""
    if machine[1] == 4:
        pytest.skip("one program is compiled for the ballbot, and would be for four wheels")
    type_("init grid.toml --study sweep --rig rig.toml")
    text = (machine[0] / "grid.toml").read_text(encoding="utf-8")
    first, _, last = re.sub("speed = .*", "omega = [0.2, 0, 0.5]", text, count=1).split(
        "[[variable]]"
    )
    last = re.sub("low = .*", "low = 0", re.sub("high = .*", "high = 0.4", last))
    last = last.replace("levels = 5", "levels = 3")
    (machine[0] / "grid.toml").write_text(f"{first}[[variable]]{last}", encoding="utf-8")
    out, _ = type_("sweep grid.toml --out s.zarr")
    assert "status: 3 ok" in out and "best rms: 0 m at wheel.roundness = 0 (design 0)" in out
    assert max(map(len, out.splitlines())) <= 80
    assert "finished: 3 of 3 designs" in type_("sweep-status s.zarr")[0]
    line = "sweep rig.toml --vary wheel.roundness=0:0.4:3 --metric rms --out s.zarr --resume"
    assert "best rms: 0 m" in type_(f"{line} --omega 0.2,0,0.5")[0]
    assert "holds another sweep" in type_(f"{line} --omega 0.2,0,0.4", 2)[1]
    assert type_("export s.zarr s.csv")[0] == "s.csv: 3 designs\n"
    with open(machine[0] / "s.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    column = next(key for key in rows[0] if key.startswith("rms"))
    figures = [float(row[column]) for row in rows]
    assert figures[0] == 0 < figures[1] < figures[2]
    told = type_("sweep grid.toml --omega 0,0,1", 2)[1]
    assert told == "grid.toml: --omega stands in the study file: give it there.\n"
    told = type_("sweep rig.toml --omega 0,0,0..1 --vary wheel.roundness=0.3,0.45", 2)[1]
    assert "`omega` is a ramp over a whole run: give its length by --duration." in told


@pytest.mark.parametrize("kind", get_args(Studies))
def test_study_files_fit_the_rig(type_, machine, kind):
    type_(f"init {kind}.toml --study {kind} --rig rig.toml")
    found = json.loads(type_(f"check {kind}.toml --json")[0])
    assert found["ok"] and len(found["wheels"]) == machine[1]
    text = (machine[0] / f"{kind}.toml").read_text(encoding="utf-8")
    (machine[0] / "wrong.toml").write_text(text.replace("[[drive]]", "[[drives]]"))
    err = type_("check wrong.toml", 2)[1]
    assert "`drives` is not a key of a study file. Did you mean `drive`?" in err
    wrong = text.replace("speed =", "speeds =")
    (machine[0] / "wrong.toml").write_text(wrong)
    assert (
        "speeds` is not a key of a study file. Did you mean `speed`?"
        in type_("check wrong.toml", 2)[1]
    )


@pytest.mark.full
def test_a_design_brings_what_it_says(type_, machine):
    if machine[1] == 4:
        pytest.skip("one program is compiled for the ballbot, and would be for four wheels")
    type_("init damping.toml --study design --rig rig.toml")
    text = (machine[0] / "damping.toml").read_text(encoding="utf-8")
    first, _, second = text.split("[[variable]]")
    text = f"{first}[[variable]]{second}\n[search]\nstarts = 1\n"
    (machine[0] / "damping.toml").write_text(text, encoding="utf-8")
    out, _ = type_("design damping.toml --rig best.toml")
    assert max(map(len, out.splitlines())) <= 80
    told = " ".join(out.split())
    found = re.search(r"Build it with contact damping (\S+) (k?)N s/m \(now (\S+) N s/m\)", told)
    assert found is not None and float(found[1]) != float(found[3])
    gain = re.search(r"That is (\S+) % less rms than your rig: from (\S+) to (\S+) ([µm]m)", told)
    assert gain is not None and float(gain[3]) < float(gain[2])
    assert float(gain[1]) == pytest.approx(100 * (1 - float(gain[3]) / float(gain[2])), abs=0.1)
    speed = re.search(r"speed = \[(.*?)\]", text)
    assert speed is not None
    of = {
        name: omnijax.steady_state(omnijax.load_rig(machine[0] / name), as_numbers(speed[1])).rms
        for name in ("rig.toml", "best.toml")
    }
    unit = {"µm": 1e-6, "mm": 1e-3}[gain[4]]
    assert float(of["rig.toml"]) == pytest.approx(unit * float(gain[2]), rel=1e-3)
    assert float(of["best.toml"]) == pytest.approx(unit * float(gain[3]), rel=1e-3)


def as_numbers(text):
    return jnp.array([float(x) for x in text.split(",")])


NOISE = {"dR": 2e-6, "theta": 1e-4, "Omega": 1e-3, "a": 2e-2}
RUNOUT = """
[[effect]]
id = "wheel-runout"
place = "w2"
parameters = { amplitude = "60 um", phase = "40 deg" }
"""


def recorded(type_, folder, wheels, rig, rng, size):
    """A case of three runs of `rig` under torques of slow sines, read by noisy sensors."""
    case = folder / f"case-{rig}"
    case.mkdir()
    (case / "rig.toml").write_bytes((folder / "rig.toml").read_bytes())
    time = np.arange(0, 2, 2e-3)
    for k in (1, 2, 3):
        rate, phase = rng.uniform(0.4, 2, (wheels, 3, 1)), rng.uniform(0, 6, (wheels, 3, 1))
        torque = size * np.sum(np.sin(2 * np.pi * rate * time + phase), axis=1)
        head = ",".join(["t", *(f"torque_{i + 1}" for i in range(wheels))])
        drive = folder / "drive.csv"
        np.savetxt(drive, np.column_stack([time, torque.T]), "%.9g", ",", header=head, comments="")
        out = f"case-{rig}/run-{k}.csv.gz"
        type_(f"simulate {rig}.toml --drive drive.csv --out {out}")
        with gzip.open(folder / out, "rt", encoding="utf-8") as file:
            names = file.readline().strip().split(",")
            data = np.loadtxt(file, delimiter=",")
        sigma = [NOISE.get(name.partition("_")[0], 0.0) for name in names]
        data += sigma * rng.standard_normal(data.shape)
        with gzip.open(folder / out, "wt", encoding="utf-8") as file:
            np.savetxt(file, data, "%.9g", ",", header=",".join(names), comments="")
        lines = ['rig = "rig.toml"', f'role = "{"held-out" if k == 3 else "train"}"', "[noise]"]
        lines += [f"{name} = {value}" for name, value in NOISE.items()]
        (case / f"run-{k}.toml").write_text("\n".join(lines), encoding="utf-8")
    return case.name


@pytest.mark.full  # of test_diagnosis the same answers, of test_diagnosis_answers the command
def test_a_diagnosis_names_what_was_planted(type_, machine):
    """A ballbot's runout with its size; of a platform that lacks nothing, nothing."""
    folder, wheels, _ = machine
    rng = drawn_anew("a_new_users_diagnosis")
    text = (folder / "rig.toml").read_text(encoding="utf-8")
    (folder / "true.toml").write_text(text + RUNOUT * (wheels == 3), encoding="utf-8")
    case = recorded(type_, folder, wheels, "true", rng, {3: 0.05, 4: 1.0}[wheels])
    out, _ = type_(f"diagnose {case} --out found")
    assert max(map(len, out.splitlines())) <= 80
    page = (folder / "found" / "index.html").read_text(encoding="utf-8")
    if wheels == 4:
        assert "verdict: none" in out and "none" in page
        return
    assert "verdict: named" in out and "wheel-runout at w2" in out
    found = json.loads((folder / "found" / "diagnosis.json").read_text(encoding="utf-8"))
    (effect,) = found["effects"]
    size, phase = (effect["parameters"][key] for key in ("amplitude", "phase"))
    assert size["value"] == pytest.approx(6e-5, abs=5 * size["sigma"]) and size["sigma"] < 2e-6
    assert math.degrees(phase["value"]) == pytest.approx(40, abs=math.degrees(5 * phase["sigma"]))
    assert all(gap["after"] < 1.1 * gap["noise_floor"] for gap in found["gap"].values())
    assert "effects: wheel-runout at w2" in type_("check found/rig-diagnosed.toml")[0]
    assert "How large is it" in page


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("check rigg.toml", "rigg.toml: the rig file cannot be read"),
        ("simulate rig.toml --speed 1", "`speed` has 1 value, but the rig has"),
        ("simulate rig.toml --speed 1,2,3,4,5 --drive no.csv", "no.csv: there is no such file"),
        ("simulat rig.toml", 'Did you mean "simulate"'),
        ("design rig.toml", "is a rig file, not a study file"),
        ("simulate rig.toml --speed a,b,c --duration 1x", "`duration`"),
        ("sweep-status none.zarr", "there is no such folder"),
        ("diagnose none", "none: there is no such folder."),
        ("diagnose rig.toml", "rig.toml: is a file, and not a folder: a case is one"),
        ("replay none.nc", "there is no such file"),
    ],
)
def test_a_slip_of_the_hand_is_told_in_one_sentence(type_, line, sentence):
    out, err = type_(line, 2)
    assert sentence in err and "Traceback" not in err and out == ""


@pytest.mark.full  # in the gate: test_cli_simulate
def test_python_gives_what_the_commands_print(type_, machine):
    typed = ",".join(["0.5"] * machine[1])
    line = f"simulate rig.toml --speed {typed} --duration 1s --json"
    found = json.loads(type_(line)[0])
    rig = omnijax.load_rig(machine[0] / "rig.toml")
    own = omnijax.simulate(rig, typed, "1 s")
    figures = omnijax.evaluate(own, rig, "rms, peak, sphere_acceleration_rms")
    for name, value in figures.items():
        assert float(value) == pytest.approx(found[name], rel=1e-9)
    assert omnijax.get_parameter(rig, "sphere.radius") == machine[2]
    assert math.isfinite(float(own.dR[-1, 0]))


def test_effects_fit_a_terminal_and_are_found_by_their_words(capsys):
    assert run(["effects"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    for law in omnijax.EFFECTS:
        assert any(line.startswith(f"{law}  ") for line in lines)


def test_help_is_what_it_was(monkeypatch):
    monkeypatch.setenv("COLUMNS", help_texts.COLUMNS)
    golden = help_texts.FILE.read_text(encoding="utf-8")
    assert help_texts.help_texts() == golden, "python tests/help_texts.py writes it anew"
    assert max(map(len, golden.splitlines())) <= int(help_texts.COLUMNS)
