"""Studies that are killed outright: what was finished is kept, and the answer is the same.

The page that a taken-up study writes says how to make it from the start.
"""

import os
import re
import signal
import subprocess
import sys
import time
import tomllib
import warnings
from pathlib import Path

import pytest

from omnijax._errors import DataWarning
from omnijax.cli._frame import run
from omnijax.rig import InputError
from omnijax.study import tolerances
from omnijax.study._spread.tolerances import share_bounds
from omnijax.study._study_folder import Folder

TEXT = """
rig = "atlas"
duration = 0.2
rate = 500
[[drive]]
speed = [3.0, 5.1, 7.3]
[[variable]]
path = "contact.stiffness"
low = "50 kN/m"
high = "1 MN/m"
[[variable]]
path = "contact.damping"
low = 60
high = 600
[search]
starts = 3
batch = 1
[sampling]
samples = 64
"""
TOLERANCES = (
    TEXT
    + """
[tolerance]
"wheel.w3.roundness" = 0.1
[limit]
metric = "rms"
max = "0.61 mm"
confidence = 0.9
"""
)
# after its second part the study waits for the test to kill it
SLOW = """
import time
from omnijax.cli import main
from omnijax.study._study_folder import Folder
write, written = Folder.write, []
def slow(*args):
    if len(written) == 2:
        time.sleep(600)
    write(*args)
    written.append(1)
Folder.write = slow
main()
"""
COMMANDS = {
    "tolerances": (TOLERANCES, ["--draws", "128"]),
    "design": (TEXT, []),  # a front's searches are kept by the same lines
    "global-sensitivity": (TEXT, []),
}


def parts(folder) -> dict[str, float]:
    """Finished parts and when each was written."""
    return {p.name: p.stat().st_mtime_ns for p in folder.glob("[!.]*.npz")}


@pytest.mark.full  # in the gate an interrupt (below), killed runs and sweeps
@pytest.mark.parametrize("command", list(COMMANDS))
def test_a_killed_study_is_taken_up(command, tmp_path, capsys, monkeypatch):
    path, store = tmp_path / "study.toml", tmp_path / "store"
    text, more = COMMANDS[command]
    path.write_text(text)
    line = [command, str(path), *more]
    assert run(line) == 0
    whole = capsys.readouterr().out
    kept = [*line, "--store", str(store)]
    process = subprocess.Popen([sys.executable, "-c", SLOW, *kept], stderr=subprocess.DEVNULL)
    while len(parts(store)) < 2:
        assert process.poll() is None, "the study ended before it could be killed"
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    before = parts(store)
    assert len(before) == 2
    again = [*kept, "--resume", "--report", str(tmp_path / "page")]
    monkeypatch.setattr("sys.argv", ["omnijax", *again])
    assert run(again) == 0
    assert capsys.readouterr().out == whole
    page = (tmp_path / "page" / "index.html").read_text(encoding="utf-8")
    shown = " ".join(["omnijax", *line, "--report", str(tmp_path / "page")])
    assert f'<pre class="command"><code>{shown}</code>' in page and "[search]\nstarts = 3" in page
    after = parts(store)
    assert len(after) > 2 and {name: after[name] for name in before} == before


@pytest.mark.full
def test_interrupted_tolerances_are_kept_and_a_changed_study_is_refused(
    tmp_path, capsys, monkeypatch
):
    path, store = tmp_path / "study.toml", tmp_path / "store"
    path.write_text(TOLERANCES)
    line = ["tolerances", str(path), "--draws", "128", "--store", str(store)]

    def stop(self, key, arrays, write=Folder.write):
        if key == "round-0-64":
            raise KeyboardInterrupt
        write(self, key, arrays)

    monkeypatch.setattr(Folder, "write", stop)
    assert run(line) == 130
    said = f"Interrupted: 2 finished parts are kept in {store}. Continue with the same command and"
    assert said in capsys.readouterr().err
    monkeypatch.undo()
    before = parts(store)
    changes = [
        ("0.61 mm", "0.62 mm", "limit: ['rms', 0.00061, None] -> ['rms', 0.00062, None]"),
        ("7.3]", "7.4]", "drives.drive 1.values: [3.0, 5.1, 7.3] -> [3.0, 5.1, 7.4]"),
    ]
    for old, new, difference in changes:
        path.write_text(TOLERANCES.replace(old, new))
        assert run([*line, "--resume"]) == 2
        text = capsys.readouterr().err
        assert text.endswith(f"is left as it is. They differ in:\n  {difference}\n"), text
    assert parts(store) == before


