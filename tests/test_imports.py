"""One-way imports, and a package and a help text that do not wait for jax."""

import ast
import importlib
import inspect
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import omnijax

ROOT = Path(omnijax.__file__).parent
ORDER = omnijax._PACKAGES  # from left to right: a package imports from itself and to its left


@pytest.mark.parametrize("package", ORDER)
def test_imports_go_one_way(package):
    helpers = {path.stem for path in ROOT.glob("_*.py")}  # of the root: they import no package
    allowed = {*ORDER[: ORDER.index(package) + 1], *helpers, "__version__"}
    for file in (ROOT / package).rglob("*.py"):
        depth = len(file.relative_to(ROOT).parts)  # of dots that reach the root
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.ImportFrom) and node.level == depth:
                names = [node.module.split(".")[0]] if node.module else [a.name for a in node.names]
            elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("omnijax."):
                names = [node.module.split(".")[1]] if node.level == 0 and node.module else []
            assert set(names) <= allowed, f"{file}:{node.lineno} imports {names}"


def _folder(parts: list[str]) -> list[str]:
    """The package of a dotted name below the root: itself where it is a folder."""
    return parts if (ROOT.joinpath(*parts)).is_dir() else parts[:-1]


def _imported(file: Path):
    """Every import of the package's own by `file`: the module's parts below the root, and line."""
    own = list(file.relative_to(ROOT).parent.parts)
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = own[: len(own) - node.level + 1]
            yield [*base, *(node.module.split(".") if node.module else [])], node.lineno
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "omnijax":
            yield (node.module or "").split(".")[1:], node.lineno


def past_a_face(importer: list[str], module: list[str]) -> bool:
    """Whether a file of the folder `importer` takes `module` from behind another folder's face."""
    shared = 0
    while shared < min(len(importer), len(module)) and importer[shared] == module[shared]:
        shared += 1
    inside = _folder(module)
    # a file of the own folder or of one around it, or the face of the first folder not shared
    return len(inside) > shared and len(module) > shared + 1


@pytest.mark.parametrize("package", ORDER)
def test_nobody_imports_past_a_face(package):
    for file in (ROOT / package).rglob("*.py"):
        for module, line in _imported(file):
            own = list(file.relative_to(ROOT).parent.parts)
            assert not past_a_face(own, module), f"{file}:{line} imports {'.'.join(module)}"


def test_the_search_of_the_diagnosis_knows_no_sphere():
    """It takes laws at places and the room's numbers, neither rigs nor what predicts their runs."""
    own, seen = ["diagnosis", "_search"], set()
    for file in ROOT.joinpath(*own).rglob("*.py"):
        seen |= {tuple(module) for module, _ in _imported(file) if module[:2] != own}
    packages = {module[0] for module in seen} & {*ORDER}
    rooms = {module for module in seen if ROOT.joinpath(*module).is_dir() and len(module) > 1}
    rooms -= {("diagnosis", "_settings")}  # the numbers
    assert ("laws",) in seen
    assert packages == {"laws", "machine", "diagnosis"}
    assert not rooms


def test_the_faces_are_seen():
    assert past_a_face(["study"], ["rig", "_load"])
    assert past_a_face(["study", "_design"], ["study", "_sweep", "store"])
    assert not past_a_face(["study", "_design"], ["study", "_sweep"])
    assert not past_a_face(["study", "_design"], ["study", "_points"])
    assert not past_a_face(["study", "_design"], ["rig"])
    assert not past_a_face(["cli"], ["_errors"])


def test_helpers_of_the_root_import_no_package():
    for file in set(ROOT.glob("_*.py")) - {ROOT / "__main__.py"}:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                assert (node.module or "").split(".")[0] not in ORDER, f"{file}:{node.lineno}"


def test_contributors_are_told_the_order():
    page = (ROOT.parent / "CONTRIBUTING.md").read_text(encoding="utf-8")
    (told,) = (text for text in page.split("\n\n") if " → " in text)
    assert tuple(re.findall(r"`(\w+)`", told)) == ORDER


def test_the_order_names_every_package():
    assert {path.parent.name for path in ROOT.glob("*/__init__.py")} == set(ORDER)


