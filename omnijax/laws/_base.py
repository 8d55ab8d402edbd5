"""What a law is: one formula at one port, its parameters as leaves, and `+`."""

import dataclasses
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax

from .. import _config as _config

FILLED_IN = {"filled_in": True}  # metadata of a field that the rig fills in: no parameter
ANY_LENGTH = -1  # `shape` of lists that are as long as the user makes them, all of a law alike


class Parameter(NamedTuple):
    """What is known of one parameter of a law besides its value.

    `unit` is an SI unit, `low` and `high` the physically allowed range, `linear` says that the
    law's output is proportional to it (so that its value at zero is no effect), `shape` is the
    length of a vector parameter (0: a scalar, `ANY_LENGTH`: a list), `optional` that a rig file may
    leave it out, `above` that `low` itself is excluded (the law divides by the parameter), `whole`
    that it counts something.
    """

    unit: str
    low: float = -float("inf")
    high: float = float("inf")
    linear: bool = False
    shape: int = 0
    optional: bool = False
    above: bool = False
    whole: bool = False


class AbstractLaw(eqx.Module):
    """One formula at one port.

    Concrete laws are final: they hold their parameters as fields, the formula in the docstring
    and three lines of code in `__call__(signal)` (laws with memory: `__call__(signal, state)`).
    Laws of the same port add: `a + b` and `sum(laws)` are laws.

    Class variables: `id` names the law in rig files, `port` is where it acts, `places` are the
    places a rig file may give it, `parameters` describes its fields, `formula` is the text of
    `omnijax effects` and `words` what a mechanic calls it; `widens` are the ids of laws that are a
    limit of this one.
    """

    id: ClassVar[str] = ""
    words: ClassVar[str] = ""
    port: ClassVar[str] = ""
    places: ClassVar[tuple[str, ...]] = ()
    formula: ClassVar[str] = ""
    source: ClassVar[str] = ""
    widens: ClassVar[tuple[str, ...]] = ()
    parameters: ClassVar[dict[str, Parameter]] = {}

    def __call__(self, signal: Any, state: Any = None) -> Any:
        raise NotImplementedError

    def initial(self) -> Any:
        """State of the law's memory at rest; `None` for a law without memory."""
        return None

    def rate(self, signal: Any, state: Any) -> Any:
        """Time derivative of the law's memory; `None` for a law without memory."""
        return None

    @classmethod
    def has_memory(cls) -> bool:
        """Whether the law has a state of its own, which `initial` and `rate` tell."""
        return cls.initial is not AbstractLaw.initial

    def __add__(self, other: "AbstractLaw") -> "Sum":
        if not isinstance(other, AbstractLaw):
            return NotImplemented
        return Sum((*_terms(self), *_terms(other)))

    def __radd__(self, other: Any) -> "AbstractLaw":
        if other == 0:  # sum(laws) starts from 0
            return self
        return NotImplemented


class Sum(AbstractLaw):
    """The sum of several laws of one port; its state is the tuple of their states."""

    laws: tuple[AbstractLaw, ...]

    def __check_init__(self):
        ports = {law.port for law in self.laws}
        if len(ports) > 1:
            raise ValueError(f"laws of different ports do not add: {', '.join(sorted(ports))}.")

    def __call__(self, signal, state=None):
        states = (None,) * len(self.laws) if state is None else state
        outputs = [law(signal, z) for law, z in zip(self.laws, states, strict=True)]
        return jax.tree.map(lambda *xs: sum(xs), *outputs)

    def initial(self):
        return tuple(law.initial() for law in self.laws)

    def rate(self, signal, state):
        return tuple(law.rate(signal, z) for law, z in zip(self.laws, state, strict=True))


def _terms(law: AbstractLaw) -> tuple[AbstractLaw, ...]:
    return law.laws if isinstance(law, Sum) else (law,)


def field_names(law: type[AbstractLaw]) -> tuple[str, ...]:
    """Names of a law's parameters in the order of its fields, without what the rig fills in."""
    fields = dataclasses.fields(law)
    return tuple(field.name for field in fields if not field.metadata.get("filled_in"))


def defaults_of(law: type[AbstractLaw]) -> tuple[str, ...]:
    """Names of a law's parameters that have a default."""
    none = dataclasses.MISSING
    return tuple(
        field.name for field in dataclasses.fields(law)
        if not (field.default is none and field.default_factory is none)
    )  # fmt: skip
