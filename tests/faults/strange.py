"""More wrong inputs: rigs, recordings, studies, cases, machines of one axis, drives and units."""

import gzip
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from omnijax.rig import bundled_rigs

TEXT_OF = {  # a table appended to the rig file
    "unknown table": "\n[wheels]\nradius = 1\n",
    "unknown key in a table": "\n[sphere.more]\na = 1\n",
    "effect without id": "\n[[effect]]\nplace = 'w1'\n",
    "effect of no library": "\n[[effect]]\nid = 'magic'\nplace = 'w1'\nparameters = {}\n",
    "effect at no wheel": "\n[[effect]]\nid = 'mount-cubic'\nplace = 'w9'\nparameters = {}\n",
    "effect with text": "\n[[effect]]\nid='mount-cubic'\nplace='w1'\nparameters={k3='a lot'}\n",
    "effect as text": "\neffect = 'mount-cubic'\n",
    "effect with nan": "\n[[effect]]\nid='mount-cubic'\nplace='w1'\nparameters={k3=nan}\n",
    "effect parameters as list": "\n[[effect]]\nid='mount-cubic'\nplace='w1'\nparameters=[1]\n",
    "law that is no file": "\n[[effect]]\nid='x'\nlaw='no.py'\nplace='w1'\nparameters={}\n",
    "law that is a folder": "\n[[effect]]\nid='x'\nlaw='.'\nplace='w1'\nparameters={}\n",
    "law that is a number": "\n[[effect]]\nid='x'\nlaw=3\nplace='w1'\nparameters={}\n",
    "uncertainty of nothing": "\n[uncertainty]\n'no.path' = 0.1\n",
    "uncertainty below zero": "\n[uncertainty]\n'contact.stiffness' = -0.1\n",
    "a wheel more": "\n[[wheel]]\nname = 'w4'\n",
    "a wheel as table": "\n[wheel]\nname = 'w4'\n",
}
STUDY = 'rig = "rig.toml"\n[objective]\nmetric = "rms"\n[[drive]]\nspeed = [1.0, 1.2, 0.3]\n'
VARIABLE = '[[variable]]\npath = "contact.stiffness"\nlow = 5e4\nhigh = 5e5\n'
STUDIES = {
    "drive named by a list": STUDY.replace("[[drive]]", "[[drive]]\nname = [1]") + VARIABLE,
    "load named by a number": STUDY + VARIABLE + "[[load]]\nname = 3\nset = {}\n",
    "empty name": STUDY.replace("[[drive]]", '[[drive]]\nname = ""') + VARIABLE,
    "no variable": STUDY,
    "no drive": STUDY.partition("[[drive]]")[0] + VARIABLE,
    "rig as number": STUDY.replace('"rig.toml"', "3") + VARIABLE,
    "rig that is the study": STUDY.replace("rig.toml", "case.toml") + VARIABLE,
    "speed of text": STUDY.replace("1.0, 1.2", "'fast', 1.2") + VARIABLE,
    "speed that is nan": STUDY.replace("1.0, 1.2", "nan, 1.2") + VARIABLE,
    "speed beyond numbers": STUDY.replace("1.0, 1.2", "1e999, 1.2") + VARIABLE,
    "two speeds": STUDY.replace("1.0, 1.2", "1.2") + VARIABLE,
    "bounds turned round": STUDY + VARIABLE.replace("5e4", "5e6"),
    "bounds that are one": STUDY + VARIABLE.replace("5e4", "5e5"),
    "bound below zero": STUDY + VARIABLE.replace("5e4", "-5e4"),
    "bound that is inf": STUDY + VARIABLE.replace("high = 5e5", "high = inf"),
    "bound in metres": STUDY + VARIABLE.replace("5e4", '"5 m"'),
    "bound of a list": STUDY + VARIABLE.replace("5e4", "[1, 2]"),
    "variable twice": STUDY + VARIABLE + VARIABLE,
    "variable of nothing": STUDY + VARIABLE.replace("contact.stiffness", "no.path"),
    "variable by a number": STUDY + VARIABLE.replace('"contact.stiffness"', "7"),
    "start outside": STUDY + VARIABLE + "start = 1.0\n",
    "unknown scale": STUDY + VARIABLE + "scale = 'cubic'\n",
    "log from zero": STUDY + VARIABLE.replace("5e4", "0") + "scale = 'log'\n",
    "unknown metric": STUDY.replace('"rms"', '"beauty"') + VARIABLE,
    "metric as list": STUDY.replace('"rms"', "[1]") + VARIABLE,
    "weights of text": STUDY.replace('metric = "rms"', 'weights = { rms = "a" }') + VARIABLE,
    "objective twice": STUDY + VARIABLE + "[[objective]]\nmetric = 'rms'\n",
    "constraint of nothing": STUDY + VARIABLE + "[[constraint]]\nquantity = 'no'\nmax = 1\n",
    "constraint without limit": STUDY + VARIABLE + "[[constraint]]\nquantity = 'peak'\n",
    "constraint nan": STUDY + VARIABLE + "[[constraint]]\nquantity='peak'\nmax = nan\n",
    "search of text": STUDY + VARIABLE + "[search]\nstarts = 'many'\n",
    "search of half": STUDY + VARIABLE + "[search]\nstarts = 1.5\n",
    "search of none": STUDY + VARIABLE + "[search]\nstarts = 0\n",
    "duration below zero": "duration = -1\n" + STUDY + VARIABLE,
    "model of others": "model = 'theirs'\n" + STUDY + VARIABLE,
}
AXIS = """kind = "axis"
[motor]
input = "torque"
[axis]
inertia = 0.01
"""
COLUMNS = "t,torque_1,torque_2,torque_3,dR_x,dR_y,dR_z,theta_1,theta_2,theta_3"


