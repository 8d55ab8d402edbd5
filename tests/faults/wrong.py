"""Wrong inputs made from right ones: every key of every kind of file, every effect, every option.

The right ones are what `omnijax init` writes and what the library of effects declares.
"""

import contextlib
import io
import math
import random
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

from omnijax.cli import run
from omnijax.laws import EFFECTS, Parameter

from .strange import GOOD, SPEEDS, Attack

NUMBERS = (  # no number of any unit is one of these
    "true", '"abc"', "nan", "inf", "-inf", "[]", "{}", '"3 parsec/kg"', '""', "2020-01-01",
    "[1, [2]]", "'nan'", '"1 kg m s A K mol"', "1e999", "[[]]", "'1 2'", "{ a = 1 }", "'1e'",
)  # fmt: skip
WORDS = ("3", "true", '"banana"', "[]", "{}", '""', "[1]", "nan", '"../../etc/passwd"')
NAMED = ("3", "true", "[]", "{}", '""', "[1]", "nan")  # of a key that takes any word
PICKED = 4  # wrong values a key
KEY = re.compile(r'(?m)^(?:# )?("[\w.]+"|\w+) = ([^#\n]+?)[ \t]*(#.*)?$')
INLINE = re.compile(r"(\w+) = ([^,{}]+?)(?=[,}]| })")
STUDIES = ("sweep", "sensitivity", "design", "pareto", "tolerances", "global-sensitivity")


def wrong(seed: int = 0) -> Iterator[Attack]:
    """All of them; the values are drawn."""
    rng = random.Random(seed)
    rig = written("--example", "four-wheel")
    for name, text in changed(rig, rng):
        yield f"rig {name}", ["check", "case.toml"], {"case.toml": text}
    for kind in STUDIES:
        for name, text in changed(written("--study", kind, "--rig", "atlas"), rng):
            yield f"{kind} {name}", [kind, "case.toml"], {"case.toml": text}
    for name, text in changed(written("--axis"), rng):
        files = {"bad/machine.toml": text, "bad/run.csv": AXIS_RUN}
        yield f"axis {name}", ["diagnose", "bad"], files
    yield from effects(rng)
    for line in ARGUMENTS.strip().replace("\n", "|").split("|"):
        yield line, line.split(), OTHERS
    for name, text in DRIVES.items():
        words = ["simulate", "rig.toml", "--drive", "case.csv"]
        yield f"drive {name}", words, {"case.csv": text}
    for name, text in LAWS.items():
        effect = "\n[[effect]]\nid = 'mine'\nlaw = 'mine.py'\nplace = 'w1'\nparameters = {}\n"
        files = {"case.toml": rig + effect, "mine.py": text}
        if name != "import of nothing":  # `check` reads a law and does not run it
            yield f"law {name}", ["check", "case.toml"], files
        words = ["--trust-laws", "simulate", "case.toml", "--speed", "1,1,1,1"]
        yield f"law run {name}", words, files


def written(*words: str) -> str:
    """What `omnijax init` writes."""
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        path = Path(folder) / "file.toml"
        assert run(["init", str(path), *words]) == 0
        return path.read_text(encoding="utf-8")


def changed(text: str, rng: random.Random) -> Iterator[tuple[str, str]]:
    """(what was done, the text) with one value that is wrong, or one key too many."""
    for found in KEY.finditer(text):
        key, value = found[1], found[2]
        if value.startswith("{"):
            for part in INLINE.finditer(value):
                start = found.start(2)
                for bad in rng.sample(NUMBERS, PICKED):
                    where = start + part.start(2), start + part.end(2)
                    yield f"{key}.{part[1]} = {bad} (at {where[0]})", put(text, where, bad)
            yield (
                f"{key} twice in a table (at {found.start()})",
                put(text, found.span(2), "{ a = 1, a = 2 }"),
            )
        for bad in rng.sample(bads(key, value), PICKED):
            whole = f"{key} = {bad}"
            yield (
                f"{key} = {bad} (line {text[: found.start()].count(chr(10))})",
                put(text, found.span(), whole),
            )
    for head in re.finditer(r"(?m)^\[.*\]", text):
        yield (
            f"a key more in {head[0]} (at {head.start()})",
            put(text, (head.end(), head.end()), "\nbogus = 1"),
        )
    yield "a key more", "bogus = 1\n" + text


def bads(key: str, value: str) -> tuple[str, ...]:
    """Wrong values of a key that has `value`."""
    if key in ("rig", "name"):
        return NAMED
    if re.fullmatch(r'"[a-zA-Z_.\- ]*"', value):
        return WORDS
    return NUMBERS


def put(text: str, span: tuple[int, int], new: str) -> str:
    return text[: span[0]] + new + text[span[1] :]


