"""What a machine is: parameters, a right-hand side with ports, inputs and outputs."""

import abc
from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
from jaxtyping import Array, ArrayLike, Float

from ._ports import Ports


class AbstractMachine(eqx.Module):
    """One machine: its fields are its parameters, `rate` its equation of motion.

    Class variables: `inputs` and `outputs` give names with SI units, `places` the places where
    laws may act, by port ("shaft", "mount"), `uncertainty` the 1-sigma of what is not known for
    sure: relative, or absolute for a field whose value is 0.  Laws of the port "sensor" act on
    every output by themselves.
    """

    inputs: ClassVar[Mapping[str, str]] = {"input": "N m"}
    outputs: ClassVar[Mapping[str, str]] = {"position": "rad"}
    places: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    uncertainty: ClassVar[Mapping[str, float]] = {}

    @abc.abstractmethod
    def rate(self, x: Float[Array, " n"], u: Mapping[str, Array], ports: Ports) -> Any:
        """Time derivative of the state `x`; `ports(port, place, signal)` adds the laws there."""

    @abc.abstractmethod
    def read(self, x: Float[Array, " n"], u: Mapping[str, Array]) -> Mapping[str, Array]:
        """The outputs at the state `x`."""

    @abc.abstractmethod
    def start(self, first: Mapping[str, tuple[ArrayLike, ArrayLike]]) -> Any:
        """A state at which the outputs have the values and rates `first` (value, rate by name)."""

    def term(self, inputs: Any, placed: Any = ()) -> Any:
        """The vector field as a `diffrax.ODETerm` under `inputs`, with laws: see `machine.term`."""
        from ._term import term

        return term(self, inputs, placed)

    def memory(self) -> float:
        """Seconds after which the machine has forgotten its start; infinity where it never does."""
        return float("inf")

    def speed_memory(self) -> float:
        """Seconds after which its speed has forgotten its start; a position may stay for ever."""
        return self.memory()