def recording(rows: int = 300, step: float = 2e-3, change=lambda i, row: row) -> str:
    """A run of three wheels as text."""
    lines = [COLUMNS]
    for i in range(rows):
        wave = math.sin(0.07 * i)
        row = [step * i, *(0.1 * wave,) * 3, *(1e-4 * wave,) * 3, *(1e-3 * i,) * 3]
        lines.append(",".join(f"{x:.9g}" if isinstance(x, float) else str(x)
                              for x in change(i, row)))  # fmt: skip
    return "\n".join(lines) + "\n"


GOOD = recording()
TABLES = {
    "time runs back": recording(change=lambda i, row: [-row[0], *row[1:]]),
    "time in dates": recording(change=lambda i, row: [f"2024-01-01T00:00:{i:02d}", *row[1:]]),
    "time all nan": recording(change=lambda i, row: ["nan", *row[1:]]),
    "time of one value": recording(change=lambda i, row: [1.0, *row[1:]]),
    "torques all missing": recording(change=lambda i, row: [row[0], "", "", "", *row[4:]]),
    "inf everywhere": recording(change=lambda i, row: [row[0], *["inf"] * 9]),
    "numbers of 400 digits": recording(change=lambda i, row: [row[0], "9" * 400, *row[2:]]),
    "no torque": GOOD.replace("torque_", "moment_"),
    "torque of four wheels": GOOD.replace("dR_x", "torque_4"),
    "torque from zero": GOOD.replace("torque_1,torque_2,torque_3", "torque_0,torque_1,torque_2"),
    "unit of another kind": GOOD.replace("torque_1,", "torque_1 (kg),"),
    "unit that hangs": GOOD.replace("torque_1,", "torque_1 (m**9**9**9),"),
    "utf-16": GOOD.encode("utf-16").decode("latin-1"),
    "no line ends": GOOD.replace("\n", " "),
    "quotes open": GOOD.replace("t,", '"t,', 1),
    "html": "<html><body><table><tr><td>t</td></tr></table></body></html>\n" * 20,
    "json": '{"t": [0, 1, 2], "torque_1": [0, 0, 0]}\n',
    "zero bytes between": GOOD.replace("\n", "\0\n"),
    "samples a century apart": recording(3, 3e9),
    "one sample": recording(1),
}
SIDECARS = {
    "role of no kind": 'role = "witness"\n',
    "role as number": "role = 3\n",
    "noise as text": "[noise]\ndR = 'little'\n",
    "noise below zero": "[noise]\ndR = -1.0\n",
    "noise of nothing": "[noise]\nbeauty = 1.0\n",
    "rig as list": "rig = [1]\n",
    "nested": "a = " + "[" * 20_000,
    "unknown key": "colour = 'red'\n",
    "not TOML": "this is no TOML\n",
}
AXES = {
    "empty": "",
    "kind of no kind": AXIS.replace('"axis"', '"lathe"'),
    "motion of no kind": AXIS.replace('kind = "axis"', 'kind = "axis"\nmotion = "dance"'),
    "inertia below zero": AXIS.replace("0.01", "-0.01"),
    "inertia zero": AXIS.replace("0.01", "0.0"),
    "inertia nan": AXIS.replace("0.01", "nan"),
    "inertia in metres": AXIS.replace("0.01", '"1 m"'),
    "inertia as list": AXIS.replace("0.01", "[0.01]"),
    "inertia of 400 digits": AXIS.replace("0.01", "1" + "0" * 400),
    "motor by magic": AXIS.replace('"torque"', '"magic"'),
    "voltage without resistance": AXIS.replace('"torque"', '"voltage"'),
    "goal without servo": AXIS.replace('"torque"', '"goal"'),
    "effect of no library": AXIS + "[[effect]]\nid='magic'\nplace='axis'\nparameters={}\n",
    "effect without numbers": AXIS + "[[effect]]\nid='mount-cubic'\nplace='x'\nparameters={}\n",
    "effect of text": AXIS + "[[effect]]\nid='bearing-coulomb'\nplace='axis'\n"
    "parameters={torque='a',width='b'}\n",
    "uncertainty of nothing": AXIS + "[uncertainty]\n'no.key' = 1.0\n",
    "nested": "a = " + "[" * 20_000,
    "binary": "\x89PNG\r\n\x1a\n" * 30,
}
SPEEDS = "t,speed_1,speed_2,speed_3\n"
DRIVES = {
    "drive of one row": SPEEDS + "0,1,1,1\n",
    "drive of no row": SPEEDS,
    "drive with inf": SPEEDS + "0,1,1,1\n1,inf,1,1\n",
    "drive with text": SPEEDS + "0,1,1,1\n1,fast,1,1\n",
    "drive back in time": SPEEDS + "1,1,1,1\n0,1,1,1\n",
    "drive of four wheels": "t,speed_1,speed_2,speed_3,speed_4\n0,1,1,1,1\n1,1,1,1,1\n",
    "drive in kilograms": SPEEDS.replace("speed_1", "speed_1 (kg)") + "0,1,1,1\n1,1,1,1\n",
    "drive beyond numbers": SPEEDS + "0,1e400,1,1\n1,1,1,1\n",
    "drive of a century": SPEEDS + "0,1,1,1\n4e9,1,1,1\n",
    "drive with nan time": SPEEDS + "0,1,1,1\nnan,1,1,1\n",
}
UNITS = (
    "1 parsec/fortnight/kg", "m", "1 m m m", "1**1", "0x10 rad/s", "1e", "--1", "1;2",
    "1 rad/s; import os", "{}", "%s", "1\x00", "1 " + "rad*" * 40 + "s", "e", "1 dBm", "1 degC",
)  # fmt: skip
ARGUMENTS = """
simulate rig.toml --omega 1,2|simulate rig.toml --omega 1,2,x|simulate rig.toml --speed 0..,1,1
simulate rig.toml --speed ..,1,1|simulate rig.toml --speed 1..2..3,1,1|simulate rig.toml --speed ,,
simulate rig.toml --speed 1,1,1 --duration 1e-9|simulate rig.toml --speed 1,1,1 --rate 0
simulate rig.toml --speed 1,1,1 --rate 1e12|simulate rig.toml --speed inf,1,1
simulate rig.toml --speed 1,1,1 --force nan,0,0|simulate rig.toml --speed 1,1,1 --out .
simulate rig.toml --speed 1,1,1 --out run.csv|simulate rig.toml --speed 1,1,1 --compare missing.csv
simulate rig.toml --speed 1,1,1 --compare run.csv|simulate rig.toml --speed 1,1,1 --model theirs
simulate rig.toml --torque 1,1,1 --rtol nan
simulate rig.toml --speed 1,1,1 --out new.nc --plot new.nc|simulate rig.toml rig.toml
simulate rig.toml --speed 1,1,1 --max-steps 1e99|simulate rig.toml --torque 1,1,1 --solver exact
sweep rig.toml --vary contact.stiffness=1:2 --speed 1,1,1
sweep rig.toml --vary contact.stiffness=1:2:-3 --speed 1,1,1
sweep rig.toml --vary contact.stiffness=log:0:2:3 --speed 1,1,1
sweep rig.toml --vary contact.stiffness=nan:2:3 --speed 1,1,1
sweep rig.toml --vary contact.stiffness=1e5:2e5:3 --vary contact.stiffness=1,2 --speed 1,1,1
sweep rig.toml --vary speed.w9=1:2:3 --speed 1,1,1|sweep rig.toml --vary force.q=1:2:3 --speed 1,1,1
sweep rig.toml --vary wheel.rollers=7.5,8.5 --speed 1,1,1
sweep rig.toml --vary contact.stiffness=1e5:2e5:3 --speed 1,1,1 --resume
sweep rig.toml --vary contact.stiffness=1e5:2e5:3 --speed 1,1,1 --workers -1 --out s.zarr
sweep rig.toml --vary contact.stiffness=1e5:2e5:3 --speed 1,1,1 --workers 2
sweep rig.toml --vary contact.stiffness=1e5:2e5:3 --speed 1,1,1 --duration 1e-12
export rig.toml x.csv|export recordings x.csv|sweep-status recordings|replay run.csv
sensitivity rig.toml --speed 1,1,1 --top -1|sensitivity rig.toml --speed 1,1,1 --report rig.toml
orders run.csv --max-order -1|orders run.csv --max-order nan|orders run.csv --turns 0
orders run.csv --rig run.csv|orders run.csv --out run.csv|orders run.csv --window triangle
diagnose recordings --window -1|diagnose recordings --law missing.py|diagnose recordings --rig no
diagnose recordings --law rig.toml|diagnose recordings --model missing.py|diagnose empty
diagnose recordings --out rig.toml|diagnose recordings --out recordings|case new missing.csv
case new rig.toml --yes|case new run.csv --rate -1 --yes|case old run.csv|case new run.csv --yes
init --example nothing|init a.toml --wheels 0|explore run.csv|explore rig.toml --port -1
explore rig.toml --host 256.256.256.256|reproduce --samples -1|effects nothing|schema more
check rig.toml rig.toml|check atlas --json --nothing|help nothing
"""


