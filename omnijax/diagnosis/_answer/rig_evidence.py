"""The sphere on its wheels as evidence."""

import numpy as np

from .._machine import RigModel
from .._search import locate
from .evidence import AbstractEvidence
from .gap import UNITS, gaps, group_squares


class RigEvidence(AbstractEvidence):
    """A `RigModel` with its held-out runs."""

    model: RigModel

    def __init__(self, model: RigModel, noise: dict, faults: list[str]):
        self.model, self.noise, self.faults = model, noise, faults

    @property
    def rows(self):
        """Rows of the held-out runs."""
        return [self.model.machine.rows[i] for i in self.model.splits["held-out"]]

    def squares(self, residual):
        return group_squares(self.rows, residual)

    def gaps(self, before, after):
        return gaps(self.rows, {g: t["sigma"] for g, t in self.noise.items()}, before, after)

    def locate(self, point):
        return locate(self.model, point)

    def learn(self, fit, tell):
        from .learned import learn

        learned = learn(self.model, fit, tell)
        self.model.rebase(fit.point)
        return learned

    def experiment(self, rivals):
        from .experiment import next_experiment

        return next_experiment(self.model, rivals)

    def described(self, point):
        return self.model.rig_at(point)

    def remarks(self):
        return [
            "Wheel angles are the smoothed measured ones; Omega and the rolled lengths are "
            f"predicted from the torques in windows of {self.model.machine.window:g} s, each with "
            "a free start."
        ]

    def series(self, residual):
        rows = self.rows[0]
        table = np.concatenate(rows.split(residual[: rows.size]), axis=1)
        run = self.model.machine.runs[self.model.splits["held-out"][0]]
        names = [f"{g}_{c}" for g in ("dR", "a", "Omega") for c in "xyz"]
        names += [f"theta_{k + 1}" for k in range(table.shape[1] - 9)]
        return run.name, run.time, dict(zip(names, table.T, strict=True))

    def reported(self, effect):
        """Of a Hertz contact the modulus E' = 0.75 c / sqrt(R') that its tangent stands for."""
        if effect.id != "contact-hertz":
            return {}
        rig = self.model.rig
        w, sphere = rig.wheels, rig.sphere
        K, N0 = np.asarray(w.contact.stiffness), np.asarray(w.closure.preload)
        reach = 1.5 * N0 / K
        radius = rig.wheel_radius
        curvature = np.asarray(sphere.radius * radius / (sphere.radius + radius))
        modulus = 0.75 * N0 / reach**1.5 / np.sqrt(curvature)
        here = effect.place in rig.names
        chosen = modulus[rig.names.index(effect.place)] if here else modulus.mean()
        return {
            "exponent": {"value": 1.5, "sigma": None, "unit": "1"},
            "modulus": {"value": float(chosen), "sigma": None, "unit": "Pa"},
        }

    def unit(self, unit, place):
        """A parameter's unit; a sensor's is that of its channel."""
        return unit.replace("unit of the channel", UNITS.get(place.split("_", maxsplit=1)[0], "1"))
