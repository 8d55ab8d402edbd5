"""The equations that are changed, and changes that change nothing."""

import ast
import importlib
import inspect
import pkgutil
import textwrap
from collections.abc import Callable, Iterator
from types import CodeType
from typing import NamedTuple

from .changes import OTHER_PORT, mutants_of
from .living import attribute, code_of, coded, functions, plain

PLACES = ("omnijax.laws", "omnijax.dynamics")  # every file of them, and
FURTHER = ("omnijax.rig._machine", "omnijax.simulation._signals", "omnijax.simulation._drives")
BESIDE = {"_base", "_library", "_ports"}  # files without an equation of the machine


def modules() -> list[str]:
    found = []
    for place in PLACES:
        package = importlib.import_module(place)
        names = sorted(m.name for m in pkgutil.iter_modules(package.__path__))
        found += [f"{place}.{name}" for name in names if name not in BESIDE]
    return [*found, *FURTHER]


SAME = {  # changes that change nothing, and why
    "ActuatorDelay.__call__: -self.delay * jnp.ones_like(signal)  ->  "
    "-self.delay / jnp.ones_like(signal)": "by one",
    "TorqueOffset.__call__: self.torque * jnp.ones_like(signal.angle)  ->  "
    "self.torque / jnp.ones_like(signal.angle)": "by one",
    "TableShape.__call__: len(self.knots) - 2  ->  len(self.knots) + 2":
        "an index that JAX keeps inside the array",
    "Signal._piece: len(self.knots) - 1  ->  len(self.knots) + 1":
        "an index that JAX keeps inside the array",
    "SphereOutOfRound.__call__: "
    "self.axis @ direction / jnp.sqrt(self.axis @ self.axis)  ->  -(...)": "squared",
    "_rollers: "
    "gap.wheel_radius / gap.sphere_radius * jnp.sin(gap.width / 4 * (1 + x))  ->  -(...)":
        "squared",
    "mirrored: pieces.polynomial * sign  ->  pieces.polynomial / sign": "by one or minus one",
    "Gap.sagitta: self.wheel_radius / self.sphere_radius * jnp.sin(angle)  ->  -(...)": "squared",
    "Rollers.__call__: jnp.minimum(into, gap.width - into)  ->  -(...)":
        "the sagitta is even in the angle",
    "rotation_matrix: attitude / jnp.sqrt(attitude @ attitude)  ->  -(...)":
        "q and -q are one attitude",
    "quaternion_of: jnp.sqrt(jnp.where(square > 0, square, 1.0))  ->  -(...)":
        "cosine, and sine over the angle, are even",
    "_adjugate: "
    "jnp.stack([jnp.cross(b, c), jnp.cross(c, a), jnp.cross(a, b)], axis=-1)  ->  -(...)":
        "the determinant turns with the adjugate, which is divided by it",
    "_span: xp.cross(r[:, None], r[None])  ->  xp.cross(r[None], r[:, None])": "squared",
    "_span: xp.cross(r[:, None], r[None])  ->  -(...)": "squared",
    "free_projector: jnp.cross(r[:, None], r[None])  ->  jnp.cross(r[None], r[:, None])":
        "squared",
    "free_projector: jnp.cross(r[:, None], r[None])  ->  -(...)": "squared",
    "held_directions: np.asarray(rig.wheels.normal)  ->  -(...)": "squared",
    "DualRow.switch: gap.width / 2 - gap.pitch / 4  ->  gap.width / 2 + gap.pitch / 4":
        "the switch after it",
    "same_contacts: np.asarray(rig.wheels.normal)  ->  -(...)": "a distance",
    "radius_under: rig.wheel_radius + shape  ->  rig.wheel_radius - shape":
        "where Newton's method starts",
    "mobility: left[:, rank:].T * ratio  ->  -(...)": "a conflict's direction has no sign",
    "step: min(time, 0.0) - 1.0  ->  min(time, 0.0) - 2.0":
        "a time from which on the signal is the same as before it",
    "_onward: 1 + jnp.abs(state.angle)  ->  2 + jnp.abs(state.angle)":
        "more than the angle is rounded by, either way",
}  # fmt: skip
PASSED = {  # no equation of the machine
    "__repr__", "jumps", "kinks", "_slices", "flatten", "unflatten", "zeros", "place_law", "add",
    "check_drive", "fit", "term",
}  # fmt: skip


class Mutant(NamedTuple):
    """One change: where, what it reads now, and how to apply it."""

    where: str  # module.function
    kind: str
    text: str
    code: CodeType  # of the function as it stands
    apply: Callable  # () -> context manager


def equations(module, words=()) -> Iterator[Mutant]:
    """Every mutant of one module's functions."""
    for name, function in functions(module):
        where = f"{module.__name__}.{name}"
        if words and not any(word in where for word in words):
            continue
        for kind, text, changed in changes_of(module, function):
            if f"{name}: {text}" in SAME:
                continue
            new = code_of(changed)
            yield Mutant(
                where, kind, text, function.__code__, lambda f=function, c=new: coded(f, c)
            )


def changes_of(module, function) -> Iterator[tuple[str, str, ast.FunctionDef]]:
    """(kind, what it reads then, the changed function) of a function that has an equation."""
    if function.__name__ in PASSED or function.__code__.co_freevars:
        return
    if function.__code__.co_filename != module.__file__:
        return  # made by a library: a dataclass's own methods
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    if isinstance(tree, ast.FunctionDef):
        yield from mutants_of(tree)


def outdated() -> set[str]:
    """Entries of `SAME` that speak of no equation as it stands."""
    known = set()
    for module in map(importlib.import_module, modules()):
        for name, function in functions(module):
            known |= {f"{name}: {text}" for _, text, _ in changes_of(module, function)}
    return set(SAME) - known


def moved_laws(words=()) -> Iterator[Mutant]:
    """Every law of the library at another port than its own."""
    from omnijax.laws import EFFECTS

    for name, law in EFFECTS.items():
        where = f"{law.__module__}.{law.__name__}.__call__"
        if words and not any(word in where for word in words):
            continue
        other = OTHER_PORT[law.port]
        text = f"port of `{name}`: {law.port}  ->  {other}"
        code = plain(law.__call__).__code__
        yield Mutant(where, "port", text, code, lambda c=law, o=other: attribute(c, "port", o))


def all_mutants(words=()) -> Iterator[Mutant]:
    for name in modules():
        yield from equations(importlib.import_module(name), words)
    yield from moved_laws(words)
