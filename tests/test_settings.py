"""Numbers that steer a diagnosis stand in one frozen object."""

import ast
import dataclasses
from pathlib import Path

import numpy as np
import pytest

import omnijax.diagnosis
from omnijax.diagnosis._settings import SETTINGS

FOLDER = Path(omnijax.diagnosis.__file__).parent
ELSEWHERE = {  # numbers that change no answer: time, memory, seeds, pictures; and tables' kinds
    "_answer/sizes.py": {"POINTS"},
    "_machine/encoders.py": {"CHUNK"},
    "_machine/orders.py": {"TOGETHER"},
    "_machine/rig_model.py": {"TOGETHER"},
    "_machine/stage_cache.py": {"ASIDE", "MOST"},
    "_machine/stepped.py": {"BLOCK", "LANES"},
    "_machine/tangents.py": {"LANES"},
    "_ode/batches.py": {"PARTS"},
    "_ode/evaluation.py": {"LANES", "OFTEN", "FEW", "HANDFUL"},
    "_room.py": {"TABLES"},
    "_search/calibration.py": {"SEED"},
    "_search/limits.py": {"SURE", "ONE_SIDED"},  # the normal law's
    "_search/scan.py": {"PIECE"},
    "_search/waves.py": {"FAR", "SEED"},
}


def _is_number(node) -> bool:
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) and not isinstance(node.value, bool)
    if isinstance(node, ast.Tuple):
        return bool(node.elts) and all(map(_is_number, node.elts))
    parts = {ast.UnaryOp: ("operand",), ast.BinOp: ("left", "right")}.get(type(node), ())
    return bool(parts) and all(_is_number(getattr(node, part)) for part in parts)


def _numbers(source: str) -> set[str]:
    """Names that a module gives to numbers of its own."""
    names = set()
    for node in ast.parse(source).body:
        if isinstance(node, ast.Assign) and _is_number(node.value):
            names |= {x.id for t in node.targets for x in ast.walk(t) if isinstance(x, ast.Name)}
    return names


def test_modules_of_the_diagnosis_have_no_numbers_of_their_own():
    own = {
        str(path.relative_to(FOLDER)): names
        for path in FOLDER.rglob("*.py")
        if path.name != "_settings.py" and (names := _numbers(path.read_text()))
    }
    assert own == ELSEWHERE
    assert _numbers("A, B = 1, -2.5\nC: int = 3\nD = 2 / 16\nE = 'word'\nF = (0.1, 1e-3)") == {
        "A", "B", "D", "F",
    }  # fmt: skip


def test_settings_are_frozen_numbers():
    sections = [getattr(SETTINGS, field.name) for field in dataclasses.fields(SETTINGS)]
    for section in sections:
        for field in dataclasses.fields(section):
            value = getattr(section, field.name)
            assert np.all(np.isfinite(value)), (type(section).__name__, field.name)
            with pytest.raises(dataclasses.FrozenInstanceError):
                setattr(section, field.name, value)
