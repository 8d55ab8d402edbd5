"""Wrong inputs over all commands: each must end with one sentence, code 2 and nothing changed."""

import contextlib
import io
import os
import random
import re
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from omnijax.cli import run
from omnijax.rig import bundled_rigs

from .strange import GOOD, place, strange
from .wrong import wrong

LIMIT = 10.0  # s of processor time
LONGEST = 12_000  # characters of an answer

VALUES = (
    "nan", "inf", "-1e9", "1e300", "true", '"abc"', '"3 parsec/kg"', '"1 m**9**9**9"', "[]", "{}",
    '""', "1" + "0" * 400, "[[[[]]]]", '"1e999 m"', "2020-01-01",
)  # fmt: skip
KEYS = (
    "sphere.radius", "sphere.mass", "sphere.inertia", "platform.mass", "wheel.radius", "wheel.mass",
    "wheel.inertia", "wheel.rollers", "wheel.roundness", "wheel.normal", "wheel.drive",
    "wheel.contact", "wheel.mount", "wheel.closure", "wheel.name", "wheel.profile",
)  # fmt: skip
BODIES = {
    "half": lambda t: t[: len(t) // 2 + 7],
    "empty": lambda t: b"",
    "zeros": lambda t: bytes(4000),
    "latin": lambda t: t.replace(b"atlas", "stra\u00dfe".encode("latin-1")) + b"\xff",
    "nested": lambda t: b"a = " + b"[" * 20_000 + b"\n" + t,
    "digits": lambda t: t.replace(b"1.22", b"1" + b"0" * 5000),
    "long": lambda t: t.replace(b'"w1"', b'"' + b"w" * 1_000_000 + b'"'),
    "twice": lambda t: t + t,
    "binary": lambda t: bytes(range(256)) * 20,
    "a study": lambda t: b'rig = "atlas"\n[[drive]]\nspeed = [1,1,1]\n',
}
ARGUMENTS = """
check missing.toml|check .|check /dev/zero|check pipe.toml|check|init rig.toml|init /dev/null/x.toml
simulate rig.toml|simulate rig.toml --speed 1,2|simulate rig.toml --speed 1,2,x
simulate rig.toml --speed 1,2,3 --torque 1,2,3|simulate rig.toml --speed 1e300,1,1
simulate rig.toml --speed 1,2,3 --duration 0|simulate rig.toml --speed 1,2,3 --duration -1
simulate rig.toml --speed 1,2,3 --duration 1e9|simulate rig.toml --speed 1,2,3 --duration 1kg
simulate rig.toml --speed 1,2,3 --rate nan|simulate rig.toml --speed 1,2,3 --out run.xyz
simulate rig.toml --speed 1,2,3 --plot p.gif|simulate rig.toml --speed 1,2,3 --out rig.csv
simulate rig.toml --speed 1,2,3 --out rig.toml/x.nc|simulate rig.toml --drive missing.csv
simulate rig.toml --drive pipe.csv|simulate rig.toml --drive rig.toml
simulate rig.toml --speed 1,2,3 --rtol 5|simulate rig.toml --speed 1,2,3 --max-steps 0
simulate rig.toml --speed 1,2,3 --solver magic|simulate rig.toml --speed 1,2,3 --resume
simulate rig.toml --torque 1,2,3 --force 1,2|simulate rig.toml --speed 1rpm**9**9,1,1
sweep rig.toml --speed 1,2,3|sweep rig.toml --vary wheel.roundness=0.1:0.5:5
sweep rig.toml --vary wheel.roundness=0.1:0.5:1000000000000 --speed 1,2,3
sweep rig.toml --vary wheel.roundness=0.5:5:5 --speed 1,2,3
sweep rig.toml --vary nothing=1:2:3 --speed 1,2,3|sweep rig.toml --vary = --speed 1,2,3
sweep rig.toml --vary wheel.roundness=0.1:0.5:5 --speed 1,2,3 --workers 0 --out s.zarr
sweep rig.toml --vary wheel.roundness=0.1:0.5:5 --speed 1,2,3 --metric beauty
sweep rig.toml --vary wheel.roundness=0.1:0.5:5 --speed 1,2,3 --out rig.toml
sweep rig.toml --vary wheel.roundness=0.1:0.5:5 --speed 1,2,3 --chunk 0
sweep rig.toml --vary wheel.roundness=0.1:0.5:5 --speed 1,2,3 --seed -1
sweep rig.toml --vary wheel.roundness=0.1:0.5:5 --speed 1,2,3 --plot p.gif
sweep-status missing|sweep-status .|sweep-status rig.toml|export missing x.csv|export . x.csv
sensitivity rig.toml|sensitivity rig.toml --speed 1,2|sensitivity rig.toml --speed 1,2,3 --metric no
sensitivity rig.toml --speed 1,2,3 --parameter no|sensitivity rig.toml --speed 1,2,3 --out rig.toml
design rig.toml|design missing.toml|design .|design pipe.toml|design study.toml --rig study.toml
pareto missing.toml|pareto rig.toml|tolerances missing.toml|tolerances rig.toml
global-sensitivity missing.toml|global-sensitivity rig.toml|design nested.toml|pareto nested.toml
diagnose missing|diagnose rig.toml|diagnose .|diagnose . --window 1e9|diagnose . --window nan
replay missing.nc|replay rig.toml|replay .|replay pipe.nc|replay broken.nc|orders missing.csv
orders broken.nc|orders rig.toml|orders .|orders run.csv --turns 1e9
orders run.csv --max-order 1e12
orders run.csv --track a,b|orders run.csv --channel no|orders run.csv --reference no
explore|explore missing.toml|explore atlas --speed 1,2|explore atlas --port 99999999
reproduce|reproduce --out rig.toml|reproduce --out out --samples 0|nothing|simulate --bogus 1
"""


class Case(NamedTuple):
    """One attack: its name, the words of the command, and a rig file's content if it needs one."""

    name: str
    words: Sequence[str]
    content: bytes | None = None
    files: Mapping[str, str | bytes] = {}


def cases(number: int | None = None, seed: int = 0) -> list[Case]:
    """All attacks, or `number` of them drawn at random."""
    every = [*_rigs(), *_files(), *_arguments(), *_recordings()]
    more = [*strange(), *wrong(seed)]
    every += [Case(name, words, None, files) for name, words, files in more]
    return every if number is None else random.Random(seed).sample(every, number)


def _rigs() -> Iterator[Case]:
    text = bundled_rigs()["atlas"].read_text(encoding="utf-8")
    for key in KEYS:
        table, name = key.split(".")
        head = "[[wheel]]" if table == "wheel" else f"[{table}]"
        before, rest = text.split(head, 1)
        for value in VALUES:
            changed, count = re.subn(rf"(?m)^{name} = .*$", f"{name} = {value}", rest, count=1)
            good = name == "name" and value in (
                '"abc"',
                '"3 parsec/kg"',
                '"1 m**9**9**9"',
                '"1e999 m"',
            )
            if count and not good:
                yield Case(
                    f"{key} = {value[:20]}",
                    ["check", "case.toml"],
                    f"{before}{head}{changed}".encode(),
                )


def _files() -> Iterator[Case]:
    text = bundled_rigs()["atlas"].read_bytes()
    for name, change in BODIES.items():
        for words in (
            ["check"],
            ["simulate", "--speed", "1,2,3"],
            ["sensitivity", "--speed", "1,2,3"],
        ):
            if (words[0], name) == ("check", "a study"):
                continue  # `check` reads studies too
            yield Case(f"{words[0]} {name}", [words[0], "case.toml", *words[1:]], change(text))


def _arguments() -> Iterator[Case]:
    for line in ARGUMENTS.replace("\n", "|").split("|"):
        if line.strip():
            yield Case(line.strip(), line.split())


RUN = b"t,torque_1,torque_2,torque_3\n" + b"".join(b"%.3f,1,2,3\n" % (0.002 * i) for i in range(40))
TABLES = {
    "empty": b"", "head": RUN[:29], "two rows": RUN[:53], "no time": RUN.replace(b"t,", b"q,", 1),
    "two wheels": b"t,torque_1,torque_2\n0,1,1\n1,1,1\n2,1,1\n", "zeros": bytes(900),
    "text": RUN.replace(b",1,", b",one,"), "no head": RUN[29:],
    "time stands": RUN[:29] + b"0,1,1,1\n" * 9,
}  # fmt: skip


def _recordings() -> Iterator[Case]:
    for name, content in TABLES.items():
        for words in (
            ["simulate", "rig.toml", "--drive", "case.csv"],
            ["orders", "case.csv", "--rig", "rig.toml"],
        ):
            yield Case(f"{words[0]} table {name}", words, content)


def prepare(folder: Path) -> None:
    """The user's files that the attacks are run beside."""
    os.chdir(folder)
    text = bundled_rigs()["atlas"].read_bytes()
    Path("rig.toml").write_bytes(text)
    Path("study.toml").write_bytes(b'rig = "rig.toml"\n[[drive]]\nspeed = [1.0, 1.2, 0.3]\n')
    Path("nested.toml").write_bytes(b"a = " + b"[" * 20_000)
    Path("broken.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(3000))
    Path("run.csv").write_bytes(RUN)
    Path("empty").mkdir()
    place("recordings/rig.toml", text)
    place("recordings/run.csv", GOOD)
    for pipe in ("pipe.toml", "pipe.csv", "pipe.nc"):
        os.mkfifo(pipe)


def attack(case: Case) -> str | None:
    """Run one attack; what was wrong with the answer, or None."""
    name = next((w for w in case.words if w.startswith("case.")), None)
    if case.content is not None and name:
        Path(name).write_bytes(case.content)
    for path, text in case.files.items():
        place(path, text)
    before = _state()
    out, err = io.StringIO(), io.StringIO()
    began = time.process_time()
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = run([*case.words])
    except BaseException as error:
        return f"traceback: {type(error).__name__}: {str(error)[:100]}"
    took, said = time.process_time() - began, err.getvalue()
    if name:
        Path(name).unlink(missing_ok=True)
        before.pop(name, None)
    changed = (after := _state()) != before
    for path in set(after) - set(before):  # what it should not have written spoils no other attack
        Path(path).unlink()
    for path in case.files:
        Path(path).unlink(missing_ok=True)
    wrong = [
        (code != 2, f"code {code}"),
        (not said.strip(), "nothing said"),
        ("Traceback" in said, "traceback"),
        (len(said) > LONGEST, f"{len(said)} characters"),
        (took > LIMIT, f"{took:.0f} s"),
        (changed, "files changed"),
    ]
    return "; ".join(text for bad, text in wrong if bad) or None


def _state() -> dict[str, bytes]:
    return {str(p): p.read_bytes() for p in Path(".").rglob("*") if p.is_file()}
