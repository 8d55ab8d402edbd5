"""Numbers that steer a diagnosis stand in one frozen object, each with where it comes from."""

import ast
import dataclasses
import io
import re
import tokenize
from pathlib import Path

import numpy as np
import pytest

import omnijax.diagnosis
from omnijax.diagnosis._answer.unlisted import TOLERANCES
from omnijax.diagnosis._settings import SETTINGS

FOLDER = Path(omnijax.diagnosis.__file__).parent
SECTIONS = FOLDER / "_settings"
# where a number comes from, after a colon or alone; the face of the folder says what each means
WORDS = ("derived", "required", "prototype", "own cases", "measured", "time", "memory", "rounding",
         "convention", "chosen")  # fmt: skip
SAID = re.compile(rf"(?:^|: )(?:{'|'.join(WORDS)})(?=$| \(|, )", re.MULTILINE)
# axes, halves and squares; the directions of a channel, and the channels of two or three
USUAL = {0, 1, 2, 3, 4, 6, 9, 0.5}
GIVEN_BY_NAME = {0, 1, 2, 0.5}  # `rounds=4` is no axis
ROUNDING, NO_NUMBER = 1e-7, 1e9  # what double precision leaves of one, and what stands for infinity
ELSEWHERE = {  # what changes no answer: time, memory, seeds, pictures; formulas; and tables' kinds
    "_answer/_learned/shapes.py": {5},  # of spherical harmonics
    "_answer/pictures.py": {0.2, 0.26, 0.38, 0.9, 3, 100},
    "_answer/sizes.py": {"POINTS"},
    "_machine/_noise/encoders.py": {"CHUNK", 16},
    # the series of phi functions, and where it serves; tables kept
    "_machine/_elastic/modes.py": {1e-3, 3, 24, 120, "KEPT"},
    "_machine/machine.py": {"LINEAR", "READINGS", "TABLES"},
    "_machine/_where/shaft_lines.py": {"TOGETHER"},
    "_machine/_preparation/outliers.py": {5},  # times that are printed
    "_machine/_candidates/recipes.py": {1.5},  # of P2
    "_machine/rig_model.py": {"TOGETHER"},
    "_machine/stage_cache.py": {"ASIDE", "MOST"},
    "_machine/_elastic/stepped.py": {"BLOCK", "LANES"},
    "_machine/_signatures/tangents.py": {"LANES"},
    "_machine/tree_hash.py": {16},
    "_machine/_candidates/uncertain.py": {"POLE"},  # where a wheel has no azimuth
    "_noise.py": {12},  # variance of a rounded number
    "_ode/_rows/batches.py": {"PARTS"},
    "_ode/_rows/evaluation.py": {"LANES", "OFTEN", "FEW", "HANDFUL"},
    "_ode/_evidence/evidence.py": {100},  # per cent
    "_ode/_evidence/experiment.py": {5},  # "a fifth"
    "_ode/_rows/known.py": {8, 12},  # a difference of fourth order
    "_ode/_candidates/orders.py": {8, 64},  # orders that one product of matrices gives
    "_recursion.py": {"BLOCK", 64},  # samples of a call, and matrices that are kept
    "_room.py": {"TABLES", 8.0},
    "_search/calibration.py": {"SEED"},
    "_search/gauss_newton.py": {16},  # a difference from a half and a quarter of a step
    "_search/limits.py": {"SURE", "ONE_SIDED"},  # the normal law's
    "_search/scan.py": {"PIECE"},
    "_search/waves.py": {"FAR", "SEED", "TOGETHER", "TOLD"},
    "_search/where.py": {4},  # tables that are kept
}


