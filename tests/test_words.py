"""Names: a class's stands for one thing in the whole tree, and a variable's says what it holds."""

import ast
import re
from collections import Counter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "omnijax"
SAYS_NOTHING = {"found", "thing", "stuff", "tmp", "foo", "res", "obj"}


@pytest.fixture(scope="module")
def trees():
    """Every module, parsed."""
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in PACKAGE.rglob("*.py")}


def test_a_class_name_stands_for_one_class(trees):
    names = Counter(
        node.name for tree in trees.values() for node in tree.body if isinstance(node, ast.ClassDef)
    )
    assert len(names) > 300
    assert [name for name, count in names.items() if count > 1] == []


def test_variables_say_what_they_hold(trees):
    named = {
        f"{path.relative_to(PACKAGE)}: {name}"
        for path, tree in trees.items()
        for node in ast.walk(tree)
        for name in [getattr(node, "id", None) or getattr(node, "arg", None)]
        if isinstance(node, ast.Name | ast.arg) and name in SAYS_NOTHING
    }
    assert named == set()


def test_private_names_in_backticks_exist():
    """A module or function that was renamed is renamed in what is written about it too."""
    names = {word for path in PACKAGE.rglob("*.py") for word in
             re.findall(r"\b_\w+", re.sub(r"`[^`\n]*`", "", path.read_text(encoding="utf-8")))} | {
        part for path in PACKAGE.rglob("*") for part in (path.name, path.stem)
    }  # fmt: skip
    gone = {
        f"{path.relative_to(PACKAGE)}: {quoted}"
        for path in PACKAGE.rglob("*.py")
        for quoted in re.findall(r"`([\w./]+)`", path.read_text(encoding="utf-8"))
        for part in re.split(r"[/.]", quoted)
        if re.fullmatch(r"_[a-z]\w*", part) and part not in names
    }
    assert gone == set()


def test_files_in_backticks_exist():
    root = PACKAGE.parent
    files = {p.relative_to(root).as_posix() for folder in ("omnijax", "tests", "benchmarks", "docs")
             for p in (root / folder).rglob("*")}  # fmt: skip
    gone = {
        f"{path.relative_to(PACKAGE)}: {quoted}"
        for path in PACKAGE.rglob("*.py")
        for quoted in re.findall(r"`([\w/]+\.py)`", path.read_text(encoding="utf-8"))
        if not any(file == quoted or file.endswith(f"/{quoted}") for file in files)
    }
    assert gone == set()
