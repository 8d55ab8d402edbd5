"""A rig and its runs as a model: residuals of every channel for any rig with any laws."""

import contextlib
import dataclasses
import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ...dynamics import TURNING_PORTS
from ...rig import Rig
from ...simulation import SENSOR_POINTS
from .._settings import SETTINGS
from .._threads import each
from ._elastic import (
    OUTPUTS,
    SIGNALS,
    Change,
    ElasticPorts,
    ElasticTangents,
    Lane,
    OutputModes,
    acts,
    approach_changes,
    elastic_ports,
    felt,
    finer,
    late_outputs,
    law_changes,
    law_pulls,
    linear_states,
    mode_changes,
    outputs_of,
    refine,
    rig_modes,
    stepped_ports,
)
from ._laws import folds, moving_readings, on_time, radii, readings, remembers
from ._motion import (
    RunMotion,
    WheelTables,
    angles_of,
    groups_of_motion,
    integrate,
    likeliest,
    measured_lengths,
    motion,
    rolling_radius,
    shares_behind,
    smooth,
    two_rows,
    wheel_tables,
)
from ._noise import DataRows, rolling_state, rows_of
from ._rotation import (
    MeasuredTurning,
    attitude_matters,
    commanded,
    held_turning,
    needs_observer,
    observed_turning,
    path_along,
    rotation_moments,
    run_torques,
    turning,
)
from .clocks import at_run, offset_of, only_delays
from .runs import ELASTIC, FINE, SHAPE, STEPS, Run
from .stage_cache import StageCache
from .tree_hash import digest

ANGLE_NOISE = SETTINGS.prediction.angle_noise
# ports whose laws move the contacts' normal forces, beside those of the motion
MOVING_N = ("surface", "platform", "contact", "separation", "mount")
OF_THE_RIG = ("tables", "modes")  # stages that hang on a rig, and on no run's start or basis
TABLES = 3  # of wheels that are kept: they are large where a shape differs from turn to turn
LINEAR = 3  # linear runs below stepped laws that are kept: they are large, 16 points a sample
READINGS = 4  # late ones of a run that are kept: two groups', each also a little later


@dataclasses.dataclass(frozen=True)
class Rotated:
    """Rotation of one run: drive forces, Omega and rolled lengths from the torques alone."""

    motion: RunMotion
    turning: MeasuredTurning
    drive: np.ndarray  # (FINE points, n) N
    jumps: np.ndarray  # (FINE points, n) N, what the integral of these points lacks
    acceleration: np.ndarray  # (FINE points, 3) rad/s^2
    Omega: np.ndarray  # (samples, 3) rad/s, from Omega = 0 at the start
    length: np.ndarray  # (samples, n) rad, what S(theta) should be
    # (FINE points, n) N, normal forces with which the laws at the contact patches were integrated
    normal: np.ndarray


class Predicted(NamedTuple):
    """What a rig foretells of one run before its sensors: small enough to be kept for many rigs."""

    elastic: np.ndarray  # (samples, 6) dR, a
    Omega: np.ndarray  # (samples, 3) rad/s, from the torques
    turning: np.ndarray  # (samples, 3) rad/s, from the angles
    # (samples, n) rad, rolled lengths measured less foretold, times the slope of the reading: noise
    # is that of the reading, and no law of the encoders makes it smaller
    missed: np.ndarray
    late: Callable[[float], np.ndarray]  # dR, a (samples, 6) so many s late

    @staticmethod
    def of(elastic: np.ndarray, rotated: Rotated, late) -> "Predicted":
        """From dR and a, and the rotation."""
        m = rotated.motion
        turning = np.array(m.turning[::FINE])  # not a view of the fine one
        missed = (m.length - rotated.length) * m.slope
        return Predicted(elastic, rotated.Omega, turning, missed, late)

    def changed(self, change: Change) -> "Predicted":
        """The prediction plus the change that laws stepped in time make."""
        late = self.late
        both = kept_for_loggers(lambda s: late(s) + change.late(s))
        return self._replace(elastic=self.elastic + change.now, late=both)

    def read(self, group: str, late: float) -> np.ndarray:
        """dR or a (samples, 3), `late` s after it was."""
        out = self.elastic if late == 0 else self.late(late)
        return out[:, :3] if group == "dR" else out[:, 3:]


