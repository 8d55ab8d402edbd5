"""Every command that the documentation shows is one that the command line understands."""

import re
import shlex
from pathlib import Path

import pytest

from omnijax.cli import build_app

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def _commands():
    for page in PAGES:
        if "_build" in page.parts:
            continue
        text = page.read_text().replace("\\\n", " ")
        for shown in re.findall(r"^\$ omnijax (.+)$", text, re.M):
            command = re.split(r"\s#\s|\s>\s", shown)[0]
            yield pytest.param(command, id=f"{page.stem}: {command}")


@pytest.mark.parametrize("command", list(_commands()))
def test_documented_command_parses(command):
    tokens = shlex.split(command)
    _, _, unused, *_ = build_app().parse_known_args(tokens)
    assert not unused, f"unknown: {unused}"


DRIVES = {"--speed", "--omega", "--torque", "--drive"}


def test_a_documented_run_of_a_rig_says_how_its_wheels_turn():
    asked = [shlex.split(param.values[0]) for param in _commands()]
    driven = [x for x in asked if x[0] in ("simulate", "sweep", "sensitivity")]
    driven = [x for x in driven if x[1] != "study.toml"]  # which brings its own
    assert len(driven) > 10
    assert [x for x in driven if not DRIVES & {word.partition("=")[0] for word in x}] == []


def test_the_documentation_shows_commands():
    assert len(list(_commands())) >= 10


def test_help_of_every_command_has_an_example():
    from omnijax.cli import COMMANDS

    app = build_app()
    for names in COMMANDS.values():
        for name in names:
            assert f"Example: omnijax {name}" in (app[name].help or ""), name
