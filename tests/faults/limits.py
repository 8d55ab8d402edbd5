"""What a command takes of the machine: ports that others reach, and memory."""

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

from .commands import GRID, RUN, ended, started

LISTENING = {
    "sweep --workers": f"{GRID}4000 --chunk 4 --workers 2 --out ports.zarr".split(),
    "explore": ["explore", "rig.toml", "--no-browser", "--port", "0"],
}
MOST = 1000.0  # bytes a sample
SHORT, LENGTH = 60, 1260  # s, at 500 Hz


def ports() -> tuple[int, list[str]]:
    """(commands that listen, those that others than this machine reach)."""
    wrong = []
    for name, words in LISTENING.items():
        process = started(words)
        try:
            found: set[tuple[str, int]] = set()
            deadline = time.monotonic() + 90
            while time.monotonic() < deadline and len(found) < 1 + 2 * ("sweep" in name):
                found |= _listening(process.pid)
                time.sleep(0.5)
            time.sleep(3)
            found |= _listening(process.pid)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            ended(process, 30)
        if not found:
            wrong.append(f"{name}: nothing listened, so nothing was tried")
        beyond = sorted(f"{a}:{p}" for a, p in found if a not in ("127.0.0.1", "::1"))
        wrong += [f"{name}: {', '.join(beyond)}"] if beyond else []
        print(f"  {name}: {len(found)} ports, {len(beyond)} beyond the loopback")
    shutil.rmtree("ports.zarr", ignore_errors=True)
    return len(LISTENING), wrong


def _listening(group: int) -> set[tuple[str, int]]:
    """Addresses on which a process or one of its children listens."""
    mine = set()
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, IndexError, ValueError):
            if int((folder / "stat").read_text().rsplit(")", 1)[1].split()[3]) == group:  # session
                mine |= {os.readlink(link) for link in (folder / "fd").iterdir()}
    found = set()
    for table, family, size in (("tcp", socket.AF_INET, 8), ("tcp6", socket.AF_INET6, 32)):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            cells = line.split()
            if cells[3] == "0A" and f"socket:[{cells[9]}]" in mine:
                address, port = cells[1].split(":")
                words = [bytes.fromhex(address[i : i + 8])[::-1] for i in range(0, size, 8)]
                found.add((socket.inet_ntop(family, b"".join(words)), int(port, 16)))
    return found


def memory() -> tuple[int, list[str]]:
    """(kinds of run, those that take more than 1 kB a sample)."""
    kinds = {
        "constant speeds, .nc": (RUN, ".nc", 1),
        "constant speeds, no file": (RUN, "", 1),
        "a ramp": ("simulate rig.toml --speed 0.9..1,1.2,0.3 --duration", ".nc", 6),
    }
    wrong = []
    for name, (command, kind, less) in kinds.items():
        peaks = []
        for seconds in (SHORT, SHORT, LENGTH // less):  # the first one compiles
            out = ["--out", f"memory-{seconds}{kind}", "--overwrite"] if kind else []
            peaks.append(_peak([*command.split(), f"{seconds}s", *out]))
        each = (peaks[2] - peaks[1]) / ((LENGTH // less - SHORT) * 500)
        print(f"  {name}: {peaks[1] / 1e6:.0f} MB, then {each:.0f} bytes a sample")
        if each > MOST:
            wrong.append(f"{name}: {each:.0f} bytes a sample")
    for path in Path(".").glob("memory-*"):
        path.unlink()
    return len(kinds), wrong


def _peak(words: list[str]) -> float:
    """Largest memory of a command, bytes (`ru_maxrss` would begin with this process's own)."""
    code = "import sys; from omnijax.cli import run; code = run(sys.argv[1:]); "
    code += "said = open('/proc/self/status').read(); "
    code += "print('peak', said.split('VmHWM:')[1].split()[0]); sys.exit(code)"
    done = subprocess.run(
        [sys.executable, "-c", code, *words], capture_output=True, text=True, check=True
    )
    return 1024.0 * float(done.stdout.rsplit("peak", 1)[1])
