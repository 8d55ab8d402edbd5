"""Does anything hold each sign, factor, exponent and port?  `python -m tests.mutants [WORD ...]`

Every equation of laws, kinematics, rotation, translation, sensors and drives is changed once at a
time, in memory: a sign turned, a product divided, a power raised, a constant doubled, a function
or an input exchanged for its neighbour, a law moved to another port.  A change is killed when a
formula's numbers (`formulas.py`, `moments.py`) no longer come out.  Words choose functions by name.
"""

import ast
import contextlib
import importlib
import inspect
import pkgutil
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FunctionType
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parent))

FUNCTIONS = {
    "sin": "cos", "cos": "sin", "tanh": "sin", "maximum": "minimum", "minimum": "maximum",
    "floor": "ceil", "abs": "negative", "sqrt": "square", "cbrt": "sqrt",
}  # fmt: skip
SWAPPED = FUNCTIONS | {  # names and fields that a slip of the pen exchanges
    "deflection": "rate", "rate": "deflection", "angle": "speed", "speed": "angle",
    "command": "speed", "load": "speed", "roll": "spin", "spin": "roll", "shaft": "spin",
    "stiffness": "damping", "damping": "stiffness", "preload": "stiffness",
    "mount_rate": "approach_rate", "approach_rate": "mount_rate",
    "normal": "drive", "drive": "normal", "contact": "mount", "mount": "contact",
    "friction": "damping", "momentum": "approach", "velocity": "displacement",
    "inverse": "matrix", "matrix": "inverse", "inertia": "mass", "mass": "inertia",
    "normal_force": "friction", "angular_velocity": "gravity", "gravity": "angular_velocity",
    "values": "slopes", "slopes": "values",
}  # fmt: skip
OTHER_PORT = {  # a law that acts elsewhere
    "shape": "surface", "surface": "shape", "contact": "mount", "separation": "contact",
    "mount": "contact", "shaft": "rolling", "rolling": "shaft", "sphere": "platform",
    "platform": "sphere", "kinematics": "shaft", "sensor": "platform", "radius": "kinematics",
    "command": "actuator", "actuator": "command",
}  # fmt: skip


class Mutant(NamedTuple):
    """One change: where, what it reads now, and how to apply it."""

    where: str  # module.function
    kind: str
    text: str
    apply: Callable  # () -> context manager


# ------------------------------------------------------------------ changes of one expression


def changes(node: ast.expr) -> Iterator[tuple[str, ast.expr]]:
    """What may go wrong at one node."""
    if isinstance(node, ast.BinOp):
        flipped = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
        kinds = {ast.Add: "sign", ast.Sub: "sign", ast.Mult: "factor", ast.Div: "factor"}
        if type(node.op) in flipped:
            yield (
                kinds[type(node.op)],
                ast.BinOp(node.left, flipped[type(node.op)](), node.right),
            )
        if isinstance(node.op, ast.Pow):
            raised = ast.BinOp(node.right, ast.Add(), ast.Constant(1))
            yield "exponent", ast.BinOp(node.left, ast.Pow(), raised)
        for side in ("left", "right"):
            part = getattr(node, side)
            if isinstance(part, ast.Constant) and isinstance(part.value, (int, float)):
                if isinstance(node.op, ast.Pow) or part.value == 0:
                    continue
                doubled = {side: ast.Constant(2 * part.value)}
                both = {"left": node.left, "right": node.right} | doubled
                yield "factor", ast.BinOp(both["left"], node.op, both["right"])
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        if not isinstance(node.operand, ast.Constant):
            yield "sign", node.operand
    elif isinstance(node, ast.Attribute) and node.attr in SWAPPED:
        yield (
            "function" if node.attr in FUNCTIONS else "port",
            ast.Attribute(node.value, SWAPPED[node.attr], node.ctx),
        )
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
        if node.func.attr == "cross":
            yield "sign", ast.Call(node.func, node.args[::-1], [])
        elif node.func.attr == "at" and getattr(node.args[0], "value", None) in OTHER_PORT:
            port = ast.Constant(OTHER_PORT[node.args[0].value])
            yield "port", ast.Call(node.func, [port], [])


SILENT = (ast.Raise, ast.Assert)  # what stands in them is a message


def places(body: list[ast.stmt]) -> Iterator[tuple[ast.AST, str, int | None]]:
    """Every expression's place: (parent, field, index)."""
    stack: list[ast.AST] = list(body)
    while stack:
        node = stack.pop()
        for field, value in ast.iter_fields(node):
            if field in ("annotation", "returns", "slice", "decorator_list", "defaults", "ctx"):
                continue
            for i, child in enumerate(value) if isinstance(value, list) else [(None, value)]:
                if isinstance(child, ast.expr):
                    yield node, field, i
                if isinstance(child, ast.AST) and not isinstance(child, SILENT):
                    stack.append(child)