def test_so_few_machines_are_refused_as_cannot_show_the_share():
    few = tomllib.loads(TOLERANCES.replace("confidence = 0.9", "confidence = 0.99"))
    message = "`draws` must be at least 381 for a confidence of 0.99, but is 380."
    with pytest.raises(InputError, match=re.escape(message)):
        tolerances(few, draws=380)
    assert share_bounds(381, 381)[0] >= 0.99 > share_bounds(380, 380)[0]


SHORT = ["--speed", "1,1,1", "--duration", "20ms"]


@pytest.mark.parametrize(
    ("line", "result", "kept"),
    [
        (["simulate", "atlas", *SHORT], "new.nc", "new.nc.pieces"),
        (["simulate", "atlas", *SHORT], "new.csv", "new.csv.pieces"),
        (["sweep", "atlas", "--vary", "wheel.roundness=0.1,0.2", *SHORT], "new.zarr", "new.zarr"),
    ],
)
def test_where_nothing_is_kept_resume_begins_and_says_so(
    tmp_path, monkeypatch, capsys, line, result, kept
):
    """`simulate` refused, the others began without a word, also under a mistyped name."""
    monkeypatch.chdir(tmp_path)
    assert run([*line, "--out", result, "--resume"]) == 0
    said = f"{kept}: nothing is kept there yet, so it begins from the start."
    assert said in capsys.readouterr().err and Path(result).exists()


def test_a_study_that_is_resumed_where_nothing_is_kept_begins_and_says_so(tmp_path):
    with pytest.warns(DataWarning, match="nothing is kept there yet, so it begins from the start"):
        Folder(tmp_path / "new", {"seed": 0}, resume=True)
    Folder(tmp_path / "new", {"seed": 0}, resume=True)  # and then without a word


@pytest.mark.parametrize(
    ("line", "kept"),
    [
        (["simulate", "atlas", "--out", "run.nc", *SHORT, "--resume"],
         "run is whole in run.nc.pieces. Missing: run.nc."),
        (["sweep", "atlas", "--vary", "platform.mass=5,6", "--out", "store", *SHORT],
         "2 of 2 designs are done and kept in store. Continue with the same command and --resume"),
        pytest.param(  # in the gate an interrupted search: test_design_rig
            ["tolerances", "study.toml", "--draws", "64", "--store", "store"],
            "parts are kept in store. Continue with the same command and --resume",
            marks=pytest.mark.full,
        ),
    ],
)  # fmt: skip
def test_an_interruption_of_the_answer_says_that_its_work_is_kept(
    tmp_path, monkeypatch, capsys, line, kept
):
    """It said that nothing more was written, and nothing of --resume."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["omnijax", *line])
    Path("study.toml").write_text(TOLERANCES)

    def stop(*_, **__):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("omnijax.simulation.save_trajectory", stop)
        patch.setattr("omnijax.report.sweep_page", stop)
        patch.setattr("omnijax.report.study_page", stop)
        more = [] if line[0] == "simulate" else ["--report", "page"]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DataWarning)
            assert run([*line, *more]) == 130
    assert kept in capsys.readouterr().err
    assert run([*line, *([] if line[0] == "simulate" else ["--resume"])]) == 0
