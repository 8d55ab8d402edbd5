"""Names: a class's stands for one thing in the whole tree, and a variable's says what it holds."""

import ast
from collections import Counter
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "omnijax"
TREES = {path: ast.parse(path.read_text(encoding="utf-8")) for path in PACKAGE.rglob("*.py")}
SAYS_NOTHING = {"found", "thing", "stuff", "tmp", "foo", "res", "obj"}


def test_a_class_name_stands_for_one_class():
    names = Counter(
        node.name for tree in TREES.values() for node in tree.body if isinstance(node, ast.ClassDef)
    )
    assert len(names) > 300
    assert [name for name, count in names.items() if count > 1] == []


def test_variables_say_what_they_hold():
    named = {
        f"{path.relative_to(PACKAGE)}: {name}"
        for path, tree in TREES.items()
        for node in ast.walk(tree)
        for name in [getattr(node, "id", None) or getattr(node, "arg", None)]
        if isinstance(node, ast.Name | ast.arg) and name in SAYS_NOTHING
    }
    assert named == set()
