"""What a law file declares, read from its text: nothing of it is run."""

import ast
import math
from pathlib import Path
from typing import Any, NamedTuple

from .. import laws
from .._errors import InputError
from .._reading import TEXT, read_bytes
from ..laws import Parameter

_NO_VALUE = (ValueError, TypeError, IndexError)  # of an expression: a name, -"w1", float()


class Declared(NamedTuple):
    """A law as its class declares it."""

    id: str
    port: str
    places: tuple[str, ...]
    parameters: dict[str, Parameter]


def declared_laws(path: Path) -> dict[str, Declared]:
    """The laws of a Python file by their id; `InputError` where the text is none of Python's."""
    try:
        tree = ast.parse(read_bytes(path, TEXT))
    except OSError as error:
        raise InputError(f"{path}: no such Python file of laws ({error.strerror}).") from None
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        said = getattr(error, "msg", None) or "it is nested too deeply or holds zero bytes"
        raise InputError(f"{path} is not Python: {said}.") from None
    laws = {}
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            said = _attributes(node)
            name = _literal(said.get("id"), None)
            if isinstance(name, str) and name:
                laws[name] = _law(path, name, node, said)
    if not laws:
        raise InputError(f"{path}: declares no law: no class of it has an `id`.")
    return laws


def _attributes(node: ast.ClassDef) -> dict[str, ast.expr]:
    attributes: dict[str, ast.expr] = {}
    for line in node.body:
        if isinstance(line, ast.AnnAssign) and isinstance(line.target, ast.Name) and line.value:
            attributes[line.target.id] = line.value
        elif isinstance(line, ast.Assign):
            attributes |= {t.id: line.value for t in line.targets if isinstance(t, ast.Name)}
    return attributes


def _law(path: Path, name: str, node: ast.ClassDef, said: dict[str, ast.expr]) -> Declared:
    base = next((b for b in map(_base, node.bases) if b is not None), None)
    if base is None:
        raise InputError(f"{path}: law `{name}` derives from no port of omnijax.laws.")
    given = said.get("parameters")
    if not isinstance(given, ast.Dict | None):
        raise InputError(f"{path}: law `{name}` must write its `parameters` out as a dict.")
    parameters = {}
    for key, value in zip(given.keys, given.values, strict=True) if given else ():
        label = _literal(key, None)
        if not isinstance(label, str):
            raise InputError(f"{path}: law `{name}` must name its `parameters` by texts.")
        parameters[label] = _parameter(path, name, label, value)
    places = _literal(said["places"], None) if "places" in said else base.places
    if not isinstance(places, tuple | list) or not all(isinstance(p, str) for p in places):
        raise InputError(f"{path}: law `{name}` must write its `places` out as a tuple of texts.")
    if not _has_formula(node, said):
        raise InputError(f"{path}: law `{name}` has no formula: give it `__call__(self, signal)`.")
    return Declared(name, str(_literal(said.get("port"), base.port)), tuple(places), parameters)


def _has_formula(node: ast.ClassDef, said: dict[str, ast.expr]) -> bool:
    """Whether the class, or one that it derives from, may have a `__call__`."""
    bases = [_base(b) for b in node.bases]
    inherited = any(b is None or b.__call__ is not laws.AbstractLaw.__call__ for b in bases)
    written = (x.name for x in ast.walk(node) if isinstance(x, ast.FunctionDef))
    return inherited or "__call__" in said or "__call__" in written


def _base(node: ast.expr) -> type[laws.AbstractLaw] | None:
    name = node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")
    port = getattr(laws, name, None)
    return port if isinstance(port, type) and issubclass(port, laws.AbstractLaw) else None


def _parameter(path: Path, law: str, name: str, node: ast.expr) -> Parameter:
    if isinstance(node, ast.Call) and not any(isinstance(a, ast.Starred) for a in node.args):
        try:
            values = [_value(a) for a in node.args]
            named = {str(k.arg): _value(k.value) for k in node.keywords}
            return Parameter(*values, **named)
        except _NO_VALUE:
            pass
    raise InputError(f"{path}: law `{law}` must write `{name}` out as Parameter(unit, ...).")


def _literal(node: ast.expr | None, default: Any) -> Any:
    try:
        return default if node is None else _value(node)
    except _NO_VALUE:
        return default


def _value(node: ast.expr) -> Any:
    """A literal, an infinity (`math.inf`, `-jnp.inf`, `float("inf")`) or `ANY_LENGTH`."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return -_value(node.operand)
    if isinstance(node, ast.Attribute) and node.attr == "inf":
        return math.inf
    if "ANY_LENGTH" in (getattr(node, "id", ""), getattr(node, "attr", "")):
        return laws.ANY_LENGTH
    if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "float":
        return float(ast.literal_eval(node.args[0]))
    return ast.literal_eval(node)
