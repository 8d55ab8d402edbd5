"""The command line as a user runs it: help, exit codes, messages, output for machines."""

import json
import os
import signal
import subprocess
import sys
import time
import tomllib

import pytest

from omnijax import __version__, cli
from omnijax._errors import InputError, RunError, require
from omnijax.cli import COMMANDS, _frame, build_app, run
from omnijax.cli._console import progress
from omnijax.cli._console.tokens import understood
from omnijax.laws import EFFECTS
from omnijax.rig import load_rig, parse_rig, rig_text

NAMES = [name for names in COMMANDS.values() for name in names]


def call(capsys, *tokens):
    """Exit code, standard output and standard error of one call."""
    code = run(list(tokens))
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_help_names_every_command_and_the_exit_codes(capsys):
    code, out, _ = call(capsys, "--help")
    assert code == 0
    assert all(f" {name} " in out for name in NAMES)
    assert "0 done, 1 a run failed, 2 wrong input, 130 interrupted" in " ".join(out.split())
    assert call(capsys)[1] == out


@pytest.mark.parametrize("name", NAMES)
def test_every_command_has_an_example_in_its_help(capsys, name):
    code, out, _ = call(capsys, name, "--help")
    assert code == 0
    assert f"Example: omnijax {name}" in out or f"Example: omnijax {name}" in out.replace("\n", " ")


def test_version(capsys):
    assert call(capsys, "--version") == (0, f"omnijax {__version__}\n", "")


def test_the_first_help_is_fast():
    """CPU time of a process that answers `--help`, against one that imports jax."""

    def seconds(code):
        start = os.times()
        subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
        end = os.times()
        return end.children_user + end.children_system - start.children_user - start.children_system

    ours = min(seconds("from omnijax.cli import run; run(['--help'])") for _ in range(3))
    assert ours < 0.5 * min(seconds("import jax") for _ in range(2))


@pytest.mark.parametrize(
    ("tokens", "sentence"),
    [
        (["chek", "atlas"], 'Unknown command "chek". Did you mean "check"?'),
        (["check", "atlas", "--jsn"], "Unknown option: --jsn. Did you mean `--json`?"),
        (["simulate", "atlas", "--bogus"], "Unknown option: --bogus.\nSee: omnijax simulate"),
        (["check"], "requires an argument"),
        (["check", "atlas", "--jsn"], "See: omnijax check --help"),
        (["simulate", "atlas", "--speed", "1 2 3"], "write commas between the values"),
        (["simulate", "atlas", "--speed", "-1,2"], "`speed` has 2 values, but the rig has 3"),
        (["simulate", "atlas", "--speed", "-1,2,3", "--duration", "-2s"], "but is -2."),
        (["check", "atlsa"], "Did you mean `atlas`?"),
        (["effects", "contact-cubik"], "no effect's id contains 'contact-cubik'. Did you mean"),
    ],
)
def test_wrong_input_is_exit_2_with_one_message(capsys, tokens, sentence):
    code, out, err = call(capsys, *tokens)
    assert (code, out) == (2, "")
    assert sentence in err and "Traceback" not in err


def test_what_is_no_run_is_told_what_replay_takes(capsys, tmp_path):
    """It was told the endings of a run's files, with .csv, which `replay` does not take."""
    (tmp_path / "rig.toml").write_text(rig_text(load_rig("atlas")))
    code, _, error = call(capsys, "replay", str(tmp_path / "rig.toml"))
    assert code == 2
    assert "`replay` takes a run saved by `omnijax simulate --out RUN.nc`, or the" in error
    (tmp_path / "run.csv").write_text("t,torque_1\n0,0\n1,0\n")
    assert "run.csv is a recording, not a run" in call(capsys, "replay", f"{tmp_path}/run.csv")[2]


def test_a_value_may_begin_with_a_minus():
    given = ["simulate", "a", "--speed", "-1,2", "--force", "-.5,0,0", "--drive", "-x", "--json"]
    assert understood(given)[2:5] == ["--speed=-1,2", "--force=-.5,0,0", "--drive"]
    assert understood(["design", "--vary=a=1", "-1"])[-1] == "-1"  # it has its value already
    assert understood([]) == []


