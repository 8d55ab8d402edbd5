"""Functions of living modules, and other code under them for a while."""

import ast
import contextlib
import inspect
from collections.abc import Iterator
from types import CodeType, FunctionType


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