def effects(rng: random.Random) -> Iterator[Attack]:
    """Each effect: a parameter that is missing, wrong or too many, and a place that is none."""
    rig = written("--example", "four-wheel")
    for name, law in EFFECTS.items():
        low = {p: q.low for p, q in law.parameters.items()}
        good = {p: _right(q) for p, q in law.parameters.items()}
        places = {"w1" if p in ("wheel", "motor") else p for p in law.places}
        place = sorted(places)[0]
        for parameter in good:
            bad = rng.choice(NUMBERS)
            yield _effect(rig, name, place, good | {parameter: bad}, f"{parameter} = {bad}")
            if math.isfinite(low[parameter]):
                less = repr(low[parameter] - 1.0)
                yield _effect(rig, name, place, good | {parameter: less}, f"{parameter} = {less}")
            if not law.parameters[parameter].optional:
                rest = {k: v for k, v in good.items() if k != parameter}
                yield _effect(rig, name, place, rest, f"without {parameter}")
        yield _effect(rig, name, place, good | {"bogus": "1.0"}, "one parameter more")
        yield _effect(rig, name, "nowhere", good, "at nowhere")


def _right(parameter: Parameter) -> str:
    low, high = max(parameter.low, -1.0), min(parameter.high, 2.0)
    value = 0.5 * (low + high)
    return repr([value] * abs(parameter.shape)) if parameter.shape else repr(value)


def _effect(rig: str, name: str, place: str, values: dict[str, str], what: str) -> Attack:
    inner = ", ".join(f"{k} = {v}" for k, v in values.items())
    text = f"{rig}\n[[effect]]\nid = '{name}'\nplace = '{place}'\nparameters = {{ {inner} }}\n"
    return f"effect {name}: {what}", ["check", "case.toml"], {"case.toml": text}