class _Numbers(ast.NodeVisitor):
    """Numbers of a syntax tree but those of texts, of indices, of rounding and the `USUAL` ones."""

    def __init__(self):
        self.seen: set[float] = set()

    def visit_JoinedStr(self, node):
        """Texts show numbers in units of their own."""

    def visit_Subscript(self, node):
        """An index steers nothing."""
        self.visit(node.value)

    def visit_keyword(self, node):
        """`rounds=4`."""
        self._named(node.value)

    def visit_arguments(self, node):
        """`def f(rounds=4)`."""
        for default in (*node.defaults, *filter(None, node.kw_defaults)):
            self._named(default)

    def visit_Constant(self, node):
        """A number, or something else."""
        self._add(node.value, USUAL)

    def _named(self, node):
        if isinstance(node, ast.Constant):
            self._add(node.value, GIVEN_BY_NAME)
        else:
            self.visit(node)

    def _add(self, value, usual):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if number and value not in usual and ROUNDING < abs(value) < NO_NUMBER:
            self.seen.add(value)


def _numbers(source: str) -> set[str | float]:
    """Names that a module gives to numbers of its own, and numbers within its functions."""
    out: set[str | float] = set()
    for node in ast.parse(source).body:
        own = _Numbers()
        own.visit(node)
        if isinstance(node, ast.Assign) and (own.seen or _is_number(node.value)):
            out |= {x.id for t in node.targets for x in ast.walk(t) if isinstance(x, ast.Name)}
        else:
            out |= own.seen
    return out


def _is_number(node) -> bool:
    if isinstance(node, ast.Tuple):
        return bool(node.elts) and all(map(_is_number, node.elts))
    try:
        return isinstance(ast.literal_eval(node), int | float)
    except ValueError:
        return False


def test_modules_of_the_diagnosis_have_no_numbers_of_their_own():
    own = {
        str(path.relative_to(FOLDER)): names
        for path in FOLDER.rglob("*.py")
        if path.parent != SECTIONS and (names := _numbers(path.read_text()))
    }
    assert own == ELSEWHERE


@pytest.mark.parametrize(
    ("source", "numbers"),
    [
        ("A, B = 1, -2.5\nD = 2 / 16\nE = 'word'\nF = (0.1, 1e-3)", {"A", "B", "D", "F"}),
        ("G = {'x': 0.1}\nH = 10.0 ** np.arange(-4, 5.1)", {"G", "H"}),
        ("def f(x, rounds=7):\n    return g(x > 1.2, tries=4)", {7, 1.2, 4}),
        ("class A:\n    share: float = 0.3", {0.3}),
        ("def f(x, axis=1):\n    return x[:10] + 2 * x / 3 + max(x, 1e-300)", set()),
        ("def f(x):\n    return f'{1e3 * x:.3g} ms', x is True", set()),
    ],
)
def test_numbers_are_found(source, numbers):
    assert _numbers(source) == numbers


def test_settings_are_frozen_numbers():
    sections = [getattr(SETTINGS, field.name) for field in dataclasses.fields(SETTINGS)]
    for section in sections:
        for field in dataclasses.fields(section):
            value = getattr(section, field.name)
            assert np.all(np.isfinite(value)), (type(section).__name__, field.name)
            with pytest.raises(dataclasses.FrozenInstanceError):
                setattr(section, field.name, value)


def test_files_of_settings_hold_sections_of_numbers_and_nothing_else():
    for path in SECTIONS.glob("*.py"):
        _, *rest = ast.parse(path.read_text()).body  # its docstring
        assert [ast.unparse(x) for x in rest
                if not isinstance(x, ast.ClassDef | ast.Import | ast.ImportFrom)] == (
            ["SETTINGS = Settings()"] if path.name == "__init__.py" else []
        )  # fmt: skip
        inside = [x for c in rest if isinstance(c, ast.ClassDef) for x in c.body]
        assert all(isinstance(x, ast.AnnAssign | ast.Expr) for x in inside), path.name
    assert [*SECTIONS.rglob("*.py")] == [*SECTIONS.glob("*.py")]