@dataclasses.dataclass(frozen=True)
class Basis:
    """What predictions start from: made of the data and one rig by `Machine.rebase`, by run."""

    references: tuple[np.ndarray, ...] = ()  # (samples, n) rad, rolled lengths to smooth about
    ratios: tuple[float, ...] = ()  # noise over jerk of the smoothing
    normal: tuple[np.ndarray, ...] = ()  # (FINE points, n) N
    rolling: dict[int, np.ndarray] = dataclasses.field(default_factory=dict)  # elastic states
    # (FINE points, n) shares behind the switches of dual-row wheels; none: the angles tell the row
    shares: tuple[np.ndarray, ...] = ()


class Machine:
    """Residuals of a rig against its runs: functions of the rig, the runs and the `basis` alone.

    Every stage is kept for the last few rigs asked for, under all that it depends on.
    """

    def __init__(self, rig: Rig, runs: list[Run], noise: dict[str, float], window: float = 1.0,
                 about: Rig | None = None):  # fmt: skip
        """Prepared about a rig; by default the stated one."""
        self.rig, self.runs, self.noise = rig, runs, noise
        radius = radii(rig) / float(rig.sphere.radius)
        self.length_noise = noise.get("theta", ANGLE_NOISE) * radius
        self.basis = Basis()
        # s by run and group: offsets of the clocks of runs that are not fitted
        self.clocks: dict[int, dict[str, float]] = {}
        self._read_off_runs()
        self._kept = StageCache()
        self.window = window
        self.rows: list[DataRows] = []
        self.rebase(about or rig)

    def rebase(self, rig: Rig) -> None:
        """Smooth the angles anew, about what `rig` predicts from the torques.

        Friction hangs on the motion itself, and so does what encoders hide of it: then again until
        the prediction stays, each time under the normal forces that the last one ended with.

        Raises `FloatingPointError` where it runs away.
        """
        rolling = self.basis.rolling
        basis = self._basis(rig, None, rolling)
        again = needs_observer(rig) or folds(rig, "theta") or two_rows(rig)
        for _ in range(SETTINGS.prediction.rebase_turns if again else 1):
            self._begin(basis)
            rotated = self.rotated(rig)
            lengths = tuple(r.length for r in rotated.values())
            for run, length in zip(self.runs, lengths, strict=True):
                if not np.isfinite(length).all():
                    raise FloatingPointError(f"the prediction of {run.name} runs away")
            change = [
                np.std(new - old, axis=0).max()
                for new, old in zip(lengths, basis.references, strict=True)
            ]
            basis = self._basis(rig, lengths, rolling, tuple(r.normal for r in rotated.values()))
            if two_rows(rig):
                shares = tuple(self._shares(rig, i, r) for i, r in rotated.items())
                basis = dataclasses.replace(basis, shares=shares)
            if max(change) < SETTINGS.prediction.settled_noise * self.length_noise.min():
                break
        self._begin(basis)
        if rig.at("rolling"):  # else no N enters, and what was rotated stays
            rotated = self.rotated(rig, turns=SETTINGS.prediction.rebase_turns)
            basis = dataclasses.replace(basis, normal=tuple(r.normal for r in rotated.values()))
            # motions do not hang on N
            self._begin(basis, "driven", "rotated", "linear", "predicted")
        self.rows = each(lambda i: rows_of(self, rig, i), range(len(self.runs)))
        begin = [i for i, run in enumerate(self.runs) if run.rolling_start(self.noise)]
        states = each(lambda i: rolling_state(self, rig, i), begin)
        if begin:
            basis = dataclasses.replace(basis, rolling=dict(zip(begin, states, strict=True)))
            self._begin(basis, "rotated", "linear", "predicted")

    def _begin(self, basis: Basis, *stages: str) -> None:
        """Take another basis and drop the kept `stages` that depend on it (none given: all)."""
        self.basis = basis
        self._kept.forget(*stages, but=OF_THE_RIG)

    def _basis(self, rig: Rig, references, rolling, normal=None) -> Basis:
        """Smoothing about `references` (None: zero) as the data ask for it, N (None: preload)."""
        tables, sigma = self.tables_of(rig), float(np.mean(self.length_noise))
        if references is None:
            references = tuple(np.zeros((run.samples, rig.size)) for run in self.runs)

        def ratio(i: int) -> float:
            run, about = self.runs[i], references[i]

            def smoother(length: np.ndarray) -> np.ndarray:
                left = length - about
                return about + smooth(left, sigma, likeliest(left, sigma))[0]

            rolls, read = run.rolling_start(self.noise), self.at_run(rig, i)
            return likeliest(
                measured_lengths(read, tables, run, rolls, about, smoother) - about, sigma
            )

        ratios = each(ratio, range(len(self.runs)))
        if normal is None:
            preload = np.asarray(rig.wheels.closure.preload)
            normal = tuple(np.tile(preload, ((r.samples - 1) * FINE + 1, 1)) for r in self.runs)
        return Basis(references, tuple(ratios), normal, rolling)

    def _shares(self, rig: Rig, i: int, rotated: Rotated) -> np.ndarray:
        """Shares (FINE points, n) of one run behind the switches of dual-row wheels."""
        run, m = self.runs[i], rotated.motion
        foretold, rest = integrate(rotated.acceleration, m.step), not run.rolling_start(self.noise)
        Omega = held_turning(foretold, m.turning, m.step, rest)
        sigma = self.noise.get("theta", ANGLE_NOISE) * np.broadcast_to(run.level("theta"), rig.size)
        blur = SETTINGS.prediction.row_blur * sigma
        return shares_behind(rig, m.theta, rolling_radius(rig, m), Omega, blur, m.step)

    @property
    def rolls(self) -> bool:
        """Whether a run begins while the sphere turns."""
        return bool(self.basis.rolling)

    def replace(self, i: int, run: Run) -> None:
        """Put another record in the place of run `i`, its angles about the same reference."""
        self.runs = [*self.runs[:i], run, *self.runs[i + 1 :]]
        self._read_off_runs()
        self._kept.forget(but=OF_THE_RIG)

    def _read_off_runs(self) -> None:
        self._angles = angles_of(self.rig, self.runs)
        self._groups_of_motion = groups_of_motion(self.rig, self.runs)

    def at_run(self, rig: Rig, i: int) -> Rig:
        """The rig as run `i` is read, by its own offsets of the loggers' clocks."""
        return at_run(rig, i, self.clocks.get(i, {}))

    def tells_motion(self, group: str) -> bool:
        """Whether the motion is told by an output group."""
        return group in self._groups_of_motion

    def forget(self) -> None:
        """Work every stage out anew at the next question, about the same basis."""
        self._kept.forget()

    def aside(self) -> contextlib.AbstractContextManager[None]:
        """Within it nothing new is kept: rigs are asked for that nobody asks for again."""
        return self._kept.aside()

    def _by_run(self, stage: str, key: bytes, make: Callable[[int], Any], which) -> dict[int, Any]:
        """`make(i)` of the runs `which` (None: all), kept under the stage."""
        wanted = range(len(self.runs)) if which is None else which
        made = each(lambda i: self._kept.get(stage, key + self._name(i), lambda: make(i)), wanted)
        return dict(zip(wanted, made, strict=True))

    def _name(self, i: int) -> bytes:
        """What stands for run `i` in names of what is kept: the number, and its own offsets of the
        clocks by which it tells the motion."""
        own = {g: d for g, d in self.clocks.get(i, {}).items() if self.tells_motion(g)}
        return bytes([i]) + (digest(own) if own else b"")

    # --- stages -------------------------------------------------------------------------------
    def motions(self, rig: Rig, which=None) -> dict[int, RunMotion]:
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
            *(rig.at(port) for port in ("radius", "shape", "kinematics")),
            tuple(p for p in rig.at("sensor") if p.group in self._groups_of_motion),
        )

    def _motion(self, rig: Rig, i: int) -> RunMotion:
        tables, run, rig = self.tables_of(rig), self.runs[i], self.at_run(rig, i)
        rolls, about = run.rolling_start(self.noise), self.basis.references[i]
        sigma = float(np.mean(self.length_noise * run.level("theta")))

        def smoother(length: np.ndarray) -> np.ndarray:
            return about + smooth(length - about, sigma, self.basis.ratios[i])[0]

        length = measured_lengths(rig, tables, run, rolls, about, smoother)
        shares = self.basis.shares[i] if self.basis.shares else None
        return motion(rig, tables, run, length, smoother(length), rolls, shares)

    def modes(self, rig: Rig) -> OutputModes:
        """The elastic model's modes."""
        key = digest(rig.sphere, rig.platform, rig.wheels)
        return self._kept.get("modes", key, lambda: rig_modes(rig))

    def rotated(self, rig: Rig, which=None, turns: int = SETTINGS.prediction.normal_turns):
        """Rotation of every run under the torques; `turns` of N and f where N enters."""
        w = rig.wheels
        parts = [self._motion_key(rig), rig.platform, w.inertia]
        parts += [rig.at(port) for port in ("command", *TURNING_PORTS)]
        if rig.at("rolling"):  # N enters, and with it the elastic model and all that moves it
            parts += [w, turns, *(rig.at(port) for port in MOVING_N)]
        else:
            turns = 1
        key = digest(*parts)
        return self._by_run("rotated", key, lambda i: self._rotated(rig, i, turns), which)

    def _rotated(self, rig: Rig, i: int, turns: int) -> Rotated:
        run, m = self.runs[i], self.motions(rig, [i])[i]
        key = self._motion_key(rig) + digest(rig.wheels.inertia) + self._name(i)
        response = self._kept.get("turning", key, lambda: turning(rig, run, m))
        command, path = commanded(rig, run), None
        if needs_observer(rig):
            longest = max(r.samples for r in self.runs)
            about = key + digest(rig.platform.gravity, rig.at("command"), attitude_matters(rig))
            path = self._kept.get(
                "path", about, lambda: path_along(rig, m, response, command, longest)
            )

        def moved(normal: np.ndarray) -> RunMotion:
            if path is None:
                return m
            rest = not run.rolling_start(self.noise)
            Omega, speed = observed_turning(rig, m, path, normal, run.step, rest)
            return dataclasses.replace(m, turning=Omega, speed=speed)

        def under(normal: np.ndarray, moving: RunMotion):
            moments = rotation_moments(rig, moving, command, normal)
            _, caused = run_torques(rig, run, moments)
            return response.respond(caused.shaft, caused.opposing)

        def driven(normal: np.ndarray):
            return under(normal, moved(normal))

        normal = self.basis.normal[i]
        if turns == 1:
            drive, rate = driven(normal)
            return self._integrated(rig, run, m, response, drive, rate, normal)
        # under the N of the last rebase all rigs turn alike that differ in their elastic parts only
        ports = [rig.at(port) for port in ("command", *TURNING_PORTS)]
        key += digest(rig.platform, rig.wheels.contact.friction, *ports)
        drive, rate = self._kept.get("driven", key, lambda: driven(normal))
        jumps = np.asarray(rig.wheels.contact.damping) * m.missed_rate
        for _ in range(turns - 1):
            normal = self.normal_force(rig, i, m, drive) + jumps
            moving = moved(normal)
            drive, rate = under(normal, moving)
        now, _ = under(normal - jumps, moving)
        return self._integrated(rig, run, m, response, now, rate, normal, drive - now)

    def _integrated(
        self, rig, run, m: RunMotion, response: MeasuredTurning, drive, rate, normal, jumps=None
    ) -> Rotated:
        h = run.step / FINE
        Omega = integrate(rate, h)
        rolled = np.einsum("tij,tj->ti", m.axes, Omega)
        creep = (m.factor - 1) * m.speed * (m.shape + radii(rig))
        creep = creep / float(rig.sphere.radius)
        length = integrate(rolled - creep, h)[::FINE]
        jumps = np.zeros_like(drive) if jumps is None else jumps
        return Rotated(m, response, drive, jumps, rate, Omega[::FINE], length, normal)

    def ports(self, rig: Rig, i: int, rotated: Rotated) -> ElasticPorts:
        """Inputs of the elastic model in run `i`."""
        return elastic_ports(rig, self.runs[i], rotated.motion, rotated.drive, rotated.jumps)

    def tables_of(self, rig: Rig) -> WheelTables:
        """Wheel tables of a rig, for the angles of all runs."""
        w, angles = rig.wheels, self._angles
        key = digest(
            rig.sphere.radius,
            w.radius,
            w.rollers,
            w.roundness,
            rig.profiles,
            rig.at("shape"),
            rig.at("radius"),
            angles,
        )
        return self._kept.get("tables", key, lambda: wheel_tables(rig, *angles), TABLES)

    def signals(self, rig: Rig, i: int) -> np.ndarray:
        """Linear port signals (FINE points, 4 n): deflection and rate of contacts, of mounts."""
        m, rotated = self.modes(rig), self.rotated(rig, [i])[i]
        ports = self.ports(rig, i, rotated)
        z = linear_states(m, self.runs[i], ports, FINE, self.basis.rolling.get(i))
        return felt(m, z, ports, rotated.motion.shape_rate, SIGNALS, FINE)

    def shape_rate(self, rig: Rig, m: RunMotion, parts: int) -> np.ndarray:
        """d rho/dt (t, n) of the wheels' shapes at `parts` points a sample."""
        slope = self.tables_of(rig).rho_slope(m.theta_shape[:: SHAPE // parts])
        return slope * refine(m.speed, parts // FINE)

    def normal_force(self, rig: Rig, i: int, m: RunMotion, drive) -> np.ndarray:
        """N (FINE points, n) of the elastic model with the laws at its contacts and mounts."""
        run, contact, of_laws = self.runs[i], rig.wheels.contact, 0.0
        stepped, modes = stepped_ports(rig), self.modes(rig)
        ports = elastic_ports(rig, run, m, drive, np.zeros_like(drive))
        parts = STEPS if stepped else FINE
        z = linear_states(modes, run, ports, parts, self.basis.rolling.get(i))
        rate = self.shape_rate(rig, m, parts)
        approach = felt(modes, z, ports, rate, ("contact",), parts)
        if stepped:
            lane = Lane(rig, modes, run, felt(modes, z, ports, rate, stepped, parts))
            (pull,) = law_pulls([lane])
            approach += approach_changes(lane, pull)
            of_laws = pull.tensions.get("contact", of_laws)
        deflection, speed = np.split(approach, 2, axis=1)
        tension = np.asarray(contact.stiffness) * deflection + np.asarray(contact.damping) * speed
        pressed = np.asarray(rig.wheels.closure.preload) - tension - of_laws
        return np.ascontiguousarray(pressed[:: parts // FINE])

    # --- predictions --------------------------------------------------------------------------
    def elastic(self, rigs: list[Rig], which: list[int]) -> list[list[np.ndarray]]:
        """dR and a (samples, 6) before the sensors: per rig, per run of `which`."""
        rows = each(lambda i: [p.elastic for p in self.predicted(rigs, i)], which)
        return [list(row) for row in zip(*rows, strict=True)]

    def predicted(self, rigs: list[Rig], i: int, steps: int = STEPS) -> list[Predicted]:
        """What every rig foretells of run `i`; laws at contacts and mounts take `steps` a sample.

        Rigs that differ in what reads the outputs alone share one prediction.
        """
        own = self._name(i)
        names = [
            self._name_before_sensors(rig) + own + bytes([steps if stepped_ports(rig) else 1])
            for rig in rigs
        ]
        known = {name: self._kept.peek("predicted", name) for name in names}
        open_ = {name: rig for name, rig in zip(names, rigs, strict=True) if known[name] is None}
        for name, made in zip(open_, self._predicted([*open_.values()], i, steps), strict=True):
            known[name] = self._kept.get("predicted", name, lambda made=made: made)
        return [known[name] for name in names]

    def _name_before_sensors(self, rig: Rig) -> bytes:
        """A digest of all of a rig that its outputs hang on before they are read."""
        laws = [
            (p.law, p.wheels, p.place) for p in rig.effects
            if p.law.port != "sensor" or p.group in self._groups_of_motion
        ]  # fmt: skip
        return digest(rig.sphere, rig.platform, rig.wheels, rig.profiles, laws)

    def _predicted(self, rigs: list[Rig], i: int, steps: int) -> list[Predicted]:
        out, lanes, places = [], [], []
        linear: dict[bytes, tuple] = {}  # rigs that differ in stepped laws only share the rest
        for rig in rigs:
            m, rotated, stepped = self.modes(rig), self.rotated(rig, [i])[i], stepped_ports(rig)
            key = repr((id(m), id(rotated), stepped, steps)).encode() + self._name(i)
            key += digest(rig.at("surface"), rig.at("platform"))
            if key not in linear:  # with what the key names, so that it stays alive

                def made(rig=rig, m=m, rotated=rotated, stepped=stepped) -> tuple:
                    return m, rotated, self._linear(rig, i, rotated, stepped, steps)

                linear[key] = self._kept.get("linear", key, made, LINEAR) if stepped else made()
            *_, (outputs, signals, late) = linear[key]
            if stepped:
                lanes.append(Lane(rig, m, self.runs[i], signals))
                places.append(len(out))
            out.append(Predicted.of(outputs, rotated, late))
        for at, change in zip(places, law_changes(lanes), strict=True):
            out[at] = out[at].changed(change)
        return out

    def _linear(self, rig: Rig, i: int, rotated: Rotated, stepped: tuple[str, ...], steps: int):
        """dR and a (samples, 6) of the linear model; what the ports `stepped` feel at the steps.

        And what gives dR and a (samples, 6) so many s late.
        """
        run, m, parts = self.runs[i], self.modes(rig), steps if stepped else 1
        ports = self.ports(rig, i, rotated)
        z = linear_states(m, run, ports, parts, self.basis.rolling.get(i))
        samples = np.ascontiguousarray(z[::parts])
        out = outputs_of(m, samples, ports, OUTPUTS)
        acting = {name: values for name, values in ports.by_name().items() if acts(values)}

        @kept_for_loggers
        def late(seconds: float) -> np.ndarray:
            return late_outputs(m, run, samples, acting, seconds)

        if not stepped:
            return out, np.zeros((0, 0)), late
        rate = None if "contact" not in stepped else self.shape_rate(rig, rotated.motion, parts)
        return out, felt(m, z, ports, rate, stepped, parts), late

    def residuals(self, rigs: list[Rig], which: list[int], steps: int = STEPS) -> list[np.ndarray]:
        """Whitened rows of measured less predicted, per rig, over the runs of `which`.

        Laws at contacts and mounts take `steps` a sample.  Rows of a rig that runs away are not
        finite, and so is its cost.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            parts = each(lambda i: self._run_residuals(rigs, i, steps), which)
            return list(np.concatenate(parts, axis=1))

    def _run_residuals(self, rigs: list[Rig], i: int, steps: int) -> np.ndarray:
        """Whitened rows (rigs, rows) of one run."""
        rows, predicted = self.rows[i], self.predicted(rigs, i, steps)

        def one(k: int) -> np.ndarray:
            return rows.vector(*self._left(rigs[k], i, predicted[k]))

        table = np.stack(each(one, range(len(rigs))))
        rows.take_off(table)
        return table

    def elastic_tangents(
        self, rig: Rig, numbers: list[tuple[str, int]], which: list[int]
    ) -> np.ndarray | None:
        """d of the whitened rows (numbers, rows) of `which` runs by numbers of the elastic model.

        As `mode_changes` names them.  None where they enter otherwise too: by laws that feel the
        contacts, and by sensors of dR or a that do more than to read late.
        """
        late = {
            i: {group: offset_of(self.at_run(rig, i), group) for group in ELASTIC} for i in which
        }
        laws = [p.law for p in rig.at("sensor") if p.group in ELASTIC]
        plain = all(only_delays(law) for law in laws)
        if stepped_ports(rig) or rig.at("rolling") or not plain:
            return None
        if any(min(late[i].values()) <= -self.runs[i].step for i in which):
            return None
        m = self.modes(rig)
        changes = mode_changes(m, rig, numbers)

        def rows(i: int) -> np.ndarray:
            run, r = self.runs[i], self.rotated(rig, [i])[i]
            ports = self.ports(rig, i, r)
            along = ElasticTangents(m, changes, run, ports, self.basis.rolling.get(i))
            dR, a = (along.changes(late[i][group]) for group in ELASTIC)
            tables = np.concatenate([dR[..., :3], a[..., 3:]], axis=2)
            out = np.stack([self.rows[i].vector(-x, None) for x in tables])
            self.rows[i].take_off(out)
            return out

        return np.concatenate(each(rows, which), axis=1)

    def residual_tables(
        self, rig: Rig, i: int, outputs: dict[str, np.ndarray] | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """(elastic (t, 6), rotation (t, 3 + n)): measured less predicted, not whitened.

        Of other `outputs` (by group (t, channels)) what these show beside the run's own motion.
        """
        return self._left(rig, i, self.predicted([rig], i)[0], outputs)

    def _left(
        self, rig: Rig, i: int, predicted: Predicted, outputs: dict[str, np.ndarray] | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        run, rig = self.runs[i], self.at_run(rig, i)
        outputs = run.outputs if outputs is None else outputs
        missing = np.full((run.samples, 3), np.nan)
        elastic = []
        for group in ("dR", "a"):
            elastic.append(outputs.get(group, missing) - _read(rig, run, predicted, group))
        # Omega from the torques drifts; what sensors change is that of the measured motion
        turning = predicted.turning
        rolls = run.rolling_start(self.noise)
        shown = moving_readings(rig, "Omega", run.time, turning, rolls)
        Omega = predicted.Omega + shown - turning
        rotation = [outputs.get("Omega", missing) - Omega, predicted.missed]
        return np.concatenate(elastic, axis=1), np.concatenate(rotation, axis=1)


def kept_for_loggers(late: Callable[[float], np.ndarray]) -> Callable[[float], np.ndarray]:
    """`late` with its last few values kept: a group is read as late by most rigs asked for."""
    return functools.lru_cache(READINGS)(late)


def _read(rig: Rig, run: Run, predicted: Predicted, group: str) -> np.ndarray:
    """What the sensors of dR or a show (samples, 3).

    Those that remember have seen it between the samples too, where it rings faster than these tell.
    """
    offset, parts = offset_of(rig, group), SENSOR_POINTS if remembers(rig, group) else 1

    def late(seconds: float) -> np.ndarray:
        return predicted.read(group, offset + seconds)

    values = finer(late, run.step, parts)
    return readings(rig, group, run.fine(parts), values, on_time(rig, group))[::parts]
