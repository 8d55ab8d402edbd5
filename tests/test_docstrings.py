"""What a reader of `help(omnijax.NAME)` needs: what it is, its units, what it raises."""

import ast
import importlib
import inspect
import re
from pathlib import Path

import pytest

import omnijax

ROOT = {name: getattr(omnijax, name) for name in omnijax._WHERE}
CALLED = {n: x for n, x in ROOT.items() if inspect.isroutine(x) or hasattr(x, "__wrapped__")}
DATA = {"EFFECTS", "METRICS", "PROFILES"}  # tables: their entries say what they are
WITHOUT_NUMBERS = {"AbstractLaw", "Fault", "InputError", "bundled_rigs", "load_laws"}
UNIT = re.compile(r"\b(SI|rad|m|N|Hz|s|kg|rpm|units?)\b")


def text(name):
    return inspect.getdoc(ROOT[name]) or ""


@pytest.mark.parametrize("name", sorted(set(ROOT) - DATA))
def test_every_name_says_what_it_is_and_in_what_units(name):
    said = text(name)
    assert len(said.split(". ")[0]) > 20, said
    assert name in WITHOUT_NUMBERS or UNIT.search(said), said


@pytest.mark.parametrize("name", sorted(CALLED))
def test_every_function_says_what_it_raises(name):
    assert "Raises" in text(name)


SHAPED = [
    "Trajectory", "Rig", "Recording", "Study", "SteadyState", "Sensitivity", "Modes", "simulate",
    "sweep", "propagate", "speeds", "torques", "natural_frequencies",
]  # fmt: skip
SHAPE = re.compile(r"\((\w+,|\w+(, \w+)+|\w)\)")  # (t,), (t, 3), (n)


@pytest.mark.parametrize("name", SHAPED)
def test_what_holds_or_returns_arrays_names_shapes_and_units(name):
    said = text(name)
    assert SHAPE.search(said), said
    assert len(set(UNIT.findall(said))) > 1 or "SI" in said, said


def test_every_channel_of_a_run_is_described():
    said = text("Trajectory")
    assert {x for x in omnijax.Trajectory.UNITS if f"`{x}`" not in said} == set()


COMPUTING = [
    "simulate", "simulate_many", "propagate", "steady_state", "measured", "evaluate", "modes",
    "natural_frequencies", "order_track", "rpm_order_map", "sensitivity", "global_sensitivity",
    "design", "pareto", "tolerances", "diagnose", "noise_floor",
]  # fmt: skip


@pytest.mark.parametrize("name", COMPUTING)
def test_what_computes_names_its_source(name):
    assert re.search(r"Source: (.|\n){20}|\w+ (19|20)\d\d\b", text(name)), text(name)


def raised(function):
    """The exceptions that the function's own text raises."""
    tree = ast.parse(inspect.getsource(inspect.unwrap(function)).strip())
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            kind = ast.unparse(node.exc.func)
            if kind[0].isupper():  # not a function that makes one
                yield kind


@pytest.mark.parametrize("name", sorted(CALLED))
def test_what_a_function_raises_itself_is_named(name):
    assert all(kind in text(name) for kind in raised(CALLED[name]))


@pytest.mark.parametrize("package", omnijax._PACKAGES)
def test_every_name_of_a_face_says_what_it_is_and_what_it_raises(package):
    module = importlib.import_module(f"omnijax.{package}")
    silent, unsaid = set(), set()
    for name in (name for name in dir(module) if not name.startswith("_")):
        value = getattr(module, name)
        if inspect.isclass(value) or inspect.isroutine(value):
            said = vars(value).get("__doc__") if inspect.isclass(value) else inspect.getdoc(value)
            if not said or said.startswith(f"{name}("):  # a tuple's own words name its fields
                silent.add(name)
            if inspect.isfunction(inspect.unwrap(value)):
                unsaid |= {name for kind in raised(value) if kind not in (said or "")}
    assert not silent
    assert not unsaid


def test_the_page_lists_every_name_of_the_root():
    page = (Path(__file__).parents[1] / "docs" / "api.md").read_text(encoding="utf-8")
    table = page[: page.index("## Laws")]
    assert set(re.findall(r"`(\w+)`", table)) >= set(ROOT)
    for package in set(omnijax._WHERE.values()):
        assert f"automodule:: omnijax.{package}" in page


@pytest.mark.parametrize("package", omnijax._PACKAGES)
def test_every_package_lists_its_names_and_has_them(package):
    module = importlib.import_module(f"omnijax.{package}")
    names = [name for name in dir(module) if not name.startswith("_")]
    assert module.__doc__ and names
    assert all(hasattr(module, name) for name in names)
    with pytest.raises(AttributeError, match="no attribute 'nothing_of_this_name'"):
        module.nothing_of_this_name  # noqa: B018
