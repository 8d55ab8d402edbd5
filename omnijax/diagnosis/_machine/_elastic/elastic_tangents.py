"""How dR and a change with the numbers of the elastic model alone: exact, run by run.

With y' = A y + B u and a number p of it, s = dy/dp obeys s' = A s + dA y + dB u.  In modes the part
dA y of the step from one sample to the next has the integrals of e^(a (h - t)) e^(b t), which are
divided differences of the exponential over two rates, and so with what the inputs push: divided
differences of their weights.  So one pass over the samples tells all numbers, where differences
ask for a whole run of each.

Source: Van Loan, Computing integrals involving the matrix exponential (1978); divided differences
as derivatives of functions of matrices: Higham, Functions of matrices (2008), chapter 3.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np

from ...._programs import kept
from ....dynamics import Coupled, linear_system
from ....rig import Rig
from ..._settings import SETTINGS
from .._laws import bare
from ..runs import Run
from .elastic import AT_REST, OUTPUTS, ElasticPorts, linear_states
from .late import behind, between, continued, part_weights, pushed_within
from .modes import OutputModes, acts, hold_weights, propagate, real_pairs, weighted

# by number of a wheel: where it stands in the wheels
NUMBERS = ("contact.stiffness", "contact.damping", "mount.stiffness", "mount.damping")
APART = SETTINGS.prediction.rates_apart

Weights = Callable[[np.ndarray], np.ndarray]  # (points, rates) of rates


class ModeChanges(NamedTuple):
    """What a unit of each of P numbers changes in the elastic model, A and B in modes.

    `mixed` (P, k, 2 k) is of the rates of the states by those of the kept modes and by their
    conjugates, where these are others.
    """

    mixed: np.ndarray  # (P, k, 2 k)
    gains: np.ndarray  # (P, k, u)
    C: np.ndarray  # (P, 6, m), of dR and a
    D: np.ndarray  # (P, 6, u)


def elastic_number(rig: Rig, name: str) -> tuple[str, int] | None:
    """The parameter `name` as (one of `NUMBERS`, wheel), or None where it is another one."""
    head, _, rest = name.partition(".")
    wheel, _, key = rest.partition(".")
    if head != "wheel" or key not in NUMBERS:
        return None
    return key, rig.names.index(wheel)


@kept
def _derivatives(rig: Rig):
    """dA, dB, dC, dD (.., n) by each of the `NUMBERS`, of every wheel."""

    def numbers(rig: Rig):
        w = rig.wheels
        return w.contact.stiffness, w.contact.damping, w.mount.stiffness, w.mount.damping

    def system(values):
        linear = linear_system(Coupled(eqx.tree_at(numbers, rig, values)))
        return linear.A, linear.B, linear.C, linear.D

    return jax.jacfwd(system)(numbers(rig))


def mode_changes(m: OutputModes, rig: Rig, numbers: list[tuple[str, int]]) -> ModeChanges:
    """The changes by numbers as (one of `NUMBERS`, wheel)."""
    which = [(NUMBERS.index(name), i) for name, i in numbers]
    by_number = [
        np.stack([np.asarray(part[k])[..., i] for k, i in which])
        for part in _derivatives(bare(rig))
    ]
    dA, dB, dC, dD = by_number
    pushed = dB[:, :, m.inputs["drive"]]
    dB = np.concatenate([dB, pushed], axis=2)
    dD = np.pad(dD, ((0, 0), (0, 0), (0, rig.size)))
    rows = np.concatenate([np.arange(dC.shape[1])[m.outputs[name]] for name in OUTPUTS])
    both = np.concatenate([_halved(m), np.conj(_halved(m))], axis=1)
    both[:, len(m.rates) :][:, np.imag(m.rates) == 0] = 0.0
    return ModeChanges(m.inverse @ dA @ both, m.inverse @ dB, dC[:, rows], dD[:, rows])


def _halved(m: OutputModes) -> np.ndarray:
    """Shapes (m, k) of the kept modes as of all modes: `shapes` counts those of pairs twice."""
    return m.shapes / np.where(np.imag(m.rates) > 0, 2.0, 1.0)


def _divided(function: Weights, rates: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Divided differences (points, k, f) of `function` between `rates` (k,) and `others` (f,)."""
    middle, half = (rates[:, None] + others) / 2, (rates[:, None] - others) / 2
    least = APART * np.abs(rates).max()
    half = np.where(np.abs(half) < least, least, half)
    ends = [function((middle + sign * half).ravel()) for sign in (1, -1)]
    return (ends[0] - ends[1]).reshape(-1, *half.shape) / (2 * half)


