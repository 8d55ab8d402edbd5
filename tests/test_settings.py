"""Numbers that steer a diagnosis stand in one frozen object."""

import ast
import dataclasses
from pathlib import Path

import numpy as np
import pytest

import omnijax.diagnosis
from omnijax.diagnosis._settings import SETTINGS

FOLDER = Path(omnijax.diagnosis.__file__).parent
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
    "_machine/machine.py": {"READINGS", "TABLES"},
    "_machine/_where/orders.py": {"TOGETHER"},
    "_machine/_preparation/outliers.py": {5},  # times that are printed
    "_machine/_candidates/recipes.py": {1.5},  # of P2
    "_machine/rig_model.py": {"TOGETHER"},
    "_machine/stage_cache.py": {"ASIDE", "MOST"},
    "_machine/_elastic/stepped.py": {"BLOCK", "LANES"},
    "_machine/_signatures/tangents.py": {"LANES"},
    "_machine/tree_hash.py": {16},
    "_machine/_candidates/uncertain.py": {"POLE"},  # where a wheel has no azimuth
    "_noise.py": {12},  # variance of a rounded number
    "_ode/batches.py": {"PARTS"},
    "_ode/evaluation.py": {"LANES", "OFTEN", "FEW", "HANDFUL"},
    "_ode/evidence.py": {100},  # per cent
    "_ode/experiment.py": {5},  # "a fifth"
    "_ode/known.py": {8, 12},  # a difference of fourth order
    "_ode/orders.py": {8, 64},  # orders that one product of matrices gives
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
        if path.name != "_settings.py" and (names := _numbers(path.read_text()))
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
