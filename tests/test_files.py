"""Results in files: nothing is written over unasked, an input never; whole or absent."""

import contextlib
import os
import shutil
from pathlib import Path

import pytest
from tiers import more, tiered

from omnijax import InputError, _files
from omnijax.cli import run
from omnijax.recording import files_of_recording
from omnijax.rig import bundled_rigs

SHORT = ("--speed", "1,1.2,0.3", "--duration", "0.1s")


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture(scope="module")
def own_files(tmp_path_factory):
    """A folder with the user's own files: a rig, a measured run with its NAME.toml, a study."""
    folder = tmp_path_factory.mktemp("own")
    with contextlib.chdir(folder):
        shutil.copy(bundled_rigs()["atlas"], "rig.toml")
        assert run(["simulate", "rig.toml", *SHORT, "--out", "run.csv"]) == 0
        assert run(["simulate", "rig.toml", *SHORT, "--out", "run.nc"]) == 0
        Path("run.toml").write_text('rig = "rig.toml"\nrole = "held-out"\n')
        Path("study.toml").write_text('rig = "rig.toml"\n[[drive]]\nspeed = [1.0, 1.2, 0.3]\n')
        Path("my-rig.toml").write_text("mine")
        Path("folder.html").mkdir()
        Path("page").mkdir()
        Path("page/index.html").write_text("an older page")
    return folder