class _SpanChanges(NamedTuple):
    """What the modal states that begin a span, and inputs in it, make of s at its end."""

    of_states: np.ndarray  # (2 k, 2 P k): pairs of numbers
    of_inputs: dict[str, np.ndarray]  # (points, c, 2 P k)

    @staticmethod
    def over(m: OutputModes, d: ModeChanges, span: float, weights: Mapping[str, Weights]):
        """Over `span` s, the `weights` of each input's points."""
        every = np.concatenate([m.rates, np.conj(m.rates)])
        gains = np.concatenate([m.gains, np.conj(m.gains)])
        k = len(m.rates)
        (held,) = _divided(lambda r: np.exp(r * span)[None], m.rates, every)
        mixed = d.mixed * held  # (P, k, 2 k): of z and of its conjugate
        of_real, of_imaginary = (
            mixed[..., :k] + mixed[..., k:],
            1j * (mixed[..., :k] - mixed[..., k:]),
        )
        pairs = np.stack([of_real, of_imaginary], axis=-1)  # (P, k, k, 2)
        of_states = real_pairs(pairs.reshape(-1, 2 * k).T)
        of_inputs = {}
        for name, function in weights.items():
            part = m.inputs[name]
            table = np.einsum("pkf,fc,jkf->jcpk", d.mixed, gains[:, part],
                              _divided(function, m.rates, every), optimize=True)  # fmt: skip
            table = table + np.einsum("pkc,jk->jcpk", d.gains[:, :, part], function(m.rates))
            of_inputs[name] = real_pairs(table.reshape(*table.shape[:2], -1))
        return _SpanChanges(of_states, of_inputs)

    def forcing(self, z: np.ndarray, inputs: Mapping[str, np.ndarray]) -> np.ndarray:
        """(spans, 2 P k) of the states (spans, k) that begin the spans, one sample each."""
        count = len(z)
        out = np.ascontiguousarray(z).view(float) @ self.of_states
        for name, values in inputs.items():
            out += weighted(values, count, self.of_inputs[name])
        return out


class ElasticTangents:
    """d (dR, a) by P numbers of the elastic model of one run, at any lateness."""

    def __init__(
        self, m: OutputModes, d: ModeChanges, run: Run, ports: ElasticPorts,
        rolling: np.ndarray | None,
    ):  # fmt: skip
        self.m, self.d, self.run = m, d, run
        self.inputs = {name: x for name, x in ports.by_name().items() if acts(x)}
        self.z = linear_states(m, run, ports, 1, rolling)
        intervals = run.samples - 1
        weights = {
            name: lambda r, parts=(len(x) - 1) // intervals: hold_weights(r, run.step, parts)
            for name, x in self.inputs.items()
        }
        passed = _SpanChanges.over(m, d, run.step, weights)
        forcing = passed.forcing(self.z[:-1], self.inputs).view(complex)
        start = self._rest()
        P, k = len(d.mixed), len(m.rates)
        forcing = forcing.reshape(intervals, P, k)
        self.s = np.stack([propagate(m, run.step, forcing[:, p], start[p]) for p in range(P)], 1)

    def _rest(self) -> np.ndarray:
        """Changes (P, k) of the modal state at rest under the inputs' first points."""
        m, u = self.m, np.zeros(self.m.B.shape[1])
        for name in AT_REST:
            if name in self.inputs:
                u[m.inputs[name]] = self.inputs[name][0]
        z = -(m.gains @ u) / m.rates
        pulled = self.d.mixed @ np.concatenate([z, np.conj(z)]) + self.d.gains @ u
        return -pulled / m.rates

    def changes(self, late: float) -> np.ndarray:
        """d (dR, a) (P, samples, 6) as read so many s late, before the start as at it.

        Early by less than a sample, for nothing was followed behind the end.
        """
        m, run = self.m, self.run
        if late == 0:
            inputs = {n: x[:: (len(x) - 1) // (run.samples - 1)] for n, x in self.inputs.items()}
            return self._shown(self.z, self.s, inputs)
        back, part, count = behind(run, late)
        inputs = {n: continued(x, run.samples - 1, count) for n, x in self.inputs.items()}
        z, s = self.z[:count], self.s[:count]
        weights = {
            name: lambda r, points=(len(x) - 1) // count: part_weights(r, run.step, points, part)
            for name, x in inputs.items()
        }
        passed = _SpanChanges.over(m, self.d, part * run.step, weights)
        pushed = passed.forcing(z, inputs).view(complex).reshape(s.shape)
        ahead = np.exp(m.rates * part * run.step)
        there = ahead * z
        for name, x in inputs.items():
            there = there + pushed_within(m, name, x, run.step, count, part).view(complex)
        here = {name: between(x, count, part) for name, x in inputs.items()}
        out = self._shown(there, ahead * s + pushed, here)
        begin = {name: x[:1] for name, x in inputs.items()}
        first = self._shown(z[:1], s[:1], begin)
        first = np.repeat(first, max(0, back), axis=1)
        return np.concatenate([first, out], axis=1)[:, : run.samples]

    def _shown(self, z, s, inputs: Mapping[str, np.ndarray]) -> np.ndarray:
        """d (dR, a) (P, t, 6) of states z (t, k), their changes s (t, P, k) and inputs (t, c)."""
        m = self.m
        C = m.out(OUTPUTS)[0] @ m.shapes
        y = np.real(z @ m.shapes.T)
        out = np.real(np.moveaxis(s, 1, 0) @ C.T) + y @ np.swapaxes(self.d.C, 1, 2)
        for name, x in inputs.items():
            D = self.d.D[:, :, m.inputs[name]]
            if D.any():
                out += x @ np.swapaxes(D, 1, 2)
        return out
