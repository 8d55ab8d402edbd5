"""Law files are programs: none runs before the user has allowed its content."""

from pathlib import Path

import pytest

from omnijax import InputError, load_laws, load_rig
from omnijax.cli import run
from omnijax.rig import bundled_rigs

pytestmark = pytest.mark.brief

LAW = '''
from typing import ClassVar
import jax.numpy as jnp
from jaxtyping import Array, Float
from omnijax.laws import AbstractMount, Parameter
open("RAN", "w").close()  # a mark of its having run

class Damper(AbstractMount):
    """Mount tension += d rate."""
    d: Float[Array, ""]
    id: ClassVar[str] = "my-damper"
    places: ClassVar[tuple[str, ...]] = ("wheel", "all")
    parameters: ClassVar[dict[str, Parameter]] = {"d": Parameter("N s/m", low=0, linear=True)}
    def __call__(self, signal, state=None):
        return self.d * signal.rate
'''
EFFECT = '\n[[effect]]\nid = "my-damper"\nlaw = "law.py"\nplace = "w1"\nparameters = { d = 3.0 }\n'
SHORT = ("--speed", "1,1.2,0.3", "--duration", "0.1s")


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("OMNIJAX_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.setenv("OMNIJAX_TRUSTED_LAWS", "")
    monkeypatch.setattr("omnijax.rig._user_laws._LOADED", {})
    text = bundled_rigs()["atlas"].read_text(encoding="utf-8")
    Path("rig.toml").write_text(text + EFFECT, encoding="utf-8")
    Path("law.py").write_text(LAW)
    return tmp_path


def test_a_rigs_law_runs_only_once_it_is_allowed(here, capsys, monkeypatch):
    words = ["simulate", "rig.toml", *SHORT, "--out", "run.nc"]
    assert run(words) == 2 and not Path("RAN").exists()
    assert (
        "law.py is a program, and is run only after you have allowed it" in capsys.readouterr().err
    )
    with pytest.raises(InputError, match="is a program"):
        load_rig("rig.toml")
    assert run([*words, "--trust-laws"]) == 0 and Path("RAN").exists()
    forget(monkeypatch)
    for looks, code in ((["replay", "run.nc"], 0), (["orders", "run.nc"], 2)):  # too short a run
        assert run(looks) == code, capsys.readouterr().err  # a stored run is data
    assert not Path("RAN").exists()


def test_check_reads_the_declaration_alone(here, capsys):
    assert run(["check", "rig.toml"]) == 0 and not Path("RAN").exists()
    assert "not run: my-damper at w1, a law in law.py" in capsys.readouterr().out
    for wrong, said in (
        (EFFECT.replace("3.0", "-3.0"), "`effect.my-damper.w1.d` must lie in [0, inf)"),
        (EFFECT.replace("d = 3.0", "e = 3.0"), "`effect.my-damper.w1.e` is not a parameter"),
        (EFFECT.replace("w1", "w9"), "`effect.my-damper.place` must be one of"),
    ):
        text = bundled_rigs()["atlas"].read_text(encoding="utf-8")
        Path("other.toml").write_text(text + wrong, encoding="utf-8")
        assert run(["check", "other.toml"]) == 2 and said in capsys.readouterr().err
    assert not Path("RAN").exists()


def test_a_yes_at_the_terminal_is_kept_for_the_content(here, monkeypatch, capsys):
    class Terminal:
        def __init__(self, answer):
            self.answer = answer

        def isatty(self):
            return True

        def readline(self):
            return self.answer

    import sys

    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    performed = []

    def perform(*_, **__):
        performed.append(True)
        raise InputError("asked.")

    for answer, ran in (("\n", False), ("n\n", False), ("y\n", True)):
        monkeypatch.setattr(sys, "stdin", Terminal(answer))
        with monkeypatch.context() as patch:
            patch.setattr("omnijax.cli._simulate.perform", perform)
            assert run(["simulate", "rig.toml", *SHORT]) == 2
        assert bool(performed) is ran and Path("RAN").exists() is ran
    forget(monkeypatch)
    monkeypatch.setattr(sys, "stdin", Terminal(""))
    assert len(load_rig("rig.toml").effects) == 1  # the content is known
    Path("law.py").write_text(LAW + "# changed\n")
    assert run(["simulate", "rig.toml", *SHORT]) == 2  # another content is another program


def forget(monkeypatch):
    """As in a new process."""
    Path("RAN").unlink(missing_ok=True)
    monkeypatch.setenv("OMNIJAX_TRUSTED_LAWS", "")
    monkeypatch.setattr("omnijax.rig._user_laws._LOADED", {})


def test_byte_code_beside_a_law_is_not_looked_at(here):
    import importlib.util
    import py_compile

    Path("other.py").write_text("open('POISONED', 'w').close()")
    cached = importlib.util.cache_from_source("law.py")
    py_compile.compile(
        "other.py", cfile=cached, invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH
    )
    load_laws("law.py")
    assert Path("RAN").exists() and not Path("POISONED").exists()


WRONG = {
    "ends the process": ("import sys; sys.exit(0)", "cannot be run: SystemExit"),
    "never ends": ("while True: pass", "it did not end within"),
    "an id that is no text": (LAW.replace('"my-damper"', "3"), "must be text, but is 3"),
    "no parameters": (
        LAW.replace('{"d": Parameter("N s/m", low=0, linear=True)}', "None"),
        "`parameters` must",
    ),
    "other fields": (LAW.replace('{"d": P', '{"e": P'), "its fields and `parameters` differ: d, e"),
    "no Python": ("class (", "cannot be run: SyntaxError"),
}


@pytest.mark.parametrize("kind", WRONG)
def test_a_wrong_law_file_is_one_sentence(here, monkeypatch, kind):
    text, said = WRONG[kind]
    monkeypatch.setattr("omnijax.laws._library.RUN_LIMIT", 0.5)
    Path("law.py").write_text(text)
    with pytest.raises(InputError, match=said.replace("(", r"\(")):
        load_laws("law.py")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("return self.d * signal.speed", "law.py, line 15: AttributeError: 'MountSignal' object"),
        ("return self.d * signal.rate, 0", "law `my-damper` must return one number at its port"),
        ("return None", "law `my-damper` must return one number at its port `mount`"),
    ],
)
def test_a_law_that_fails_in_the_run_is_one_sentence(here, capsys, line, said):
    Path("law.py").write_text(LAW.replace("return self.d * signal.rate", line))
    assert run(["simulate", "rig.toml", *SHORT, "--trust-laws"]) == 2
    (error,) = capsys.readouterr().err.strip().splitlines()[-1:]
    assert said in error
