"""A rig and its runs as a model: residuals of every channel for any rig with any laws."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from ...rig import Rig
from .._threads import each
from .data_vector import Rows
from .elastic import OUTPUTS, SIGNALS, Ports, felt, linear_states, outputs_of, refine, rig_modes
from .laws import along
from .modes import Modes
from .motion import (
    Motion,
    contact_directions,
    integrate,
    measured_lengths,
    motion,
    sensor_change,
    smooth_about,
    tables_for,
)
from .noise_model import rolling_state, rows_of
from .observer import TURNING, needs_observer, observed_turning, path_along
from .ports import bare
from .rotation import Turning, base_torques, turning
from .runs import FINE, SHAPE, STEPS, Run
from .stage_cache import Kept
from .stepped import Lane, law_changes, stepped_ports
from .tree_hash import digest, rounded


@dataclasses.dataclass(frozen=True)
class Rotated:
    """Rotation of one run: drive forces, Omega and rolled lengths from the torques alone."""

    motion: Motion
    turning: Turning
    drive: np.ndarray  # (FINE points, n) N
    acceleration: np.ndarray  # (FINE points, 3) rad/s^2
    Omega: np.ndarray  # (samples, 3) rad/s, from Omega = 0 at the start
    length: np.ndarray  # (samples, n) rad, what S(theta) should be


class Machine:
    """Residuals of a rig against its runs; every stage is kept for the last few rigs asked for."""

    def __init__(self, rig: Rig, runs: list[Run], noise: dict[str, float], window: float = 1.0):
        self.rig, self.runs, self.noise = rig, runs, noise
        radius = np.asarray(rig.wheels.radius) / float(rig.sphere.radius)
        self.length_noise = noise.get("theta", 1e-4) * radius
        self.references: list[np.ndarray] | None = None
        self.ratios: list[float | None] = [None] * len(runs)
        self._normal: dict[int, np.ndarray] = {}  # N of the last rig: where the next one starts
        self._kept = Kept()
        self.window = window
        self.rows: list[Rows] = []
        self._rolling: dict[int, np.ndarray] = {}  # elastic states of runs that begin rolling
        self.rebase(rig)

    def rebase(self, rig: Rig) -> None:
        """Smooth the angles anew, about what `rig` predicts from the torques.

        Friction hangs on the motion itself: then again until the prediction stays.
        """
        self._kept.forget()
        self.references = None
        self.ratios = [None] * len(self.runs)
        for _ in range(4 if needs_observer(rig) else 1):
            found = [r.length for r in self.rotated(rig).values()]
            change = [] if self.references is None else [
                np.std(new - old, axis=0).max()
                for new, old in zip(found, self.references, strict=True)
            ]  # fmt: skip
            self._kept.forget()
            self.references = found
            self.ratios = [None] * len(self.runs)
            if change and max(change) < 0.3 * self.length_noise.min():
                break
        self.motions(rig)
        self.rows = each(lambda i: rows_of(self, rig, i), range(len(self.runs)))
        rolling = [i for i, run in enumerate(self.runs) if run.rolling_start(self.noise)]
        found = each(lambda i: rolling_state(self, rig, i), rolling)
        for i, state in zip(rolling, found, strict=True):
            self._rolling[i] = self._rolling.get(i, 0.0) + state
        if rolling:
            self._kept.forget()

    @property
    def rolls(self) -> bool:
        """Whether a run begins while the sphere turns."""
        return bool(self._rolling)

    def replace(self, i: int, run: Run) -> None:
        """Put another record in the place of run `i`, its angles about the same reference."""
        self.runs = [*self.runs[:i], run, *self.runs[i + 1 :]]
        self._kept.forget()

    def _by_run(self, stage: str, key: bytes, make: Callable[[int], Any], which) -> dict[int, Any]:
        """`make(i)` of the runs `which` (None: all), kept under the stage."""
        wanted = range(len(self.runs)) if which is None else which
        made = each(lambda i: self._kept.get(stage, key + bytes([i]), lambda: make(i)), wanted)
        return dict(zip(wanted, made, strict=True))

    # --- stages -------------------------------------------------------------------------------
    def motions(self, rig: Rig, which=None) -> dict[int, Motion]:
        """Motion of every run behind the measured angles."""
        key = self._motion_key(rig)
        return self._by_run("motion", key, lambda i: self._motion(rig, i), which)

    def _motion_key(self, rig: Rig) -> bytes:
        w = rig.wheels
        return digest(
            rig.sphere,
            w.normal,
            w.drive,
            w.radius,
            w.rollers,
            w.roundness,
            rig.profiles,
            rig.at("shape"),
            rig.at("kinematics"),
            tuple(p for p in rig.at("sensor") if p.place.startswith("theta")),
        )

    def _motion(self, rig: Rig, i: int) -> Motion:
        tables, run = self.tables_of(rig), self.runs[i]
        length = measured_lengths(rig, tables, run)
        about = np.zeros_like(length) if self.references is None else self.references[i]
        sigma = float(np.mean(self.length_noise))
        smoothed, self.ratios[i] = smooth_about(length, about, sigma, self.ratios[i])
        return motion(rig, tables, run, length, smoothed)

    def modes(self, rig: Rig) -> Modes:
        """The elastic model's modes."""
        key = digest(rig.sphere, rig.platform, rig.wheels)
        return self._kept.get("modes", key, lambda: rig_modes(rig))

    def rotated(self, rig: Rig, which=None) -> dict[int, Rotated]:
        """Rotation of every run under the torques."""
        w = rig.wheels
        rolling = rig.at("rolling")
        parts = [rig.sphere, rig.platform, w.normal, w.drive, w.radius, w.inertia, rig.profiles,
                 w.rollers, w.roundness, rig.at("shape"), rig.at("kinematics"), rig.at("shaft"),
                 rolling, rig.at("sphere"),
                 tuple(p for p in rig.at("sensor") if p.place.startswith("theta"))]  # fmt: skip
        if rolling:  # N enters: to about 2 % of stiffness and damping
            parts.append(rounded((w.contact, w.mount, w.closure)))
        key = digest(*parts)
        return self._by_run("rotated", key, lambda i: self._rotated(rig, i), which)

    def _rotated(self, rig: Rig, i: int) -> Rotated:
        run, m = self.runs[i], self.motions(rig, [i])[i]
        key = self._motion_key(rig) + digest(rig.wheels.inertia) + bytes([i])
        response = self._kept.get("turning", key, lambda: turning(rig, m))
        torque = refine(run.torque, FINE)
        longest = max(r.samples for r in self.runs)
        path = None
        if needs_observer(rig):
            key += digest(rig.platform.gravity)
            path = self._kept.get(
                "path", key, lambda: path_along(rig, m, response, torque, longest)
            )
        turns = 1 if not rig.at("rolling") else 4 if i not in self._normal else 2
        preload = np.broadcast_to(np.asarray(rig.wheels.closure.preload), m.theta.shape)
        normal = self._normal.get(i, preload)
        for turn in range(turns):
            if path is not None:
                rest = not run.rolling_start(self.noise)
                laws = bare(rig, *TURNING)
                Omega, speed = observed_turning(laws, m, path, normal, run.step, rest)
                moving = dataclasses.replace(m, turning=Omega, speed=speed)
            else:
                moving = m
            shaft, opposing = base_torques(rig, moving, torque, normal)
            drive, rate = response.respond(shaft, opposing)
            if turn < turns - 1:
                self._normal[i] = normal = self.normal_force(rig, i, m, drive)
        return self._integrated(run, m, response, drive, rate)

    def _integrated(self, run, m: Motion, response: Turning, drive, rate) -> Rotated:
        h = run.step / FINE
        Omega = integrate(rate, h)
        rolled = np.einsum("tij,tj->ti", m.axes, Omega)
        creep = (m.factor - 1) * m.speed * (m.shape + np.asarray(self.rig.wheels.radius))
        creep = creep / float(self.rig.sphere.radius)
        length = integrate(rolled - creep, h)[::FINE]
        return Rotated(m, response, drive, rate, Omega[::FINE], length)

    def ports(self, rig: Rig, run: Run, m: Motion, drive) -> Ports:
        """Inputs of the elastic model."""
        shape = self.tables_shape(rig, m)
        return Ports(shape, drive, run.force, self._floor(rig, run))

    def tables_shape(self, rig: Rig, m: Motion) -> np.ndarray:
        """rho and the sphere's surface at SHAPE points."""
        shape = m.rho
        if rig.at("surface"):
            shape = shape + refine(self.surface(rig, m), SHAPE // FINE)
        return shape

    def tables_of(self, rig: Rig):
        """Wheel tables of a rig (kept with its motions)."""
        w = rig.wheels
        key = b"t" + digest(
            rig.sphere.radius, w.radius, w.rollers, w.roundness, rig.profiles, rig.at("shape")
        )
        return self._kept.get("motion", key, lambda: tables_for(rig, self.runs))

    def surface(self, rig: Rig, m: Motion) -> np.ndarray:
        """What the laws at the sphere's surface add to rho, (FINE points, n) m."""
        directions = contact_directions(rig, m)
        total = np.zeros(m.theta.shape)
        for placed in rig.at("surface"):
            for i in range(rig.size):
                total[:, i] += along(placed.law, np.ascontiguousarray(directions[:, i]))
        return total

    def _floor(self, rig: Rig, run: Run) -> np.ndarray:
        time = run.fine(FINE)
        floor = np.zeros((len(time), 3))
        for placed in rig.at("platform"):
            floor += along(placed.law, time)
        return floor

    def signals(self, rig: Rig, i: int, ports: Ports) -> np.ndarray:
        """Linear port signals (FINE points, 4 n): deflection and rate of contacts, of mounts."""
        m = self.modes(rig)
        z = linear_states(m, self.runs[i], ports, FINE, self._rolling.get(i))
        return felt(m, z, ports, self.motions(rig, [i])[i].shape_rate, SIGNALS, FINE)

    def shape_rate(self, rig: Rig, m: Motion, parts: int) -> np.ndarray:
        """d rho/dt (t, n) of the wheels' shapes at `parts` points a sample."""
        slope = self.tables_of(rig).rho_slope(m.theta_shape[:: SHAPE // parts])
        return slope * refine(m.speed, parts // FINE)

    def normal_force(self, rig: Rig, i: int, m: Motion, drive) -> np.ndarray:
        """N (FINE points, n) of the linear elastic model."""
        s = self.signals(rig, i, self.ports(rig, self.runs[i], m, drive))
        deflection, rate, _, _ = np.split(s, 4, axis=1)
        w = rig.wheels
        pull = np.asarray(w.contact.stiffness) * deflection + np.asarray(w.contact.damping) * rate
        return np.asarray(w.closure.preload) - pull

    # --- predictions --------------------------------------------------------------------------
    def elastic(self, rigs: list[Rig], which: list[int]) -> list[list[np.ndarray]]:
        """dR and a (samples, 6) before the sensors: per rig, per run of `which`."""
        found = each(lambda i: self._elastic(rigs, i, STEPS), which)
        return [list(row) for row in zip(*found, strict=True)]

    def _elastic(self, rigs: list[Rig], i: int, steps: int) -> list[np.ndarray]:
        """dR and a (samples, 6) of one run before the sensors, per rig; laws take `steps` each."""
        out, lanes, places = [], [], []
        linear: dict[tuple, tuple] = {}  # rigs that differ in stepped laws only share the rest
        for rig in rigs:
            m, rotated, stepped = self.modes(rig), self.rotated(rig, [i])[i], stepped_ports(rig)
            key = (id(m), id(rotated), digest(rig.at("surface"), rig.at("platform")), stepped)
            if key not in linear:  # with what the key names, so that it stays alive
                linear[key] = (m, rotated, self._linear(rig, i, rotated, stepped, steps))
            *_, (outputs, signals) = linear[key]
            if stepped:
                lanes.append(Lane(rig, m, self.runs[i], signals))
                places.append(len(out))
            out.append(outputs)
        for at, change in zip(places, law_changes(lanes), strict=True):
            out[at] = out[at] + change
        return out

    def _linear(self, rig: Rig, i: int, rotated: Rotated, stepped: tuple[str, ...], steps: int):
        """dR and a (samples, 6) of the linear model; what the ports `stepped` feel at the steps."""
        ports, m = self.ports(rig, self.runs[i], rotated.motion, rotated.drive), self.modes(rig)
        parts = steps if stepped else 1
        z = linear_states(m, self.runs[i], ports, parts, self._rolling.get(i))
        out = outputs_of(m, z[::parts], ports, OUTPUTS)
        if not stepped:
            return out, np.zeros((0, 0))
        rate = self.shape_rate(rig, rotated.motion, parts)
        return out, felt(m, z, ports, rate, stepped, parts)

    def residuals(self, rigs: list[Rig], which: list[int], steps: int = STEPS) -> list[np.ndarray]:
        """Whitened rows of measured less predicted, per rig, over the runs of `which`.

        Laws at contacts and mounts take `steps` a sample.  Rows of a rig that runs away are not
        finite, and so is its cost.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            return self._residuals(rigs, which, steps)

    def _residuals(self, rigs, which, steps):
        parts = each(lambda i: self._run_residuals(rigs, i, steps), which)
        return list(np.concatenate(parts, axis=1))

    def _run_residuals(self, rigs: list[Rig], i: int, steps: int) -> np.ndarray:
        """Whitened rows (rigs, rows) of one run."""
        rows = self.rows[i]

        def one(rig: Rig, predicted: np.ndarray) -> np.ndarray:
            rotated = self.rotated(rig, [i])[i]
            return rows.vector(*self.residual_tables(rig, i, predicted, rotated))

        predictions = self._elastic(rigs, i, steps)
        table = np.stack(each(lambda k: one(rigs[k], predictions[k]), range(len(rigs))))
        rows.take_off(table)
        return table

    def residual_tables(self, rig: Rig, i: int, pred, rotated: Rotated):
        """(elastic (t, 6), rotation (t, 3 + n)): measured less predicted, not whitened."""
        run = self.runs[i]
        missing = np.full((run.samples, 3), np.nan)
        elastic = []
        for group, part in (("dR", pred[:, :3]), ("a", pred[:, 3:])):
            predicted = part + sensor_change(rig, group, run.time, part)
            elastic.append(run.outputs.get(group, missing) - predicted)
        turning_rate = rotated.motion.turning[::FINE]
        Omega = rotated.Omega + sensor_change(rig, "Omega", run.time, turning_rate)
        rotation = [
            run.outputs.get("Omega", missing) - Omega,
            rotated.motion.length - rotated.length,
        ]
        return np.concatenate(elastic, axis=1), np.concatenate(rotation, axis=1)