def test_help_is_a_command_too(capsys):
    assert call(capsys, "help", "simulate") == call(capsys, "simulate", "--help")
    assert call(capsys, "help") == call(capsys, "--help")


def test_help_breaks_where_the_terminal_ends(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "300")
    said = call(capsys, "sweep", "--help")[1].splitlines()
    assert any(line.startswith("Example: ") and line.endswith("--out sweep.zarr") for line in said)
    assert any("once for each parameter. PATH is a rig parameter" in line for line in said)


def test_a_rig_and_a_study_are_told_apart(tmp_path, capsys):
    (tmp_path / "study.toml").write_text('rig = "atlas"\n[objective]\nmetric = "rms"\n')
    code, _, err = call(capsys, "simulate", str(tmp_path / "study.toml"), "--omega", "0,0,1")
    assert code == 2 and "is a study file, not a rig file" in err and err.count("\n") == 1
    call(capsys, "init", str(tmp_path / "rig.toml"))
    code, _, err = call(capsys, "design", str(tmp_path / "rig.toml"))
    assert code == 2 and "is a rig file, not a study file" in err and err.count("\n") == 1
    call(capsys, "init", str(tmp_path / "machine.toml"), "--axis")
    for command, kind in (("explore", "rig"), ("design", "study")):
        code, _, err = call(capsys, command, str(tmp_path / "machine.toml"))
        assert code == 2 and err.endswith(f"is a machine file (of an axis), not a {kind} file.\n")


def test_an_axis_shows_its_uncertainty_as_shares_and_in_units(tmp_path, capsys):
    call(capsys, "init", str(tmp_path / "machine.toml"), "--axis")
    _, out, _ = call(capsys, "check", str(tmp_path / "machine.toml"))
    shown = [line.split("  ") for line in out.splitlines()]
    spread = {words[1]: words[-1] for words in shown if words[-1].startswith("±")}
    assert spread["axis.inertia"] == "± 30 %"  # of 0.002 kg m²
    assert spread["axis.offset"] == "± 0.01 N m"  # of 0


def test_xla_keeps_its_opinions_to_itself(monkeypatch, capsys):
    """A compilation of two minutes made XLA ask the user to file a bug."""
    monkeypatch.delenv("TF_CPP_MIN_LOG_LEVEL", raising=False)
    with pytest.raises(SystemExit):
        cli.main(["--version"])
    assert os.environ["TF_CPP_MIN_LOG_LEVEL"] == "3" and capsys.readouterr().out


def test_a_long_stage_says_that_it_goes_on(capsys, monkeypatch):
    monkeypatch.setattr(progress, "STILL", 0.05)
    with progress.stages() as tell:
        time.sleep(0.2)  # no stage has begun
        assert capsys.readouterr().err == ""
        tell("weighing")
        time.sleep(0.3)
        monkeypatch.setattr(progress, "STILL", 60.0)  # nothing more is said, however slow this is
        tell("refitting")
    first, *on, last = capsys.readouterr().err.splitlines()
    assert first.endswith(" s  weighing") and last.endswith(" s  refitting")
    assert len(on) >= 2 and all(line.endswith("0 s of it: weighing") for line in on)
    time.sleep(0.2)
    assert capsys.readouterr().err == ""  # nobody speaks after the end


def test_no_option_is_made_of_a_list(capsys):
    """`--empty-law` stood in the help of `diagnose`."""
    for name in NAMES:
        assert "--empty-" not in call(capsys, name, "--help")[1], name


def test_exit_codes(monkeypatch, capsys):
    def code_of(error):
        def app():
            def raising(tokens):
                raise error

            return raising

        monkeypatch.setattr(_frame, "build_app", app)
        return call(capsys)[::2]

    assert code_of(InputError(["`a` is wrong.", "`b` too."], "f")) == (
        2,
        "f: `a` is wrong.\nf: `b` too.\n",
    )
    assert code_of(RunError("stopped at 3 s")) == (1, "stopped at 3 s\n")
    assert code_of(KeyboardInterrupt()) == (130, "Interrupted. Nothing more was written.\n")
    assert code_of(KeyboardInterrupt("Resume with --resume.")) == (130, "Resume with --resume.\n")
    lost = OSError(2, "No such file or directory", "/nowhere/page")
    assert code_of(lost)[0] == 2
    assert code_of(lost)[1].startswith("/nowhere/page: cannot be read or written: No such file")
    with pytest.raises(OSError, match="no file of the user's"):
        code_of(OSError("no file of the user's"))
    with pytest.raises(ZeroDivisionError):  # a fault of ours is not hidden
        code_of(ZeroDivisionError())