def place(path: str, text: str | bytes) -> None:
    """Write a file that an attack needs."""
    file = Path(path)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8", "surrogateescape"))


Attack = tuple[str, Sequence[str], Mapping[str, str | bytes]]  # name, words, files that are there


def strange() -> Iterator[Attack]:
    """All of them."""
    rig = bundled_rigs()["atlas"].read_text(encoding="utf-8")
    for name, more in TEXT_OF.items():
        yield f"rig: {name}", ["check", "case.toml"], {"case.toml": rig + more}
    for k, unit in enumerate(UNITS):
        said = re.sub(r"(?m)^mass = .*$", lambda _, u=unit: f"mass = {_quoted(u)}", rig, count=1)
        yield f"unit {k}", ["check", "case.toml"], {"case.toml": said}
        if "\0" not in unit:
            yield f"unit {k} of a speed", [*SIMULATE, "--speed", f"{unit},1,1"], {}
    for name, text in STUDIES.items():
        yield f"design: {name}", ["design", "case.toml"], {"case.toml": text}
    yield from _recordings(rig)
    for name, text in AXES.items():
        files: dict[str, str | bytes] = {"bad/machine.toml": text, "bad/run.csv": GOOD}
        yield f"axis: {name}", ["diagnose", "bad"], files
        words = ["simulate", "bad/machine.toml", "--drive", "run.csv"]
        yield f"simulate axis: {name}", words, files
    for name, text in DRIVES.items():
        yield name, [*SIMULATE, "--drive", "case.csv"], {"case.csv": text}
    for line in ARGUMENTS.replace("\n", "|").split("|"):
        if line.strip():
            yield line.strip(), line.split(), {}


def _recordings(rig: str) -> Iterator[Attack]:
    for name, text in TABLES.items():
        if name not in USABLE:
            files = {"bad/rig.toml": rig, "bad/run.csv": text.encode("latin-1", "replace")}
            yield f"diagnose: {name}", ["diagnose", "bad"], files
            yield f"simulate: {name}", [*SIMULATE, "--drive", "bad/run.csv"], files
    for name, text in SIDECARS.items():
        files = {"bad/rig.toml": rig, "bad/run.csv": GOOD, "bad/run.toml": text}
        yield f"orders: {name}", ["orders", "bad/run.csv"], files
    packed = gzip.compress(GOOD.encode())
    for name, content in {
        "packed and cut": packed[:30], "packed and flipped": packed[:60] + b"\xff" + packed[61:],
        "not packed": GOOD.encode(), "packed twice": gzip.compress(packed), "empty": b"",
    }.items():  # fmt: skip
        yield name, [*SIMULATE, "--drive", "bad.csv.gz"], {"bad.csv.gz": content}


SIMULATE = ("simulate", "rig.toml")
USABLE = {"quotes open", "zero bytes between", "samples a century apart"}  # and said so


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace("\0", "\\u0000") + '"'
