"""The sphere on its wheels as evidence."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..._text import listed, quantity_text
from ...dynamics import contact_signals
from ...laws import AbstractLaw, ContactHertz, one_a_place
from ...rig import rig_text
from .._machine import (
    CLOCK,
    READ_LATE,
    RigModel,
    beside_mean,
    held_law,
    locate,
    said_of_outliers,
    without_encoder,
)
from .._settings import SETTINGS
from .channels import channel_index, channel_names
from .evidence import AbstractEvidence, Unlisted
from .gap import UNITS

CLOCK_SIGMAS = SETTINGS.rig_evidence.clock_sigmas


class RigEvidence(AbstractEvidence):
    """A `RigModel` with its held-out runs."""

    model: RigModel
    reweighs = True
    asks_all = True
    without_term = (
        "No learned term at contacts, mounts, shafts, wheels, sphere or sensors foretells what was "
        "not fitted better than none does.",
    )

    def __init__(
        self, model: RigModel, noise: Mapping[str, Any], faults: list[str], confirmed_on="held-out"
    ):
        self.model, self.noise, self.faults = model, noise, faults
        self.confirmed_on = confirmed_on
        self._located: dict[tuple[str, int], tuple[Any, ...]] = {}  # by split and run
        self._unlisted: dict[bytes, list[Unlisted]] = {}  # by the point asked for last

    @property
    def rows(self):
        """Rows of the held-out runs."""
        return [self.model.machine.rows[i] for i in self.model.splits["held-out"]]

    def columns(self, residual, split):
        out, at = [], 0
        for i in self.model.splits[split]:
            size = self.model.machine.rows[i].size
            out.append(self._channels(i, residual[at : at + size]))
            at += size
        return out

    def steps(self, split):
        return [self.model.machine.runs[i].step for i in self.model.splits[split]]

    def recorded(self):
        runs = [self.model.machine.runs[i] for i in self.model.splits["held-out"]]
        return [(run.name, run.time) for run in runs]

    def _channels(self, i: int, residual: np.ndarray) -> dict[str, np.ndarray]:
        """Whitened residuals of run `i` by channel; what was fitted to every window counts."""
        rows = self.model.machine.rows[i]
        tables = [np.array(t) for t in rows.split(residual)]
        for table, weight in zip(tables, (rows.elastic, rows.rotation), strict=True):
            table[weight == 0] = np.nan
        counted = max(1, int((rows.rotation > 0).any(axis=1).sum()))
        free = sum(part.start >= rows.elastic.size for part, _ in rows.nuisance)
        tables[1] *= np.sqrt(counted / max(1, counted - free))
        table = np.concatenate(tables, axis=1)
        names = channel_names(table.shape[1] - 9)
        return {c: x for c, x in zip(names, table.T, strict=True) if np.isfinite(x).any()}

    def assumed(self, channel):
        unit = UNITS[channel.partition("_")[0]]
        return dataclasses.asdict(self.noise[channel]) | {"unit": unit}

    def sigma(self, channel, split, run):
        group = channel.partition("_")[0]
        level = self.model.machine.runs[self.model.splits[split][run]].level(group)
        own = level if np.ndim(level) == 0 else np.asarray(level)[channel_index(channel)]
        return float(self.model.noise[group] * own)

    def unit_of(self, group):
        return UNITS[group]

    def subsystem(self, channel):
        return "elastic" if channel.startswith(("dR", "a")) else "rotation"

    def beside_starts(self, point):
        return self.model.turning_levels(point)

    def renoised(self, levels):
        model = self.model.renoised(levels)
        return RigEvidence(model, self.noise, self.faults, self.confirmed_on)

    def readmitted(self, point):
        again = self.model.readmitted(point)
        if again is None:
            return None
        model, said = again
        before = said_of_outliers(self.model.machine.runs)
        kept = [fault for fault in self.faults if fault not in before]
        return RigEvidence(model, self.noise, [*kept, *said], self.confirmed_on)

    def parted(self):
        by_parts = self.model.parted() if self.confirmed_on == "held-out" else None
        if by_parts is None:
            return None
        model, said = by_parts
        return RigEvidence(model, self.noise, [*self.faults, *said], "blocks")

    def locate(self, point, split="held-out", run=0):
        """A run's last answer again, where point and basis are those of it.

        Fitted runs are asked without held-out ones, whose gap may be what the fit leaves open.
        """
        splits, basis = self.model.splits, self.model.machine.basis
        i, fitted = splits[split][run], split == "train"
        beside = sorted(splits[split] if fitted else {k for runs in splits.values() for k in runs})
        asked = point.u.tobytes(), repr(point.effects)
        last = self._located.get((split, i))
        if last is None or last[0] is not basis or last[1] != asked:
            answer = locate(self.model, point, i, beside)
            self._located[split, i] = last = basis, asked, answer
        return last[2]

    def learn(self, fit, scores, tell):
        from ._learned import learn

        learned = learn(self.model, fit, scores, tell)
        self.model.rebase(fit.point)
        return learned

    def misshapen(self, fit):
        from ._learned import misshapen

        return misshapen(self.model, fit, self.alike)

    def unlisted(self, fit):
        from .unlisted import unlisted

        asked = fit.point.u.tobytes()
        if asked not in self._unlisted:
            self._unlisted = {asked: unlisted(self.model, fit, self.closing)}
        return self._unlisted[asked]

    def experiment(self, rivals):
        from .experiment import next_experiment

        return next_experiment(self.model, rivals)

    def described(self, point):
        rig = self.model.rig_at(point, clocks=False)
        return rig.with_effects(one_a_place(rig.effects))

    def text(self, described):
        return rig_text(described)

    def beside_held(self, point):
        known = [(e, held_law(self.model.rig, e.id, e.place)) for e in point.effects]
        out = []
        for effect, held in known:
            if held is None:
                continue
            both = held_law(self.described(point), effect.id, effect.place)
            together = f": {_told(both)} together, as in its diagnosed file" if both else ""
            out.append(
                f"The rig file holds {effect.name} already, with {_told(held)}: what is told of it "
                f"comes beside that{together}."
            )
        return list(dict.fromkeys(out))

    def remarks(self):
        return [
            "Wheel angles are the smoothed measured ones; Omega and the rolled lengths are "
            f"predicted from the torques in windows of {self.model.machine.window:g} s, each with "
            "a free start.",
            *self._told_by_gaps(),
        ]

    def _told_by_gaps(self) -> list[str]:
        """What a phase counts from at wheels whose angle was not measured."""
        model = self.model
        blind = [without_encoder(run, model.rig.size) for run in model.machine.runs]
        wheels = [
            w for k, w in enumerate(model.rig.names) if any(k in missing for missing in blind)
        ]
        if not wheels:
            return []
        return [
            f"The angle of {' and '.join(wheels)} was not measured in every run: where such a "
            "wheel stood at the first sample is told by its gaps, to whole pitches. A phase or a "
            "roller's number there counts from a gap of that pitch, not from a mark on the wheel, "
            "and need not be the same in another run."
        ]

    def clocks(self, fit, open_=False):
        """An offset beside a gap that is left may stand for what is missing: it is no fact."""
        model, said = self.model, []
        covariance = fit.scaled_covariance(model.dof("train"))
        for group in READ_LATE:
            own = [k for k, p in enumerate(model.priors) if p.name.split(".")[:2] == [CLOCK, group]]
            if not own:
                continue
            sigma = np.array([model.priors[k].sigma for k in own])
            numbers = np.array([model.priors[k].at(fit.point.u[k]) for k in own])
            spread = covariance[np.ix_(own, own)] * np.outer(sigma, sigma)
            clear = np.abs(numbers) >= CLOCK_SIGMAS * np.sqrt(np.diag(spread))
            if not clear.any():
                continue
            ends = any(model.priors[k].at_bound(fit.point.u[k]) for k in own)
            runs = [""]
            if clear[1:].any():  # the loggers were started anew
                runs = [f" in {name}" for name in model.fitted[group]]
                table = beside_mean(len(own))
                numbers, spread = table @ numbers, table @ spread @ table.T
            by = listed([
                _lateness(late, None if ends or open_ else d) + run
                for late, d, run in zip(numbers, np.sqrt(np.diag(spread)), runs, strict=False)
            ])  # fmt: skip
            most = ", as far as clocks may be off" if ends else ""
            if open_:
                said.append(
                    f"{group} agrees best where it is taken as read {by} against angles and "
                    f"torques{most}: its logger's clock, or a part of the gap."
                )
            else:
                said.append(
                    f"{group} was read {by} against angles and torques{most}: its logger's clock, "
                    "calibrated."
                )
        return [*said, *self._own_clocks()]

    def _own_clocks(self) -> list[str]:
        """The offsets of clocks that were fitted to the runs that are not."""
        machine = self.model.machine
        own = [
            f"{machine.runs[i].name} ({', '.join(f'{g} {_lateness(d)}' for g, d in late.items())})"
            for i, late in sorted(machine.clocks.items()) if late
        ]  # fmt: skip
        if not own:
            return []
        return [
            "A logger may be started anew for every run, so the offsets of its clock in held-out "
            f"runs are fitted to these, as the state at a start is: {listed(own)}."
        ]

    def series(self, residual):
        rows = self.rows[0]
        table = np.concatenate(rows.split(residual[: rows.size]), axis=1)
        names = channel_names(table.shape[1] - 9)
        return (*self.recorded()[0], dict(zip(names, table.T, strict=True)))

    def reported(self, effect):
        """Of a Hertz contact the modulus E' = 0.75 c / sqrt(R') that its tangent stands for."""
        if effect.id != "contact-hertz":
            return {}
        rig, rest = self.model.rig, np.zeros(self.model.rig.size)
        law, signals = ContactHertz(), contact_signals(rig, rest, rest)
        modulus = np.asarray(law.effective_modulus(signals))
        here = effect.place in rig.names
        chosen = modulus[rig.names.index(effect.place)] if here else modulus.mean()
        return {
            "exponent": {"value": float(law.exponent), "sigma": None, "unit": "1"},
            "modulus": {"value": float(chosen), "sigma": None, "unit": "Pa"},
        }

    def unit(self, unit, place, key=""):
        """A parameter's unit; a sensor's is that of its channel."""
        return unit.replace("unit of the channel", UNITS.get(place.split("_", maxsplit=1)[0], "1"))


def _lateness(late: float, sigma: float | None = None) -> str:
    """An offset, s, with its 1-sigma in words: "0.2 ± 0.003 ms late"."""
    beside = "" if sigma is None else f" ± {1e3 * sigma:.1g}"
    return f"{round(1e3 * abs(late), 5):.3g}{beside} ms {'late' if late > 0 else 'early'}"


def _told(law: AbstractLaw) -> str:
    """The numbers of a law that are one each."""
    known = {k: p for k, p in law.parameters.items() if not p.shape}
    values = {k: getattr(law, k) for k in known}
    return ", ".join(
        f"{k} {quantity_text(float(v), known[k].unit)}" for k, v in values.items() if v is not None
    )
