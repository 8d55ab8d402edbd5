"""Every command at work on small files, in this process or in one of its own."""

import contextlib
import io
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from omnijax.cli import run
from omnijax.rig import bundled_rigs

STUDY = """rig = "rig.toml"
[objective]
metric = "rms"
[[drive]]
speed = [1.0, 1.2, 0.3]
[[variable]]
path = "contact.stiffness"
low = 5e4
high = 5e5
[[variable]]
path = "contact.damping"
low = 60.0
high = 300.0
[tolerance]
"contact.stiffness" = 0.1
[limit]
metric = "rms"
max = "5 mm"
confidence = 0.9
[search]
starts = 1
[sampling]
samples = 16
[pareto]
metrics = ["rms", "peak"]
points = 3
"""
SPEED = ("--speed", "1,1.2,0.3")

RUN = "simulate rig.toml --speed 1,1.2,0.3 --duration"
GRID = "sweep rig.toml --speed 1,1.2,0.3 --metric rms,peak --vary contact.stiffness=log:5e4:5e5:"
SWEEP = f"{GRID}12 --duration 20ms"

# name -> words; `{}` is where its results go
WRITING = {
    "init": "init {}.toml",
    "simulate nc": f"{RUN} 0.1s --out {{}}.nc",
    "simulate csv": f"{RUN} 0.1s --out {{}}.csv.gz",
    "simulate parquet": "simulate atlas --speed 1,1.2,0.3 --duration 0.1s --out {}.parquet",
    "simulate plot": f"{RUN} 0.1s --plot {{}}.png",
    "simulate in pieces": f"{RUN} 1s --rate 9kHz --out {{}}.nc",
    "sweep": f"{SWEEP} --chunk 4 --out {{}}.zarr",
    "sweep page": f"{SWEEP} --report {{}}",
    "export": "export store.zarr {}.csv",
    "export nc": "export store.zarr {}.nc",
    "replay": "replay run.nc --out {}.html",
    "orders": "orders run.nc --turns 1 --out {}",
    "tolerances": "tolerances study.toml --draws 64 --store {} --out {}.nc",
}
LONG = {  # for interruptions and kills
    "simulate exact": f"{RUN} 4000s --out {{}}.nc",
    "simulate csv": f"{RUN} 900s --out {{}}.csv.gz",
    "simulate torque": "simulate rig.toml --torque 0.1,0.2,0.15 --duration 90s --out {}.nc",
    "simulate ramp": "simulate rig.toml --speed 0..1,1.2,0.3 --duration 120s --out {}.nc",
    "sweep": f"{GRID}12000 --chunk 4 --out {{}}.zarr",
    "sweep workers": f"{GRID}12000 --chunk 4 --workers 2 --out {{}}.zarr",
    "sweep torque": "sweep rig.toml --torque 0.1,0.2,0.15 --duration 3s --metric rms --chunk 4 "
    "--vary contact.stiffness=log:5e4:5e5:400 --out {}.zarr",
    "sensitivity": "sensitivity rig.toml --torque 0.1,0.2,0.15 --duration 3s",
    "design": "design study.toml --store {}",
    "pareto": "pareto study.toml --store {}",
    "tolerances": "tolerances study.toml --store {}",
    "global-sensitivity": "global-sensitivity study.toml --store {}",
    "diagnose": "diagnose recordings --out {}",
    "reproduce": "reproduce --out {}",
    "explore": "explore rig.toml --no-browser --port 0",
    "check": "check rig.toml",
    "replay": "replay run.nc --out {}.html",
    "orders": "orders run.nc --turns 1 --out {}",
    "export": "export store.zarr {}.csv",
    "sweep-status": "sweep-status store.zarr",
}


class Answer(NamedTuple):
    """What a command said."""

    code: int | None
    out: str
    err: str


def words_of(command: str, name: str) -> list[str]:
    """The words of a command whose results are called `name`."""
    return command.replace("{}", name).split()


def here(words: list[str]) -> Answer:
    """A command in this process; raises what it could not answer."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run(words)
    return Answer(code, out.getvalue(), err.getvalue())


def started(words: list[str], **more) -> subprocess.Popen:
    """A command in a process group of its own, which hears Ctrl-C."""
    code = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
    code += "from omnijax.cli import main; main(sys.argv[1:])"
    return subprocess.Popen(
        [sys.executable, "-c", code, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL, text=True, start_new_session=True, **more,
    )  # fmt: skip


def ended(process: subprocess.Popen, within: float) -> Answer:
    """What a process said; one that does not end is killed, and has no code."""
    try:
        out, err = process.communicate(timeout=within)
    except subprocess.TimeoutExpired:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        out, err = process.communicate()
        return Answer(None, out, err)
    return Answer(process.returncode, out, err)


def prepare_store(folder: Path) -> None:
    """A rig, a study, a run and a sweep; the current folder is the user's from here on."""
    os.chdir(folder)
    Path("rig.toml").write_bytes(bundled_rigs()["atlas"].read_bytes())
    Path("study.toml").write_text(STUDY, encoding="utf-8")
    _done(["simulate", "rig.toml", *SPEED, "--duration", "20s", "--out", "run.nc"])
    _done([*SWEEP.split(), "--chunk", "4", "--out", "store.zarr"])


def prepare(folder: Path) -> None:
    """The same, and recordings of torque-driven runs."""
    prepare_store(folder)
    Path("recordings").mkdir()
    Path("recordings", "rig.toml").write_bytes(Path("rig.toml").read_bytes())
    for x in ("0.2", "-0.1"):
        words = ["simulate", "rig.toml", "--torque", f"0.1,{x},0.15", "--duration", "2s"]
        _done([*words, "--out", f"recordings/run-{x}.csv"])


def _done(words: list[str]) -> None:
    answer = here(words)
    assert answer.code == 0, answer.err


def contents(folder: Path = Path(".")) -> dict[str, bytes]:
    """Every file below `folder`."""
    return {str(p): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}