AXIS_RUN = "t,torque,position\n" + "".join(
    f"{0.002 * i:.3f},{0.1 * (i % 40 - 20)},{1e-3 * (i % 80)}\n" for i in range(400)
)
OTHERS = {"two.toml": 'rig = "rig.toml"\n', "good.csv": GOOD, "axis.csv": AXIS_RUN}
DRIVES = {
    "empty cells": SPEEDS + "0,1,1,1\n1,,1,1\n2,1,1,1\n",
    "semicolons and commas": SPEEDS.replace(",", ";") + "0,0;1,0;1;1\n1;1,0;x;1\n",
    "no names": "0,1,1,1\n1,1,1,1\n",
    "the same name twice": "t,speed_1,speed_1,speed_3\n0,1,1,1\n1,1,1,1\n",
    "speeds of no wheel": "t,speed_0,speed_1,speed_2\n0,1,1,1\n1,1,1,1\n",
    "speeds and torques": "t,speed_1,speed_2,speed_3,torque_1,torque_2,torque_3\n"
    "0,1,1,1,1,1,1\n1,1,1,1,1,1,1\n",
    "a row too short": SPEEDS + "0,1,1\n1,1,1,1\n",
    "time in kilograms": SPEEDS.replace("t,", "t (kg),") + "0,1,1,1\n1,1,1,1\n",
    "a unit of two kinds": SPEEDS.replace("speed_1", "speed_1 (m/s)") + "0,1,1,1\n1,1,1,1\n",
    "only commas": ",,,\n,,,\n,,,\n",
    "of an endless time": SPEEDS + "0,1,1,1\n1e308,1,1,1\n",
    "of infinite speeds": SPEEDS + "0,1,1,1\n1,1e308,1,1\n",
}
CLASS = "import omnijax\nfrom omnijax.laws import AbstractShaft, Parameter\n"
LAWS = {
    "empty": "",
    "no Python": "this is no python at all\n",
    "zero bytes": "\0\0\0",
    "deep": "(" * 300 + ")" * 300,
    "nothing of ours": "class Mine:\n    id = 'mine'\n",
    "base that is none": "class Mine(AbstractNothing):\n    id = 'mine'\n",
    "another id": CLASS + "class Mine(AbstractShaft):\n    id = 'yours'\n    parameters = {}\n",
    "import of nothing": CLASS + "import no_such_module_at_all\n" + "class Mine(AbstractShaft):\n"
    "    id = 'mine'\n    places = ('wheel',)\n    parameters = {}\n",
}
GRID = "--vary contact.stiffness=1e5:2e5:3 --speed 1,1,1"
ARGUMENTS = f"""
init x.toml --wheels -3|init x.toml --wheels 1e3|init x.toml --wheels 1000000|init x.toml --zenith 0
init x.toml --zenith 180|init x.toml --zenith nan|init x.toml --zenith 45m|init x.toml --skew inf
init x.toml --radius 0|init x.toml --radius -1m|init x.toml --radius 1kg|init x.toml --rollers 0
init x.toml --rollers -2|init x.toml --rollers 2.5|init x.toml --radius 1e300|init x.toml --skew a
init x.toml --study orders|init x.toml --study design --axis|init x.toml --axis --wheels 3
init x.toml --example ballbot --study design|init x.toml y.toml
init x.toml --radius 1e-300|init two.toml|init x.toml --rollers 100000000000
check study.toml rig.toml|check --json|check ~nobody/rig.toml|effects a b|effects --jason
schema --studies|simulate rig.toml --speed 1,1,1 --omega 1,1,1
simulate rig.toml --speed 1,1,1 --drive good.csv|simulate rig.toml --omega 1,1,1 --torque 1,1,1
simulate rig.toml --omega nan,0,0|simulate rig.toml --speed nan,1,1|simulate rig.toml --speed 1
simulate rig.toml --speed 1;1;1|simulate rig.toml --speed 1,1,1,|simulate rig.toml --speed 1kg,1,1
simulate rig.toml --speed 0..inf,1,1|simulate rig.toml --speed 1..2m,1,1
simulate rig.toml --torque 0..1,1,1 --duration inf|simulate rig.toml --torque 1m,1,1
simulate rig.toml --torque nan,1,1|simulate rig.toml --torque 1e300,1,1 --duration 0.1
simulate rig.toml --speed 1,1,1 --force 1kg,0,0|simulate rig.toml --speed 1,1,1 --force 1,2,3,4
simulate rig.toml --speed 1,1,1 --force ,,|simulate rig.toml --speed 1,1,1 --duration nan
simulate rig.toml --speed 1,1,1 --duration 1m|simulate rig.toml --speed 1,1,1 --duration 1,2
simulate rig.toml --speed 1,1,1 --rate -5|simulate rig.toml --speed 1,1,1 --rate 1s
simulate rig.toml --speed 1,1,1 --rate 1e-9|simulate rig.toml --speed 1,1,1 --duration 1e6
simulate rig.toml --speed 1,1,1 --rtol 0|simulate rig.toml --speed 1,1,1 --rtol abc
simulate rig.toml --speed 1,1,1 --max-steps 1.5|simulate rig.toml --speed 1,1,1 --max-steps -7
simulate rig.toml --torque 1,1,1 --max-steps 99999999999999999999
simulate rig.toml --speed 1,1,1 --out|simulate rig.toml --speed 1,1,1 --out empty
simulate rig.toml --speed 1,1,1 --out nowhere/../rig.toml
simulate rig.toml --speed 1,1,1 --plot rig.toml|simulate rig.toml --speed 1,1,1 --plot .
simulate rig.toml --speed 1,1,1 --out a.nc --plot a.nc/b.png|simulate rig.toml --speed 1,1,1 --jsn
simulate rig.toml --speed 1,1,1 --compare rig.toml|simulate rig.toml --speed 1,1,1 --compare .
simulate rig.toml --speed 1,1,1 --compare axis.csv|simulate rig.toml --drive good.csv --rate 5
simulate rig.toml --drive good.csv --duration 1|simulate rig.toml --drive axis.csv
simulate rig.toml --drive good.csv --compare pipe.csv|simulate study.toml --speed 1,1,1
simulate rig.toml --speed 1,1,1 --solver|simulate atlas rig.toml --speed 1,1,1
sweep rig.toml --vary contact.stiffness --speed 1,1,1|sweep rig.toml --vary =1:2:3 --speed 1,1,1
sweep rig.toml --vary contact.stiffness=1:2:3:4 --speed 1,1,1
sweep rig.toml --vary contact.stiffness=a:b:c --speed 1,1,1
sweep rig.toml --vary contact.stiffness=1e5:2e5:1.5 --speed 1,1,1
sweep rig.toml --vary contact.stiffness=1e5:2e5:nan --speed 1,1,1
sweep rig.toml --vary contact.stiffness=1e5,x --speed 1,1,1
sweep rig.toml --vary contact.stiffness=1e5m:2e5m:3 --speed 1,1,1
sweep rig.toml --vary contact.stiffness=lin:1:2:3 --speed 1,1,1
sweep rig.toml --vary wheel.name=a,b --speed 1,1,1|sweep rig.toml --vary sphere=1,2 --speed 1,1,1
sweep rig.toml --vary wheel.w9.radius=1,2 --speed 1,1,1
sweep rig.toml --vary gravity=1,2 --speed 1,1,1
sweep rig.toml --vary sphere.mass=-1:2:3 --speed 1,1,1
sweep rig.toml --vary speed.w1=nan,1 --speed 1,1,1|sweep rig.toml --vary torque.w1=1,2 --speed 1,1,1
sweep rig.toml --vary speed.w1=1,2 --torque 1,1,1|sweep rig.toml {GRID} --metric
sweep rig.toml {GRID} --metric rms,rms|sweep rig.toml {GRID} --metric ,
sweep rig.toml {GRID} --duration inf|sweep rig.toml {GRID} --rate 5|sweep rig.toml {GRID} --seed x
sweep rig.toml {GRID} --duration 1 --rate 1e15|sweep rig.toml {GRID} --samples 5
sweep rig.toml {GRID} --sampler lhs|sweep rig.toml {GRID} --sampler lhs --samples 0
sweep rig.toml {GRID} --sampler sobol --samples -4|sweep rig.toml {GRID} --sampler random
sweep rig.toml {GRID} --devices 0|sweep rig.toml {GRID} --devices 999
sweep rig.toml {GRID} --chunk -1|sweep rig.toml {GRID} --chunk 1.5
sweep rig.toml {GRID} --out study.toml|sweep rig.toml {GRID} --out .
sweep rig.toml {GRID} --report rig.toml|sweep rig.toml {GRID} --plot x
sweep rig.toml {GRID} --rtol -1|sweep rig.toml {GRID} --max-steps 0
sweep rig.toml {GRID} --solver magic|sweep rig.toml {GRID} --force a
sweep rig.toml {GRID} --out s.zarr --scheduler nowhere|sweep rig.toml {GRID} --torque 1,1,1
sweep rig.toml {GRID} --vary contact.stiffness=1e5:2e5:3|sweep study.toml {GRID}
sweep rig.toml --vary contact.stiffness=1e5:2e5:3 --torque 1,1,1|sweep rig.toml {GRID} --gradient 3
sweep-status|sweep-status study.toml|sweep-status empty|sweep-status missing --rerun 0
export empty x.csv|export rig.toml|export empty x.docx|export recordings recordings/x.csv|export
sensitivity rig.toml --speed 1,1,1 --metric rms,rms|sensitivity rig.toml --speed 1,1,1 --top 0
sensitivity rig.toml --speed 1,1,1 --metric ,|sensitivity rig.toml --speed 1,1,1 --top x
sensitivity rig.toml --torque 1,1,1|sensitivity rig.toml --speed 1,1,1 --duration -1
sensitivity rig.toml --speed 1,1,1 --rate 7|sensitivity study.toml --speed 1,1,1
sensitivity rig.toml --speed 1,1,1 --parameter sphere|sensitivity rig.toml --speed 1,1,1 --out x.csv
simulate rig.toml --speed 0..1e9,1,1 --duration 0.1
sensitivity rig.toml --speed 1,1,1 --out x.nc --report x.nc|global-sensitivity study.toml
global-sensitivity two.toml|global-sensitivity study.toml --metric x|design two.toml
design study.toml --out x.csv|design study.toml --resume|design study.toml --store .|pareto two.toml
pareto study.toml --metric rms|pareto study.toml --metric a,b,c,d|pareto study.toml --metric rms,rms
tolerances study.toml --draws 0|tolerances study.toml --draws -5|tolerances study.toml --draws x
tolerances two.toml|tolerances study.toml --draws 1e99|case new|case|case new axis.csv --rate nan
case new axis.csv --input nothing --yes|case new axis.csv --position nothing --yes
case new axis.csv --time nothing --yes|case new axis.csv --out rig.toml --yes
case new axis.csv axis.csv --yes --out .|case new pipe.csv
case new axis.csv --input t --position t --yes|case new broken.nc --yes|case new empty --yes
diagnose|diagnose two.toml|diagnose recordings --window nan|diagnose recordings --window inf
diagnose recordings --window 0|diagnose recordings --rig study.toml
diagnose recordings --rig pipe.toml|diagnose recordings --law study.toml
diagnose recordings --model study.toml|diagnose pipe.csv|diagnose recordings --out good.csv
diagnose recordings recordings|diagnose recordings --law .|replay|replay good.csv
replay broken.nc --out x.html|replay empty|replay missing.nc --out|orders good.csv --track nothing
orders good.csv --track 1,2,3|orders good.csv --max-order 0|orders good.csv --max-order 1e308
orders good.csv --turns nan|orders good.csv --turns -3|orders good.csv --rig missing.toml
orders good.csv --rig study.toml|orders good.csv --out rig.toml|orders good.csv --channel
orders good.csv --reference theta_9|orders axis.csv|explore rig.toml --port x
explore rig.toml --speed 1,2,3,4|explore rig.toml --speed nan,1,1|explore study.toml
explore rig.toml missing.toml|reproduce --samples x|reproduce --out .
reproduce --out out --samples 1e9|reproduce --seed x --out out|nothing at all|--bogus|-x
"""