@pytest.mark.parametrize(
    ("number", "ending", "ignored"),
    [(signal.SIGINT, 130, False), (signal.SIGTERM, 143, False), (signal.SIGTERM, 143, True)],
    ids=["Ctrl-C", "SIGTERM", "SIGTERM in the background of a shell"],
)
def test_an_interruption_of_a_real_process(number, ending, ignored):
    """SIGTERM ended it without a word."""
    # a test run in the background ignores Ctrl-C, and its children inherit that
    how = "SIG_IGN" if ignored else "default_int_handler"
    code = f"import signal, time; signal.signal(signal.SIGINT, signal.{how}); "
    code += "from omnijax import cli; from omnijax.cli import _frame; _frame.build_app = lambda: "
    code += "lambda tokens: (print('up', flush=True), time.sleep(60)); cli.main()"
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None and process.stdout.readline() == "up\n"
        process.send_signal(number)
        _, err = process.communicate(timeout=120)
    assert (process.returncode, err) == (ending, "Interrupted. Nothing more was written.\n")


@pytest.mark.parametrize(
    "lost",
    ["import pressed", "Pressed()"],
    ids=["held back while a library is loaded", "dropped by a callback"],
)
def test_a_lost_ctrl_c_is_raised_again(tmp_path, lost):
    press = "import os, signal; os.kill(os.getpid(), signal.SIGINT)"
    (tmp_path / "pressed.py").write_text(press)
    code = f"""
import signal, time
signal.signal(signal.SIGINT, signal.default_int_handler)
from omnijax import cli
from omnijax.cli import _frame
class Pressed:
    def __del__(self):
        {press}
def work(tokens):
    {lost}
    for _ in range(10):
        time.sleep(0.05)
    print("worked on")
_frame.build_app = lambda: work
cli.main()
"""
    command = [sys.executable, "-c", code]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "Interrupted. Nothing more was written.\n"