def put(parent, field, index, node):
    if index is None:
        setattr(parent, field, node)
    else:
        getattr(parent, field)[index] = node


def mutants_of(tree: ast.FunctionDef) -> Iterator[tuple[str, str, ast.FunctionDef]]:
    """(kind, what it reads then, the changed function)."""
    for parent, field, index in list(places(tree.body)):
        old = getattr(parent, field) if index is None else getattr(parent, field)[index]
        for kind, new in changes(old):
            put(parent, field, index, new)
            yield kind, f"{ast.unparse(old)}  ->  {ast.unparse(new)}", tree
            put(parent, field, index, old)
    for statement in ast.walk(tree):
        if isinstance(statement, (ast.Return, ast.Assign)) and negated(statement.value):
            old = statement.value
            statement.value = ast.UnaryOp(ast.USub(), old)
            yield "sign", f"{ast.unparse(old)}  ->  -(...)", tree
            statement.value = old


def negated(value) -> bool:
    """Whether an opposite sign of a whole value is a slip worth trying: of a product, of a call."""
    if isinstance(value, ast.Call) and isinstance(value.func, ast.Attribute):
        return value.func.attr not in ("zeros", "zeros_like", "eye", "at", "set")
    return isinstance(value, ast.BinOp) and not isinstance(value.op, (ast.Add, ast.Sub))


# ------------------------------------------------------------------ living functions


def code_of(tree: ast.FunctionDef) -> CodeType:
    """The function's code as it would be compiled in its module."""
    bare = ast.FunctionDef(
        tree.name, without_annotations(tree.args), tree.body, [], None, None, type_params=[]
    )
    module = ast.fix_missing_locations(ast.Module([bare], []))
    space: dict = {}
    exec(compile(module, f"<mutant of {tree.name}>", "exec"), space)
    return space[tree.name].__code__


def without_annotations(args: ast.arguments) -> ast.arguments:
    def bare(arg):
        return None if arg is None else ast.arg(arg.arg)

    return ast.arguments(
        [bare(a) for a in args.posonlyargs],
        [bare(a) for a in args.args],
        bare(args.vararg),
        [bare(a) for a in args.kwonlyargs],
        [None if d is None else ast.Constant(None) for d in args.kw_defaults],
        bare(args.kwarg),
        [ast.Constant(None) for _ in args.defaults],
    )


def functions(module) -> Iterator[tuple[str, FunctionType]]:
    """(name, function) of everything that is defined in `module`, methods too."""
    for name, value in list(vars(module).items()):
        if getattr(value, "__module__", None) != module.__name__:
            continue
        if inspect.isclass(value):
            for own, member in list(vars(value).items()):
                inner = plain(member)
                if inner is not None and inner.__qualname__ == f"{value.__qualname__}.{own}":
                    yield f"{name}.{own}", inner
        else:
            inner = plain(value)
            if inner is not None:
                yield name, inner


def plain(value) -> FunctionType | None:
    """The function under property, classmethod, equinox's and a type checker's wrappers."""
    for _ in range(8):
        if isinstance(value, property):
            value = value.fget
        for word in ("__wrapped__", "__func__", "method", "_fun"):
            inner = getattr(value, word, None)
            if callable(inner) and not inspect.isclass(value):
                value = inner
                break
        else:
            break
    return value if isinstance(value, FunctionType) else None


@contextlib.contextmanager
def coded(function: FunctionType, code: CodeType):
    old, function.__code__ = function.__code__, code
    try:
        yield
    finally:
        function.__code__ = old


@contextlib.contextmanager
def attribute(owner, name, value):
    old = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, old)


def equations(module, words=()) -> Iterator[Mutant]:
    """Every mutant of one module's functions."""
    for name, function in functions(module):
        if function.__name__ in PASSED or f"{module.__name__}.{name}" in PASSED:
            continue
        where = f"{module.__name__}.{name}"
        if words and not any(word in where for word in words):
            continue
        if function.__code__.co_filename != module.__file__:
            continue  # made by a library: a dataclass's own methods
        tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
        if not isinstance(tree, ast.FunctionDef) or function.__code__.co_freevars:
            continue
        for kind, text, changed in mutants_of(tree):
            if text in SAME:
                continue
            code = code_of(changed)
            yield Mutant(where, kind, text, lambda f=function, c=code: coded(f, c))


def moved_laws(words=()) -> Iterator[Mutant]:
    """Every law of the library at another port than its own."""
    from omnijax.laws import EFFECTS

    for name, law in EFFECTS.items():
        where = f"{law.__module__}.{law.__name__}.__call__"
        if words and not any(word in where for word in words):
            continue
        other = OTHER_PORT[law.port]
        text = f"port of `{name}`: {law.port}  ->  {other}"
        yield Mutant(where, "port", text, lambda c=law, o=other: attribute(c, "port", o))