@pytest.mark.parametrize(
    "code",
    [
        "import omnijax; dir(omnijax)",
        "import omnijax.cli; omnijax.cli.run(['--help'])",
        "import omnijax.cli; omnijax.cli.run(['sweep', '--help'])",
        "import omnijax.cli; omnijax.cli.run(['--version'])",
        "import omnijax.cli; omnijax.cli.run(['check', 'nowhere.toml'])",
        "import omnijax.cli; omnijax.cli.run(['simulate', 'nowhere.toml', '--speed', '1'])",
        "import omnijax.cli; omnijax.cli.run(['design', 'nowhere.toml'])",
        "import omnijax.cli; omnijax.cli.run(['sweep-status', 'nowhere.zarr'])",
        "import omnijax.cli; omnijax.cli.run(['export', 'nowhere.zarr', 'x.csv'])",
        "import omnijax.cli; omnijax.cli.run(['replay', 'nowhere.nc'])",
        "import omnijax.cli; omnijax.cli.run(['diagnose', 'nowhere'])",
    ],
)
def test_no_jax_before_it_is_needed(code):
    slow = "{'jax', 'numpy', 'pint', 'matplotlib'} & set(sys.modules)"
    result = subprocess.run(
        [sys.executable, "-c", f"import sys; {code}; sys.exit(str({slow}) if {slow} else 0)"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr


def test_public_names_are_there():
    for name in omnijax._WHERE:
        assert getattr(omnijax, name) is not None
    assert {"load_rig", "simulate", "rig"} <= set(dir(omnijax))
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        getattr(omnijax, "simulat")  # noqa: B009


def test_editors_see_every_public_name():
    """`__init__.pyi` says what `_EXPORTS` and `_PACKAGES` do: names are imported on first use."""
    seen, others = set(), []
    for node in ast.parse((ROOT / "__init__.pyi").read_text(encoding="utf-8")).body[1:]:
        if isinstance(node, ast.ImportFrom):
            seen |= {(node.module, alias.name, alias.asname) for alias in node.names}
        else:
            others.append(ast.unparse(node))
    table = {(package, name, name) for name, package in omnijax._WHERE.items()}
    assert seen == table | {(None, package, package) for package in ORDER}
    assert others == ["__version__: str"]


def _files_of(file: Path) -> set[Path]:
    """Files of omnijax that `file` imports anywhere in it: in functions and for types too."""
    own, out = list(file.relative_to(ROOT).parent.parts), set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.ImportFrom):
            continue
        module = (node.module or "").split(".") if node.module else []
        if node.level:
            base = [*own[: len(own) - node.level + 1], *module]
        elif module and module[0] == "omnijax":
            base = module[1:]
        else:
            continue
        for name in node.names:
            place = ROOT.joinpath(*base)
            names = (place / f"{name.name}.py", place / name.name / "__init__.py")
            places = (*names, place.with_suffix(".py"), place / "__init__.py")
            out |= {next(p for p in places if p.exists())}
    return out - {file}


def in_circles(imports: dict[Any, set]) -> set:
    """Who reaches itself, or lies between such: what is left when both ends are taken off."""
    left = dict(imports)
    while True:
        needed = set().union(*left.values())
        ends = {k for k, uses in left.items() if not uses & left.keys() or k not in needed}
        if not ends:
            return {*left}
        left = {k: uses for k, uses in left.items() if k not in ends}


def test_no_file_imports_itself_by_way_of_others():
    imports = {file: _files_of(file) for file in ROOT.rglob("*.py")}
    assert sum(map(len, imports.values())) > 1000
    assert not in_circles(imports)
    assert in_circles({1: {2}, 2: {3}, 3: {2, 4}, 4: set()}) == {2, 3}


INSIDE = {  # what benchmarks take from behind a face, and why
    "benchmarks/machine.py": {
        "_compiling": "compiles its own program, RMS and peak alone, as sweeps of many designs do",
    },
    "benchmarks/scaling.py": {
        "study._sweep.evaluator": "times one step of a sweep: which arrays a design's store has",
        "study._sweep.store": "times one step of a sweep: writing a chunk",
    },
    "benchmarks/hidden_effects/coverage.py": {
        "diagnosis._search": "counts how often the limits of one step of a diagnosis hold",
    },
    "benchmarks/hidden_effects/thresholds.py": {
        "diagnosis._settings": "varies the thresholds, which are no user's",
    },
}


@pytest.mark.parametrize("folder", ["experiments", "benchmarks"])
def test_studies_use_public_faces(folder):
    """Experiments show what a user can write; a benchmark that measures an inner step says why."""
    files = list((ROOT.parent / folder).rglob("*.py"))
    assert len(files) > 10
    for file in files:
        taken = set()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                taken |= {x.name for x in node.names if x.name.split(".")[0] == "omnijax"}
            elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("omnijax"):
                taken |= {f"{node.module}.{x.name}" for x in node.names}
        private = {x.partition(".")[2] for x in taken if "._" in x}
        known = INSIDE.get(file.relative_to(ROOT.parent).as_posix(), {})
        assert {x.rpartition(".")[0] for x in private} == known.keys(), file


@pytest.mark.parametrize("folder", ["experiments", "benchmarks"])
def test_what_the_studies_call_of_a_package_is_there(folder):
    """Most of them run in the full suite alone: a name that has gone would be noticed late."""
    known = 0
    for file in (ROOT.parent / folder).rglob("*.py"):
        tree, modules = ast.parse(file.read_text(encoding="utf-8")), {"omnijax": omnijax}
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("omnijax"):
                home = importlib.import_module(str(node.module))
                for one in node.names:
                    assert hasattr(home, one.name), f"{file}:{node.lineno} {one.name}"
                    if inspect.ismodule(value := getattr(home, one.name)):
                        modules[one.asname or one.name] = value
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                home = modules.get(node.value.id)
                known += home is not None
                assert home is None or hasattr(home, node.attr), f"{file}:{node.lineno} {node.attr}"
    assert known
