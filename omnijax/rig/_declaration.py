"""What a law file declares, read from its text: nothing of it is run."""

import ast
import itertools
import math
import operator
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from .. import laws
from .._errors import InputError
from .._reading import TEXT, read_bytes
from ..laws import Parameter

# of an expression: a name, -"w1", float(), 1 / 0, one that is nested too deeply
_NO_VALUE = (ValueError, TypeError, LookupError, ArithmeticError, RecursionError)
_OF_TWO = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul}
_OF_TWO |= {ast.Div: operator.truediv}
_UNREAD = object()  # an expression that is no plain value


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
    return _File(path).laws_of(tree)


class _Class(NamedTuple):
    """A class of the file, or the library's, with what it has from those that it derives from."""

    library: type[laws.AbstractLaw] | None  # the first of the library's classes above it
    said: dict[str, Any]  # what its lines assign
    fields: tuple[str, ...]
    defaults: frozenset[str]  # of them those that have one
    formula: bool
    own: dict[str, Any]  # of `said` what its own lines assign

    def attribute(self, name: str) -> Any:
        """What stands under `name`, the library's where the file says nothing; else `_UNREAD`."""
        return self.said.get(name, getattr(self.library, name, _UNREAD))


class _File:
    """What the lines of a law file's text have named so far."""

    def __init__(self, path: Path):
        self.path = path
        self.named: dict[str, Any] = {}  # classes and plain values

    def laws_of(self, tree: ast.Module) -> dict[str, Declared]:
        """The laws by their id; a law below another of the same id takes its place."""
        declared = {}
        for node in tree.body:
            if isinstance(node, ast.ImportFrom):
                names = ((x.asname, ast.Name(x.name)) for x in node.names if x.asname)
                self.named |= {new: self._read(name) for new, name in names}
            elif isinstance(node, ast.Assign | ast.AnnAssign):
                self.named |= self._assigned(node)
            elif isinstance(node, ast.ClassDef):
                read = self.named[node.name] = self._class(node)
                name = read.attribute("id")
                if isinstance(name, str) and name:
                    declared[name] = self._law(name, read)
        if not declared:
            raise InputError(f"{self.path}: declares no law: no class of it has an `id`.")
        return declared

    def _class(self, node: ast.ClassDef) -> _Class:
        said: dict[str, Any] = {}
        fields: list[str] = []
        defaults: set[str] = set()
        for line in node.body:
            if isinstance(line, ast.Assign | ast.AnnAssign):
                said |= self._assigned(line)
            if isinstance(line, ast.AnnAssign) and "ClassVar" not in ast.unparse(line.annotation):
                fields.append(ast.unparse(line.target))
                defaults |= set() if line.value is None else {fields[-1]}
        methods = (x.name for x in ast.walk(node) if isinstance(x, ast.FunctionDef))
        formula, library, own = "__call__" in said or "__call__" in methods, None, dict(said)
        for above in node.bases:
            base = self._read(above)
            if not isinstance(base, _Class):  # of another module: it may have a formula
                formula = True
                continue
            said = base.said | said
            defaults |= base.defaults
            fields = [*base.fields, *(x for x in fields if x not in base.fields)]
            formula, library = formula or base.formula, library or base.library
        return _Class(library, said, tuple(fields), frozenset(defaults), formula, own)

    def _law(self, name: str, read: _Class) -> Declared:
        if read.library is None:
            raise InputError(f"{self.path}: law `{name}` derives from no port of omnijax.laws.")
        port, places, parameters = map(read.attribute, ("port", "places", "parameters"))
        if places is _UNREAD:
            self._refuse(name, "its `places` out as a tuple of texts")
        if not isinstance(parameters, dict):
            self._refuse(name, "its `parameters` out as a dict")
        for label, parameter in parameters.items():
            if not isinstance(label, str):
                raise InputError(f"{self.path}: law `{name}` must name its `parameters` by texts.")
            if not isinstance(parameter, Parameter):
                self._refuse(name, f"`{label}` out as Parameter(unit, ...)")
        wrong = laws.declaration_problem(
            name, port, places, parameters, read.fields, read.defaults, read.formula
        )
        linear = read.own.get("linear", False)
        if wrong is None and linear is _UNREAD:
            self._refuse(name, "`linear` out as True or False")
        wrong = wrong or laws.linear_problem(name, str(port), linear, read.fields)
        if wrong is not None:
            raise InputError(f"{self.path}: {wrong}")
        return Declared(name, port, places, parameters)

    def _refuse(self, law: str, what: str) -> NoReturn:
        raise InputError(f"{self.path}: law `{law}` must write {what}.")

    def _assigned(self, node: ast.Assign | ast.AnnAssign) -> dict[str, Any]:
        """Name -> value of `a = x`, `a: t = x` and `a, b = x, y`."""
        if node.value is None:
            return {}
        value, assigned = self._read(node.value), {}
        for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
            if isinstance(target, ast.Name):
                assigned[target.id] = value
            elif isinstance(target, ast.Tuple):
                whole = isinstance(value, tuple) and len(value) == len(target.elts)
                every = value if whole else ()
                pairs = itertools.zip_longest(target.elts, every, fillvalue=_UNREAD)
                assigned |= {x.id: each for x, each in pairs if isinstance(x, ast.Name)}
        return assigned

    def _read(self, node: ast.expr) -> Any:
        """The value of an expression; `_UNREAD` where only a run can tell it."""
        try:
            return self._value(node)
        except _NO_VALUE:
            return _UNREAD

    def _value(self, node: ast.expr) -> Any:
        """A literal, a class, a `Parameter`, and what is made of them; nothing else is called."""
        match node:
            case ast.Name(name) if name in self.named:
                value = self.named[name]
            case ast.Subscript(ast.Name("EFFECTS") | ast.Attribute(_, "EFFECTS"), key):
                value = _library_class(laws.EFFECTS[self._value(key)])
            case ast.Attribute(owner, "parameters"):
                value = self._value(owner).attribute("parameters")
            case ast.Name(name) | ast.Attribute(_, name):
                value = _of_the_library(name)
            case ast.Tuple(parts):
                value = tuple(map(self._read, parts))
            case ast.Dict(keys, values):
                value = self._table(keys, values)
            case ast.UnaryOp(ast.USub(), number):
                value = -self._value(number)
            case ast.BinOp(left, ast.BitOr(), right):
                value = self._value(left) | self._value(right)
            case ast.BinOp(left, of_two, right) if type(of_two) in _OF_TWO:
                pair = (self._value(left), self._value(right))
                if not all(isinstance(x, int | float) for x in pair):
                    raise TypeError("no numbers")
                value = _OF_TWO[type(of_two)](*pair)
            case ast.Call():
                value = self._called(node)
            case _:
                value = ast.literal_eval(node)
        return value

    def _called(self, node: ast.Call) -> Any:
        """The value of float(..) or Parameter(..)."""
        given = map(self._value, node.args)
        match node.func:
            case ast.Name("float") if len(node.args) == 1 and not node.keywords:
                return float(*given)
            case function if self._value(function) is Parameter:
                return Parameter(
                    *given, **{str(k.arg): self._value(k.value) for k in node.keywords}
                )
        return ast.literal_eval(node)

    def _table(self, keys: list[ast.expr | None], values: list[ast.expr]) -> dict:
        table = {}
        for key, value in zip(keys, values, strict=True):
            read = self._read(value)
            table |= read if key is None else {self._value(key): read}
        return table


def _of_the_library(name: str) -> Any:
    """What omnijax.laws has under `name`, or an infinity; `LookupError` where it declares none."""
    value = getattr(math if name in ("inf", "pi") else laws, name, None)
    if isinstance(value, float) or value is Parameter or name == "ANY_LENGTH":
        return value
    if not (isinstance(value, type) and issubclass(value, laws.AbstractLaw)):
        raise LookupError(name)
    return _library_class(value)


def _library_class(value: type[laws.AbstractLaw]) -> _Class:
    """A class of the library as the lines of a file see it."""
    formula = value.__call__ is not laws.AbstractLaw.__call__
    return _Class(
        value, {}, laws.field_names(value), frozenset(laws.defaults_of(value)), formula, {}
    )