def _comments(source: str) -> dict[int, tuple[str, bool]]:
    """By line the text of a comment, and whether it stands alone there."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    return {
        t.start[0]: (t.string.lstrip("# "), not t.line[: t.start[1]].strip())
        for t in tokens if t.type == tokenize.COMMENT
    }  # fmt: skip


def _sections(source: str) -> list[tuple[str, ast.AnnAssign]]:
    """(section, field) of every number in a file of settings."""
    out = []
    for node in (x for x in ast.parse(source).body if isinstance(x, ast.ClassDef)):
        fields = [x for x in node.body if isinstance(x, ast.AnnAssign)]
        numbers = [x for x in fields if not ast.unparse(x.annotation).endswith("Settings")]
        out += [(node.name, x) for x in numbers]
    return out


def _words(source: str) -> dict[str, str]:
    """By `section.field` of a file of settings what is said right above it, and beside it."""
    comments, out = _comments(source), {}
    for section, field in _sections(source):
        own = [comments[n][0] for n in range(field.lineno, (field.end_lineno or 0) + 1)
               if n in comments]  # fmt: skip
        line, over = field.lineno - 1, []
        while line in comments and comments[line][1]:
            over.insert(0, comments[line][0])
            line -= 1
        out[f"{section}.{ast.unparse(field.target)}"] = f"{' '.join(over)}\n{' '.join(own)}"
    return out


def test_every_number_says_where_it_comes_from():
    said = {}
    for path in SECTIONS.glob("*.py"):
        said |= _words(path.read_text())
    count = sum(len(dataclasses.fields(getattr(SETTINGS, f.name)))
                for f in dataclasses.fields(SETTINGS))  # fmt: skip
    assert len(said) == count > 400
    assert [name for name, text in said.items() if not SAID.search(text)] == []
    face = (SECTIONS / "__init__.py").read_text()
    assert [word for word in WORDS if f"- {word}" not in face] == []


@pytest.mark.parametrize(
    ("source", "unsaid"),
    [
        ("    x: int = 3  # steps: time\n    y: int = 4  # steps\n    z: int = 5", {"y", "z"}),
        (
            "    # of a run: chosen (more\n    # is noise)\n    x: float = 0.1\n    y: float = 0.2",
            {"y"},
        ),
        ("    # steps: time\n\n    x: int = 3", {"x"}),
        (
            "    x: int = 3  # time\n    y: int = 3  # sometimes\n    z: int = 3  # a: time it",
            {"y", "z"},
        ),
        ("    x: tuple[int, ...] = (\n        3,  # steps: time\n    )\n    y: bool = True", {"y"}),
        ("    x: int = 3  # steps\n    # of a run: chosen", {"x"}),
    ],
)
def test_a_number_without_a_word_is_seen(source, unsaid):
    said = _words(f"class A:\n{source}\n")
    assert {name for name, text in said.items() if not SAID.search(text)} == {
        f"A.{name}" for name in unsaid
    }


def _read(source: str) -> set[tuple[str, str]]:
    """(section, field) pairs `...section.field` of a module; `settings` is the search's."""
    out = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Attribute | ast.Name):
            owner = node.value
            section = owner.attr if isinstance(owner, ast.Attribute) else owner.id
            out.add(({"settings": "search"}.get(section, section), node.attr))
    return out


def test_every_number_is_read():
    read = set().union(
        *(_read(path.read_text()) for path in FOLDER.rglob("*.py") if path.parent != SECTIONS)
    )
    unread = {
        (section.name, field.name)
        for section in dataclasses.fields(SETTINGS)
        for field in dataclasses.fields(getattr(SETTINGS, section.name))
        if (section.name, field.name) not in read
    }
    by_name = {path.replace(".", "_") for path in TOLERANCES}  # these are read all at once
    assert unread == {("unlisted", name) for name in by_name}
    assert ("search", "unheard") not in read and ("fit", "prior_step") in read