def test_init_then_check(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert call(capsys, "init")[0] == 0
    text = (tmp_path / "rig.toml").read_text(encoding="utf-8")
    code, _, err = call(capsys, "init")
    assert code == 2 and "rig.toml: exists already" in err
    (tmp_path / "rig.toml").write_text("mine")
    assert call(capsys, "init", "rig.toml", "--force")[0] == 0
    assert (tmp_path / "rig.toml").read_text(encoding="utf-8") == text
    code, out, _ = call(capsys, "check", "rig.toml")
    assert code == 0 and "rig.toml: right. 3 wheels." in out
    code, _, err = call(capsys, "init", "rig.toml/where.toml")
    assert code == 2 and "rig.toml/where.toml: cannot be written: " in err


def test_check_says_what_the_machine_is(capsys):
    code, out, _ = call(capsys, "check", "atlas")
    assert code == 0
    assert "0.407338" in out  # mm, the paper's gap depth
    assert "10.75 kg" in out and "188.208" in out and "natural frequencies" in out


def test_check_for_machines(capsys, tmp_path):
    code, out, _ = call(capsys, "check", "atlas", "--json")
    summary = json.loads(out)
    assert code == 0 and summary["ok"] and summary["driven_axes"] == 3
    assert summary["wheels"][0]["gap_depth"] == pytest.approx(4.0734e-4, rel=1e-4)
    bad = tmp_path / "bad.toml"
    bad.write_text("[sphere]\nradius = -1\n")
    code, out, _ = call(capsys, "check", str(bad), "--json")
    answer = json.loads(out)
    assert code == 2 and not answer["ok"] and len(answer["problems"]) == 5
    code, out, err = call(capsys, "check", str(bad))
    assert (code, out) == (2, "") and err.splitlines() == answer["problems"]


def test_two_wheels_leave_an_axis_free(tmp_path, capsys):
    call(capsys, "init", str(tmp_path / "rig.toml"))
    text = (tmp_path / "rig.toml").read_text(encoding="utf-8")
    head, w1, w2, rest = text.split("[[wheel]]")
    tail = rest[rest.index("# [[effect]]") :]
    (tmp_path / "two.toml").write_text("[[wheel]]".join([head, w1, w2]) + tail, encoding="utf-8")
    code, out, _ = call(capsys, "check", str(tmp_path / "two.toml"))
    assert code == 0
    assert (
        "The wheels drive 2 of 3 rotation axes; the sphere turns freely about the other:"
        in " ".join(out.split())
    )
    assert "The contacts hold the sphere in 2 of 3 directions" in out


def test_three_wheels_of_which_two_touch_at_one_place_are_warned_of(tmp_path, capsys):
    """Nothing but "right" stood out: that an axis is free and nothing holds the sphere was said so
    quietly as of two wheels, where it cannot be otherwise."""
    call(capsys, "init", str(tmp_path / "rig.toml"))
    good = call(capsys, "check", str(tmp_path / "rig.toml"))[1]
    assert "at one place" not in good and "of 3" not in good
    text = (tmp_path / "rig.toml").read_text(encoding="utf-8")
    w2, as_w1 = "normal = [0, 1, 0]\ndrive = [1, 0, 0]", "normal = [1, 0, 0]\ndrive = [0, 0, 1]"
    same = text.replace(w2, as_w1)
    (tmp_path / "same.toml").write_text(same, encoding="utf-8")
    code, out, _ = call(capsys, "check", str(tmp_path / "same.toml"))
    out = " ".join(out.split())
    assert same != text and code == 0
    assert "warning: w1 and w2 touch the sphere at one place" in out
    assert "warning: the wheels drive 2 of 3 rotation axes" in out
    assert "warning: the contacts hold the sphere in 2 of 3 directions" in out


def test_effects_lists_every_law(capsys):
    code, out, _ = call(capsys, "effects", "--json")
    rows = {row["id"]: row for row in json.loads(out)}
    assert code == 0 and list(rows) == list(EFFECTS)
    assert rows["wheel-runout"]["parameters"]["amplitude"]["unit"] == "m"
    said = ("formula", "words", "port", "places")
    assert all(row[key] for row in rows.values() for key in said)
    code, out, _ = call(capsys, "effects")
    assert code == 0 and all(name in out for name in EFFECTS)
    told = " ".join(out.split())
    assert all(" ".join(law.formula.split()) in told for law in EFFECTS.values())


@pytest.mark.parametrize("name", EFFECTS)
def test_the_block_that_an_effect_prints_can_be_pasted(name, capsys):
    """At its first place and numbers it is an effect of a rig file, and `check` finds no fault."""
    code, out, _ = call(capsys, "effects", name)
    text = rig_text(load_rig("atlas")) + out[out.index("[[effect]]") :]
    assert code == 0 and parse_rig(tomllib.loads(text)).effects[0].law.id == name


def test_schema_is_json(capsys):
    code, out, _ = call(capsys, "schema")
    assert code == 0 and json.loads(out)["title"] == "omnijax rig file"


def test_completion_scripts_know_the_commands():
    script = build_app().generate_completion(shell="bash")
    assert all(name in script for name in NAMES)


def test_a_missing_extra_is_named_with_its_command():
    with pytest.raises(InputError, match=r"`no_such_reader`.*pip install 'omnijax\[measured\]'"):
        require("no_such_reader", "measured")
    assert require("json", "measured") is json


def test_json_holds_no_nan(capsys):
    from omnijax.cli._inputs.options import emit

    emit(True, {"a": [float("nan"), 1.0], "b": {"c": float("inf")}, "d": (1, "x", None, True)}, str)
    assert json.loads(capsys.readouterr().out, parse_constant=pytest.fail) == {
        "a": [None, 1.0], "b": {"c": None}, "d": [1, "x", None, True],
    }  # fmt: skip
