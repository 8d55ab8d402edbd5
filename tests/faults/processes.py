"""Kills and Ctrl-C of real processes at random moments."""

import os
import random
import resource
import shutil
import signal
import subprocess
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from omnijax import load_run
from omnijax.recording import read_recording

from .commands import GRID, LONG, RUN, Answer, contents, ended, here, started, words_of

SLACK = 2.0  # s from Ctrl-C to the end; on a machine with more work than cores, s of processor time
LATEST = 25.0  # s after its start that a command is interrupted
KILLED = {
    "simulate exact": f"{RUN} 300s --out {{}}.nc",
    "simulate csv": f"{RUN} 60s --rate 1kHz --out {{}}.csv.gz",
    "simulate torque": "simulate rig.toml --torque 0.1,0.2,0.15 --duration 12s --out {}.nc",
    "simulate ramp": "simulate rig.toml --speed 0..1,1.2,0.3 --duration 30s --out {}.nc",
    "sweep": f"{GRID}400 --chunk 4 --out {{}}.zarr",
    "tolerances": "tolerances study.toml --draws 512 --store {}",
}


def interrupts(number: int, seed: int = 0) -> tuple[int, list[str]]:
    """(Ctrl-C at random times over all commands, what was wrong): twice in every fifth."""
    rng, wrong, worst = random.Random(seed), [], 0.0
    names = [*LONG] * (number // len(LONG) + 1)
    for k, name in enumerate(names[:number]):
        before = _users()
        said, took = _interrupted(name, rng, twice=k % 5 == 4)
        worst = max(worst, took)
        if said is None and _users() != before:
            said = "the user's files changed"
        if said:
            wrong.append(f"{name}: {said}")
        _tidy()
    print(f"  slowest end after Ctrl-C: {worst:.2f} s, at load {os.getloadavg()[0]:.1f}")
    return number, wrong


class Pressed(NamedTuple):
    """What an interrupted process said, and what passed from Ctrl-C to its end."""

    answer: Answer
    took: float | None  # s; None where it was done before
    worked: float = 0.0  # s of processor time

    def late(self) -> bool:
        """Whether it took too long."""
        loaded = os.getloadavg()[0] > (os.cpu_count() or 1)
        return (self.took or 0.0) > SLACK and not (loaded and self.worked < SLACK)


def _interrupted(name: str, rng: random.Random, twice: bool) -> tuple[str | None, float]:
    delay = rng.uniform(0.3, LATEST)
    for _ in range(20):
        process = started(words_of(LONG[name], "new/x"))
        pressed = _pressed(process, delay, twice)
        answer, took, worked = pressed
        if took is not None and not (answer.code == 0 and answer.out.strip()):
            break
        delay *= rng.uniform(0.3, 0.9)  # it was done before
        _tidy()
    assert took is not None
    wrong = [
        (answer.code != 130, f"code {answer.code}"),
        ("Traceback" in answer.err, "traceback"),
        (not answer.err.strip(), "nothing said"),
        (pressed.late(), f"{took:.1f} s, {worked:.1f} s of processor time"),
        (bool(_left()), f"left {_left()}"),
    ]
    said = "; ".join(text for bad, text in wrong if bad)
    return (f"after {delay:.1f} s: {said}: {answer.err[-300:]!r}" if said else None), took


def _pressed(process: subprocess.Popen, delay: float, twice: bool) -> Pressed:
    """Interrupt a process after `delay` s."""
    try:
        process.wait(delay)
    except subprocess.TimeoutExpired:
        before, worked, began = _reaped(), _worked(process.pid), time.monotonic()
        os.killpg(process.pid, signal.SIGINT)
        if twice:
            time.sleep(0.05)
            os.killpg(process.pid, signal.SIGINT)
        answer = ended(process, 60)
        return Pressed(answer, time.monotonic() - began, _reaped() - before - worked)
    return Pressed(ended(process, 60), None)


def _reaped() -> float:
    """Processor time of the processes that have ended, s."""
    found = resource.getrusage(resource.RUSAGE_CHILDREN)
    return found.ru_utime + found.ru_stime


def _worked(pid: int) -> float:
    """Processor time of a process so far, s."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return 0.0
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def kills(number: int, seed: int = 0) -> tuple[int, list[str]]:
    """(SIGKILL at random times, those after which `--resume` gave other numbers or lost some)."""
    rng, wrong = random.Random(seed), []
    for name, command in KILLED.items():
        shutil.rmtree("whole", ignore_errors=True)
        answer = here(words_of(command, "whole/x"))
        assert answer.code in (0, 1), answer.err
        right = _numbers(Path("whole"), answer)
        words = words_of(command, "new/x")
        for k in range(max(1, number // len(KILLED))):
            process = started([*words, *["--resume"] * _begun()])
            _kill(process, rng.uniform(4.0, 14.0))
            if (said := _lost(name)) is not None:
                wrong.append(f"{name}, kill {k}: {said}")
            if process.returncode == 0 or _whole():
                _tidy()  # it was done before, or but for its end
        answer = here([*words, *["--resume"] * _begun()])
        if answer.code not in (0, 1):
            wrong.append(f"{name}: resumed with code {answer.code}: {answer.err[-300:]}")
        elif not _equal(right, _numbers(Path("new"), answer)):
            wrong.append(f"{name}: other numbers after --resume")
        _tidy()
    return number, wrong


def _kill(process: subprocess.Popen, delay: float) -> None:
    try:
        process.wait(delay)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
    ended(process, 60)


_held: dict[str, int] = {}


def _lost(name: str) -> str | None:
    """Whether a finished part is gone since the last kill."""
    parts = len([p for p in Path("new").rglob("*") if p.is_file() and ".part" not in p.name])
    before, _held[name] = _held.get(name, 0), parts
    whole = any(p.is_file() and p.name.startswith("x.") for p in Path("new").glob("*"))
    return f"{before} parts, then {parts}" if parts < before and not whole else None


def _begun() -> bool:
    """Whether there is something to go on with."""
    return any(Path("new").rglob("study.json")) or any(Path("new").glob("*.zarr/zarr.json"))


def _whole() -> bool:
    return not _begun() and any(p.is_file() for p in Path("new").glob("x.*"))


def _numbers(folder: Path, answer: Answer) -> list[np.ndarray]:
    found = []
    for path in sorted(folder.glob("x*")):
        if path.suffix == ".nc":
            run = load_run(path)
            found += [np.asarray(run[name]) for name in run.UNITS]
        elif path.name.endswith(".csv.gz"):
            found += [*read_recording(path).channels.values()]
        elif path.suffix == ".zarr":
            table = folder / "table.csv"
            assert here(["export", str(path), str(table)]).code == 0
            found.append(np.frombuffer(table.read_bytes(), np.uint8))
    return found or [np.frombuffer(_figures(answer.out), np.uint8)]


def _figures(text: str) -> bytes:
    return "\n".join(x for x in text.splitlines() if "new/" not in x and "whole/" not in x).encode()


def _equal(left: list[np.ndarray], right: list[np.ndarray]) -> bool:
    return len(left) == len(right) and all(map(np.array_equal, left, right))


def _users() -> dict[str, bytes]:
    return {k: v for k, v in contents().items() if not k.startswith(("new", "whole"))}


def _left() -> list[str]:
    return [str(p) for p in Path(".").rglob("*.part*")]


def _tidy() -> None:
    shutil.rmtree("new", ignore_errors=True)
    _held.clear()
