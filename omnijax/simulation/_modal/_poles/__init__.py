"""Poles of designs: blocks that move each other, their poles and vectors, coinciding poles."""

from .coincidence import Answer as Answer
from .coincidence import Coincidence as Coincidence
from .coincidence import answered as answered
from .coincidence import coincidence as coincidence
from .decoupling import blocks_of as blocks_of
from .decoupling import coupled as coupled
from .decoupling import decoupled as decoupled
from .decoupling import turned_states as turned_states
from .poles import Eigen as Eigen
from .poles import PolePairs as PolePairs
from .poles import eigen as eigen
from .poles import grows as grows
from .poles import modes_of as modes_of
from .poles import unpacked as unpacked
from .poles import unpacked_inverse as unpacked_inverse
