"""What a place of the machine has to know of itself, so that a learned term may act there.

A term has one output for each of the port's `parts`: a force or torque of each wheel, a shape of
each wheel, a torque about each axis of the sphere, a reading of each channel.  Its inputs are
scaled to RMS 1 over the train runs.
"""

import abc
import dataclasses
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ....laws import AbstractLaw
from ....rig import Placed
from ..._machine import Linearisation, along
from ..._settings import SETTINGS

DRAWN_TO = SETTINGS.answer_learned.drawn_to
POINTS = SETTINGS.answer_learned.points
KNEES = SETTINGS.answer_learned.knees
Columns = list[tuple[int, str, np.ndarray]]  # (part, label, values)
AXES = "xyz"
BENDS = ("|x| x", "cube", "fifth", "square")  # of `powers`


class TermGrid(NamedTuple):
    """Where a part of a term is drawn: values of an input, by index those of what varies, scaled.

    `input` is the input's name where it is not the part's own.
    """

    part: int
    x: np.ndarray  # (points,)
    varied: dict[int, np.ndarray]  # (points,) each
    input: str = ""


class AbstractPort(abc.ABC):
    """A place of the machine where a term may act.

    `port` names it, `laws` are the ports of the library's laws that act there, `networked` says
    whether a network of all inputs may join the basis.
    """

    port: str
    laws: ClassVar[tuple[str, ...]] = ()
    networked: ClassVar[bool] = True

    @property
    @abc.abstractmethod
    def parts(self) -> tuple[str, ...]:
        """Names of the outputs."""

    @abc.abstractmethod
    def units(self, part: int) -> tuple[str, str]:
        """Of a part's own input, and of its output."""

    @abc.abstractmethod
    def labels(self) -> list[str]:
        """Names of the inputs; those that are drawn are the parts' own."""

    @abc.abstractmethod
    def input_units(self) -> list[str]:
        """Of the inputs."""

    @abc.abstractmethod
    def inputs(self, base: Linearisation, felt=None) -> np.ndarray:
        """Inputs (points, k), not scaled; `felt` is what the term itself adds."""

    @abc.abstractmethod
    def columns(self, u: np.ndarray) -> Columns:
        """The smooth basis, of scaled inputs; of two that are alike the first is taken."""

    @abc.abstractmethod
    def push(
        self, base: Linearisation, force: np.ndarray
    ) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Both tables of changes that outputs (points, parts) cause; None is no change."""

    @abc.abstractmethod
    def of_law(self, base: Linearisation, placed: Placed, grid: TermGrid) -> np.ndarray | None:
        """What a law of the library puts out along a grid; None where that is no function of it."""

    def own(self, part: int) -> int:
        """Index of a part's own input."""
        return part

    def own_functions(self, part: int) -> tuple[str, ...]:
        """Labels of the columns that are functions of a part's own input alone, but for waves."""
        return ()

    def own_bends(self, part: int, u: np.ndarray) -> dict[str, np.ndarray]:
        """Further functions of a part's own input that a law is asked for, of scaled inputs `u`."""
        return {}

    def hosts(self, port: str) -> bool:
        """Whether laws at one of the library's ports act here."""
        return port in self.laws

    def scales(self, raw: np.ndarray) -> np.ndarray:
        """RMS of every input (k,), 1 of one that is always 0."""
        scales = np.sqrt(np.mean(raw**2, axis=0))
        scales[scales == 0] = 1.0
        return scales

    def felt(self, base: Linearisation, force: np.ndarray) -> Any:
        """What outputs change of the inputs: nothing, where these are of the measured motion."""
        return None

    def like_own(self, part: int) -> list[int]:
        """Inputs over which a part may be drawn: those of the unit of its own."""
        units = self.input_units()
        return [k for k, unit in enumerate(units) if unit == units[self.own(part)]]

    def grid(self, part: int, scales: np.ndarray, over: int | None = None) -> TermGrid:
        """The part's own input about 0, or another one."""
        k = self.own(part) if over is None else over
        x, other = np.linspace(-DRAWN_TO, DRAWN_TO, POINTS), k != self.own(part)
        return TermGrid(part, x * scales[k], {k: x}, self.labels()[k] if other else "")


@dataclasses.dataclass(frozen=True)
class AbstractWheelPort(AbstractPort):
    """One whose parts are the wheels."""

    wheels: tuple[str, ...]

    @property
    def parts(self):
        return self.wheels


def powers(x: np.ndarray, time: np.ndarray) -> dict[str, np.ndarray]:
    """Smooth functions of one own input, and its product with time.

    The odd ones first: of two that runs in one direction do not tell apart the first is taken, and
    a friction turns round with the motion.  Products: NumPy's general power takes ten times as
    long.
    """
    square = x * x
    cube = square * x
    return {
        "|x| x": np.abs(x) * x,
        "cube": cube,
        "fifth": cube * square,
        "square": square,
        "times t": x * time,
    }


def waves(cosine: np.ndarray, sine: np.ndarray, orders: Sequence[int]) -> dict[str, np.ndarray]:
    """Harmonics of an angle."""
    wave, out = cosine + 1j * sine, {}
    for k in orders:
        turned = wave**k
        out |= {f"sin {k}θ": turned.imag, f"cos {k}θ": turned.real}
    return out


def cuts(x: np.ndarray) -> dict[str, np.ndarray]:
    """Piecewise-linear functions of one own input, scaled: it as far as each knee, odd and even.

    They bend and no longer grow at plus and minus the knee: a dead zone is the lack of one, and
    sums of them are any curve with its bends near the knees.  The odd ones first.  Source: linear
    splines with fixed knots (Friedman, Multivariate adaptive regression splines, 1991).
    """
    odd = {f"up to {k:g}": np.clip(x, -k, k) for k in KNEES}
    return odd | {f"size up to {k:g}": np.minimum(np.abs(x), k) for k in KNEES}


def axes_of(port: AbstractPort, grid: TermGrid) -> tuple[tuple[str, str], tuple[str, str]]:
    """Names and units of the input over which a part is drawn, and of the term."""
    own, unit = port.units(grid.part)
    labels, at = port.labels(), port.own(grid.part)
    if grid.input:
        at = labels.index(grid.input)
        own = port.input_units()[at]
    return (labels[at].split(" of ")[0], own), ("term", unit)


def memoryless(law: AbstractLaw, signal: Any) -> np.ndarray | None:
    """A law along signals of one wheel; None of one that remembers."""
    return None if law.initial() is not None else along(law, signal)