@pytest.fixture
def here(own_files, tmp_path, monkeypatch):
    """A copy of that folder, which is the working one."""
    shutil.copytree(own_files, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


# what would be written over, or cannot be written; the last words of the sentence
REFUSED = {
    "rig by the sidecar of a run": ("simulate rig.toml -S --out rig.csv", "never written over"),
    "rig by a packed run": ("simulate rig.toml -S --out rig.csv.gz", "never written over"),
    "rig by a Parquet run": ("simulate rig.toml -S --out rig.parquet", "never written over"),
    "a measured run": ("simulate rig.toml -S --out run.csv", "--force"),
    "its own drive": ("simulate rig.toml --drive run.csv --out run.csv", "never written over"),
    "a file beside": ("simulate atlas -S --out my.csv", "my-rig.toml: exists"),
    "an older run": ("simulate rig.toml -S --out run.nc", "--force"),
    "a picture": ("simulate rig.toml -S --plot page/index.html.png", ""),
    "a page": ("sweep rig.toml --vary wheel.roundness=0.1:0.2:2 -s --report page", "--force"),
    "a store where a file is": (
        "sweep rig.toml --vary wheel.roundness=0.1,0.2 -s --out run.nc",
        "a folder is to be written",
    ),
    "a store below a device": (
        "sweep rig.toml --vary wheel.roundness=0.1,0.2 -s --out /dev/null/a.zarr",
        "/dev/null/a.zarr: cannot be written: /dev/null is no folder.",
    ),
    "a page of orders": ("orders run.nc --out page", "--force"),
    "a page of sensitivities": ("sensitivity rig.toml -s --report page", "--force"),
    "the run by its replay": ("replay run.nc --out run.nc", "must end in one of .html"),
    "a rig by a replay": ("replay run.nc --out rig.toml", "must end in one of .html"),
    "the study by its design": ("design study.toml --rig study.toml", "never written over"),
    "the study's rig": ("tolerances study.toml --out rig.toml", "must end in .nc"),
    "an older front": ("pareto study.toml --out run.nc", "--force"),
    "the paper's page": ("reproduce --out page", "--force"),
    "a file as a folder": ("reproduce --out rig.toml", "a folder is to be written"),
    "a page as a folder": ("reproduce --out page.html", "take page, whose page is index.html"),
    "a folder as a file": ("replay run.nc --out folder.html", "is a folder or a device"),
    "a device": ("init /dev/full --force", "must end in .toml"),
    "below a file": ("simulate rig.toml -S --out rig.toml/run.nc", "cannot be written"),
    "a name too long": (f"init {'x' * 300}.toml", "cannot be written"),
    "a zero byte": ("init a\0b.toml", "cannot be written"),
}


# in the gate every command and every kind of refusal once, which these repeat
FURTHER = {
    "rig by a packed run", "rig by a Parquet run", "a file beside", "an older run", "a picture",
    "a store below a device", "the run by its replay", "the study's rig", "a file as a folder",
    "a page as a folder", "a page of sensitivities", "a zero byte",
}  # fmt: skip


@pytest.mark.parametrize("kind", tiered(REFUSED, FURTHER.__contains__))
def test_nothing_of_the_users_is_written_over(here, capsys, kind):
    words, said = REFUSED[kind]
    words = words.split(" ")
    full = [x for w in words for x in ({"-S": SHORT, "-s": SHORT[:2]}.get(w) or (w,))]
    if words[3:4] == ["page/index.html.png"] or "index.html.png" in words[-1]:
        Path("page/index.html.png").write_text("older")
        said = "--force"
    before = contents(here)
    capsys.readouterr()
    code = run(full)
    err = capsys.readouterr().err
    assert code == 2 and said in err, err
    assert contents(here) == before


def test_an_input_is_not_written_over_even_by_force(here, capsys):
    before = contents(here)
    os.link("rig.toml", "same.nc")
    os.symlink("rig.toml", "other.nc")
    for out in ("rig.csv", "same.nc", "other.nc"):
        code = run(["simulate", "rig.toml", *SHORT, "--out", out, "--force"])
        assert code == 2 and "never written over" in capsys.readouterr().err
    os.remove("same.nc"), os.remove("other.nc")
    assert contents(here) == before


def test_force_writes_over_results(here, capsys):
    old = Path("run.nc").read_bytes()
    words = ["simulate", "rig.toml", "--speed", "2,1,0.5", "--duration", "0.1s", "--out", "run.nc"]
    assert run([*words, "--force"]) == 0 and Path("run.nc").read_bytes() != old
    assert run([*words, "--overwrite", "--force", "1,0,0"]) == 0  # the force on the platform
    assert run(["simulate", "atlas", *SHORT, "--out", "my.csv", "--force"]) == 0
    assert Path("my-rig.toml").read_text() != "mine"
    log, beside = Path("log.csv"), Path("log.toml")
    words = ["simulate", "rig.toml", *SHORT, "--out", "log.csv"]
    assert run(words) == 0 and run(["simulate", "atlas", *SHORT, "--out", "other.csv"]) == 0
    old = log.read_bytes()
    assert run([*words, "--force", "1,0,0", "--overwrite"]) == 0  # the sidecar stands, too
    assert log.read_bytes() != old and 'rig = "rig.toml"' in beside.read_text()
    beside.write_text("[sphere]\n")
    assert run([*words, "--overwrite"]) == 2  # before the work
    assert "is no NAME.toml of a run" in capsys.readouterr().err
    assert log.read_bytes() != old and beside.read_text() == "[sphere]\n"
    drive = ["simulate", "rig.toml", "--drive", "other.csv", "--out", "other.csv", "--overwrite"]
    assert run(drive) == 2 and "never written over" in capsys.readouterr().err
    assert not [x for x in os.listdir() if x.startswith(".omnijax")]


def test_a_run_does_not_take_the_name_of_a_rig_from_python(here):
    from omnijax import read_recording, write_recording

    measured = read_recording("run.csv")
    with pytest.raises(InputError, match=r"rig\.toml: exists and is no NAME\.toml of a run"):
        write_recording("rig.csv", measured)
    assert not Path("rig.csv").exists()
    assert [x.name for x in files_of_recording("a/run-1.csv.gz")] == ["run-1.csv.gz", "run-1.toml"]


def test_a_file_is_whole_or_absent(tmp_path):
    target = tmp_path / "deep" / "result.txt"
    _files.write_text(target, "first")

    def broken():
        with _files.writing(target) as part:
            part.write_text("sec")
            raise OSError(28, "No space left on device")

    with pytest.raises(InputError, match=r"result\.txt: cannot be written: No space left"):
        broken()
    assert target.read_text() == "first" and os.listdir(target.parent) == ["result.txt"]


def test_two_results_do_not_share_a_name(tmp_path):
    with pytest.raises(InputError, match="two results would have this name"):
        _files.claim([tmp_path / "a.nc", tmp_path / "b" / ".." / "a.nc"])


TORQUES = ("--torque", "0.1,0.2,0.15", "--duration", "1.2s", "--rate", "1kHz")
SPEEDS = ("--speed", "1,-1.2,0.3", "--duration", "1.2s", "--rate", "9kHz")


@pytest.mark.parametrize(
    ("asked", "kind"),
    # torques in the gate: test_cli_simulate
    [(SPEEDS, ".nc"), (SPEEDS, ".csv.gz"), *more((TORQUES, ".nc"))],
)
def test_a_killed_run_goes_on_and_another_machine_does_not(
    tmp_path, monkeypatch, capsys, asked, kind
):
    import numpy as np

    from omnijax import load_trajectory, read_recording
    from omnijax.cli._simulate.run import StoredPieces

    class Killed(BaseException):
        """What no command can answer."""

    def add(self, run, end, whole=StoredPieces.add):
        whole(self, run, end)
        if self.count == 2:
            raise Killed

    monkeypatch.chdir(tmp_path)
    rig = bundled_rigs()["atlas"].read_text(encoding="utf-8")
    Path("rig.toml").write_text(rig, encoding="utf-8")
    killed, whole = f"killed{kind}", f"whole{kind}"
    words = ["simulate", "rig.toml", *asked, "--out", killed]
    with monkeypatch.context() as patch:
        patch.setattr(StoredPieces, "add", add)
        with pytest.raises(Killed):
            run(words)
    kept = contents(tmp_path)
    assert f"{killed}.pieces/piece-000001.npz" in kept
    assert run(words) == 2 and "continue with --resume" in capsys.readouterr().err
    Path("rig.toml").write_text(rig.replace("damping = 120.0", "damping = 130.0"), "utf-8")
    assert run([*words, "--resume"]) == 2
    assert "rig.wheel.w1.contact.damping: 120.0 -> 130.0" in capsys.readouterr().err
    Path("rig.toml").write_text(rig, encoding="utf-8")
    assert run([*words[:4], "--duration", "1.1s", *words[6:], "--resume"]) == 2
    assert "times" in capsys.readouterr().err and contents(tmp_path) == kept
    assert run([*words, "--resume"]) == 0
    assert run([*words[:-1], whole]) == 0 and not Path(f"{killed}.pieces").exists()
    read = load_trajectory if kind == ".nc" else lambda name: read_recording(name).group("dR")
    one, other = (getattr(found, "dR", found) for found in map(read, (killed, whole)))
    samples = 1 + round(1.2 * (1000 if asked is TORQUES else 9000))
    assert len(one) == samples and np.array_equal(one, other)


@pytest.mark.parametrize("words", ["replay run.nc", "orders run.nc", "replay run.nc.pieces"])
def test_a_run_that_is_not_finished_says_how_to_go_on(tmp_path, monkeypatch, capsys, words):
    monkeypatch.chdir(tmp_path)
    Path("run.nc.pieces").mkdir()
    assert run(words.split()) == 2
    assert "lies in run.nc.pieces. The command that began it goes on" in capsys.readouterr().err