# ------------------------------------------------------------------ what is changed, what kills it

PLACES = ("omnijax.laws", "omnijax.dynamics")  # every file of them, and
FURTHER = ("omnijax.rig._machine", "omnijax.simulation._signals", "omnijax.simulation._drives")
BESIDE = {"_base", "_library", "_ports", "_pieces"}  # files without an equation of the machine


def modules() -> list[str]:
    found = []
    for place in PLACES:
        package = importlib.import_module(place)
        names = sorted(m.name for m in pkgutil.iter_modules(package.__path__))
        found += [f"{place}.{name}" for name in names if name not in BESIDE]
    return [*found, *FURTHER]


SAME = {  # changes that change nothing, and why
    "-self.delay * jnp.ones_like(signal)  ->  -self.delay / jnp.ones_like(signal)": "by one",
    "self.torque * jnp.ones_like(signal.angle)  ->  self.torque / jnp.ones_like(signal.angle)":
        "by one",
    "jnp.ones_like(signal.angle)  ->  jnp.ones_like(signal.speed)": "only the shape counts",
    "angle * gap.pitch  ->  angle / gap.pitch": "only the shape counts",
    "len(time) - 1  ->  len(time) + 1": "an index that JAX keeps inside the array",
    "len(self.knots) - 2  ->  len(self.knots) + 2": "an index that JAX keeps inside the array",
    "self.axis @ direction / jnp.sqrt(self.axis @ self.axis)  ->  -(...)": "squared",
    "self.wheel_radius / self.sphere_radius * jnp.sin(angle)  ->  -(...)": "squared",
    "jnp.minimum(into, gap.width - into)  ->  -(...)": "the sagitta is even in the angle",
}  # fmt: skip
PASSED = {  # no equation of the machine
    "__repr__", "jumps", "kinks", "_slices", "flatten", "unflatten", "zeros", "place_law", "add",
    "drive_from_recording", "_first", "_initial_velocity", "check_drive", "load_laws", "fit",
}  # fmt: skip


WHOLE: set[str] = set()  # names of the checks of the whole machine


def checks() -> dict[str, Callable]:
    """Everything that may kill, cheapest first."""
    import test_formulas
    import test_moment

    WHOLE.update(test_moment.CHECKS)
    return test_formulas.CHECKS | test_moment.CHECKS


def killer(mutant: Mutant, every: dict[str, Callable], first: str | None) -> str | None:
    """Name of the check that fails under the mutant; None where it survives.

    Raises `AttributeError` where the port has no such field: then there is nothing to kill.
    """
    where = mutant.where.lower()
    law = "laws" in where

    def late(name):  # the law's own numbers first, those of the whole machine where it is not a law
        return (
            name != first,
            name.replace("-", "") not in where,
            ("," in name or " " in name) == law,
        )

    with mutant.apply():
        for name in sorted(every, key=late):
            try:
                every[name]()
            except AttributeError:
                raise
            except Exception:  # a wrong number, or a shape that no longer fits
                return name
    return None


def main(words: list[str]) -> int:
    every, began = checks(), time.perf_counter()
    for name, check in every.items():  # all of them pass as the tree stands
        try:
            check()
        except Exception as error:
            raise SystemExit(f"`{name}` fails without any change: {error}") from error
    tried, survivors, rows = 0, [], {}
    first: dict[str, str] = {}
    for mutant in all_mutants(words):
        try:
            found = killer(mutant, every, first.get(mutant.where))
        except AttributeError:
            continue
        tried += 1
        row = rows.setdefault(mutant.where.removeprefix("omnijax."), {})
        killed, of = row.get(mutant.kind, (0, 0))
        row[mutant.kind] = (killed + (found is not None), of + 1)
        if found is None:
            survivors.append(mutant)
            print(f"survives: {mutant.where} ({mutant.kind}): {mutant.text}", flush=True)
        else:
            first[mutant.where] = found
    print(table(rows))
    share = 100 * (tried - len(survivors)) / max(tried, 1)
    seconds = time.perf_counter() - began
    print(f"{tried - len(survivors)} of {tried} mutants killed: {share:.1f} % in {seconds:.0f} s")
    return bool(survivors)


def all_mutants(words=()) -> Iterator[Mutant]:
    for name in modules():
        yield from equations(importlib.import_module(name), words)
    yield from moved_laws(words)


def table(rows) -> str:
    """Killed of tried by function and kind, as Markdown."""
    kinds = ("sign", "factor", "exponent", "function", "port")
    lines = ["| equation | " + " | ".join(kinds) + " |", "| --- |" + " --- |" * len(kinds)]
    for where, row in sorted(rows.items()):
        cells = [f"{row[k][0]}/{row[k][1]}" if k in row else "" for k in kinds]
        lines.append(f"| {where} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
