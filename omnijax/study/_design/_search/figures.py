"""The figures of a problem at shares of its ranges: compiled once, in one scale, checked."""

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from ...._compiling import quick_jit
from ...._errors import InputError
from ...._text import listed
from ..._batches import each, in_batches, value_and_jacobian
from ..._problem import Limit, Problem
from ..._range import Ranges
from .evolve import Rank
from .many import WIDTH
from .sqp import Scaled, SqpSlopes
from .starts import start_shares

SILENT = 1e-12
NAMED = 4  # limits in a sentence


def nothing_left(name: str) -> str:
    """That a figure is 0 in every design."""
    return (
        f"`{name}` is 0 in every design that was tried: under these drives nothing moves that "
        "it measures, so that no design is better than another."
    )


def limits_text(names: Sequence[str]) -> str:
    """Limits in a sentence, the first `NAMED` of them by name."""
    more = [f"{len(names) - NAMED} more limits"] if len(names) > NAMED else []
    return listed([*(f"`{name}`" for name in names[:NAMED]), *more])


def not_finite(problem: Problem, f: np.ndarray, g: np.ndarray, what: str = "") -> str:
    """Which figures are not finite, of f (k, ...) and g (c, ...), in words; empty where none is.

    `what` says in words which numbers they are, if not the objective and the limits themselves.
    """
    limits = [
        limit.text
        for limit, of_limit in zip(problem.limits, g, strict=True)
        if not np.isfinite(of_limit).all()
    ]
    objective = not np.isfinite(f).all()
    if not objective and not limits:
        return ""
    if objective and limits and len(limits) == len(problem.limits) and not what:
        return "no figure is finite"
    told = listed(["the objective"] * objective + ([limits_text(limits)] if limits else []))
    several = bool(what) or objective + len(limits) > 1
    return f"{what}{told} {'are' if several else 'is'} not finite"


def values_of(problem: Problem) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Figures f (n, k) and g (n, c) of any number of designs x (n, d), by one compiled program."""
    many = problem.many
    if many is not None:
        return lambda x: many(x, False).values
    compiled = quick_jit(
        lambda x: each(lambda one: problem.figures(one, problem.extra), [x], problem.order)
    )
    return lambda x: in_batches(compiled, x, WIDTH)


def _with_scales(limits: tuple[Limit, ...], seen: list[SqpSlopes]) -> tuple[Limit, ...]:
    """The limits, those without a scale with the median size of their g over designs seen."""
    sizes = np.abs([s.g for s in seen]).T
    medians = [float(np.median(x[np.isfinite(x)])) if np.isfinite(x).any() else 0.0 for x in sizes]
    return tuple(
        limit if limit.scale else limit._replace(scale=median or 1.0)
        for limit, median in zip(limits, medians, strict=True)
    )


class ProblemFigures:
    """f and g of a problem with their slopes; `size` is what f is measured in, `unit` the g.

    A limit without a scale gets one in `self.problem`: the median size of its g at the starts.
    """

    def __init__(self, problem: Problem, seed: int):
        self.problem, self.scale = problem, Ranges.of(problem.variables)
        self.bound = np.array([x.bound for x in problem.limits])
        self._slopes = quick_jit(self._with_slopes)
        self._known: dict[bytes, SqpSlopes] = {}
        self._values = values_of(problem)
        seen = self.slopes(start_shares(problem, 8, seed))
        f, g = (np.array([getattr(s, k) for s in seen]) for k in ("f", "g"))
        usable = np.asarray(np.isfinite(f).all(axis=1))
        once = np.where(np.isfinite(g).any(axis=0), 0.0, np.nan)
        if lost := not_finite(problem, f[np.argmax(usable)], once):
            raise InputError(f"{lost} at any start: widen or move the bounds.")
        seen = [s for s, good in zip(seen, usable, strict=True) if good]
        self.problem = problem._replace(limits=_with_scales(problem.limits, seen))
        self.unit = np.array([x.scale for x in self.problem.limits])
        sizes = [abs(self.combined(s.f)) for s in seen]
        if problem.floor and max(sizes) <= problem.floor:
            raise InputError(nothing_left(problem.name))
        self.size = float(np.median(sizes)) or 1.0
        self._check_influence(seen)

    def _parts(self, share):
        return self.problem.figures(self.scale.value(share), self.problem.extra)

    def _with_slopes(self, share):
        """f (k,), g (c,) and their slopes (k, d), (c, d) at one design."""

        (f, g), (df, dg) = value_and_jacobian(self._parts)(share)
        return f, g, df, dg

    def slopes(self, shares: np.ndarray) -> list[SqpSlopes]:
        """Figures and slopes of designs (n, d), each worked out once."""
        new = {x.tobytes(): x for x in shares if x.tobytes() not in self._known}
        if new:
            self._known |= zip(new, self._worked_out(np.array(list(new.values()))), strict=True)
        return [self._known[x.tobytes()] for x in shares]

    def _worked_out(self, shares: np.ndarray) -> list[SqpSlopes]:
        if self.problem.many is None:
            return [
                SqpSlopes(*(np.asarray(x) for x in self._slopes(jnp.asarray(share))))
                for share in shares
            ]
        x, rate = jax.jvp(self.scale.value, (jnp.asarray(shares),), (jnp.ones(shares.shape),))
        (f, g), (df, dg) = self.problem.many(np.asarray(x), True)
        rate = np.asarray(rate)[:, None]
        return [SqpSlopes(*parts) for parts in zip(f, g, df * rate, dg * rate, strict=True)]

    def scaled(self, limit: np.ndarray, at: Callable[[np.ndarray], SqpSlopes]) -> Scaled:
        """The problem under `limit` (c,) for quadratic programs that ask `at` for slopes."""
        return Scaled(at, limit, self.unit, self.size, self.problem.epigraph)

    def values(self, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Figures f (n, k) and g (n, c) of designs."""
        return self._values(np.asarray(self.scale.value(shares)))

    def combined(self, f: np.ndarray) -> np.ndarray | np.floating:
        """The objective of f (..., k)."""
        return f.max(axis=-1) if self.problem.worst else f.mean(axis=-1)

    def rank(self, shares: np.ndarray) -> Rank:
        """What designs are ranked by; a failed run is the worst."""
        f, g = self.values(shares)
        value = self.combined(f) / self.size
        over = np.maximum((g - self.bound) / self.unit, 0.0).sum(axis=1)
        over = np.where(np.isfinite(over) & np.isfinite(value), over, np.inf)
        return Rank(over, np.where(np.isfinite(value), value, np.inf))

    def _check_influence(self, seen: list[SqpSlopes]) -> None:
        """`InputError` for variables that nothing depends on."""
        moved = np.max([np.abs(s.df).max(axis=0) for s in seen], axis=0) / self.size
        for s in seen:
            sides = np.abs(s.dg / self.unit[:, None])
            moved = np.maximum(moved, sides.max(axis=0, initial=0.0))
        silent = [v.name for v, m in zip(self.problem.variables, moved, strict=True) if m <= SILENT]
        if silent:
            raise InputError(
                [f"`{n}` influences neither the objective nor a constraint: leave it out."
                 for n in silent]
            )  # fmt: skip
