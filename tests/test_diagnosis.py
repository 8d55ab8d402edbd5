"""The diagnosis end to end on short runs of an independent plant: one of each answer."""

import dataclasses
import json
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from machines import RECORDINGS
from seeds import drawn_anew
from test_plant import load_plant

from omnijax.diagnosis import diagnose
from omnijax.diagnosis._answer._learned import learned, term_fit
from omnijax.diagnosis._answer._learned.learned import Unexplained, ports_of
from omnijax.diagnosis._answer._learned.misshapen import _left, _own_functions
from omnijax.diagnosis._answer._learned.near_laws import near_laws
from omnijax.diagnosis._answer._learned.term_fit import TermFit
from omnijax.diagnosis._answer.rig_evidence import RigEvidence
from omnijax.diagnosis._machine import RigModel, said_of_outliers
from omnijax.diagnosis._machine._candidates.candidates import untried
from omnijax.diagnosis._search import Point, tangent_rows
from omnijax.laws import EFFECTS
from omnijax.recording import read_case
from omnijax.rig import load_rig, save_rig

pytestmark = pytest.mark.long

SECONDS = 3.5
WILD = ("dR_y", "theta_2", "Omega_x", "a_z")


@pytest.fixture(scope="module")
def plant():
    return load_plant()


@pytest.fixture(scope="module")
def cases(plant, tmp_path_factory):
    """Folders of a few small cases by name."""
    effects = {
        "none": {},
        "runout": {"runout": np.array([0.0, 5e-5, 0.0]), "runout_phase": np.array([0, -1.9, 0.0])},
        "unknown": {"cross": 2.5e4 * np.eye(3)[[1, 0, 2]] * [[1], [1], [0]]},
    }
    folder, found = tmp_path_factory.mktemp("cases"), {}
    for k, (name, planted) in enumerate(effects.items()):
        rng = np.random.default_rng(20 + k)
        stated = plant.machine(rng)
        true = plant.perturbed(rng, stated)
        drives = [plant.torques(true, plant.wander(rng, SECONDS)) for _ in range(3)]
        plant.write_case(
            folder / name, stated, plant.record(stated, true, planted, np.stack(drives), rng)
        )
        found[name] = folder / name
        if name == "none":
            found["true"] = true
    return found


@pytest.fixture(scope="module")
def wild(cases):
    """(the case with nothing added, number of wild samples in every run and group)."""
    case, rng, planted = read_case(cases["none"]), np.random.default_rng(8), 0
    sigma = {"dR": 2e-6, "theta": 1e-4, "Omega": 1e-4, "a": 5e-3}
    for run in case.runs:
        for name in WILD:
            at = rng.choice(len(run), 4, replace=False)
            size = sigma[name.split("_")[0]] * rng.choice([-300.0, -40.0, 40.0, 300.0], 4)
            run.channels[name] = run.channels[name].copy()
            run.channels[name][at] += size
            planted += 4
    return case, planted


@pytest.fixture(scope="module")
def none(wild):
    """A few samples are wild: what follows holds all the same."""
    return diagnose(wild[0])


def test_agreement_is_called_none(none):
    assert none.verdict == "none"
    assert none.effects == []
    for gap in none.gap.values():
        assert gap.before == pytest.approx(gap.noise_floor, rel=0.05)


def test_calibration_finds_stiffness_within_a_per_cent(none, cases):
    """Of the machine that was recorded; the stated one is off by 8 %."""
    known = [b for b in none.baseline if b["parameter"].endswith("contact.stiffness")]
    assert [b["parameter"].split(".")[1] for b in known] == ["w1", "w2", "w3"]
    stated = np.array([b["stated"] for b in known])
    assert np.abs(stated / cases["true"]["K"] - 1).max() > 0.02
    for b, true in zip(known, cases["true"]["K"], strict=True):
        assert b["determined"] and b["relative_sigma"] < 0.01
        error = b["with_effects"] / true - 1
        assert abs(error) < min(0.01, 4 * b["relative_sigma"]), (b, true)


def test_an_opening_is_the_beginning_of_every_run_by_the_way_that_is_rolled(none):
    model = none.details["model"]
    part = model.opening(0.3)
    for i, (short, whole) in enumerate(zip(part.machine.runs, model.machine.runs, strict=True)):
        speed = model.machine.motions(model.machine.rig)[i].speed[::8]
        way = np.cumsum(np.abs(speed).sum(axis=1))
        assert way[short.samples - 1] == pytest.approx(0.3 * way[-1], rel=0.02)
        np.testing.assert_array_equal(short.torque, whole.torque[: short.samples])
    assert part.splits == model.splits
    (residual,) = part.residuals([none.details["found"].fit.point], "train")
    assert residual @ residual == pytest.approx(part.dof("train"), rel=0.05)


def test_every_candidate_has_a_signature_or_is_said_to_be_dead(none):
    scores = none.details["found"].scans[0].scores
    assert {s.candidate.id for s in scores} == set(EFFECTS) - untried(EFFECTS)
    dead = {s.candidate.name for s in scores if s.dead}
    assert dead == {f"lift-off@{p}" for p in ("w1", "w2", "w3", "all")}
    assert any(name in note for note in none.notes for name in dead)
    assert all(s.gain >= 0 for s in scores)


def test_no_candidate_is_significant_where_nothing_is_missing(none):
    """One scan; how the p-values are spread is for test_diagnosis_null."""
    live = [s for s in none.details["found"].scans[0].scores if not s.dead]
    assert len(live) > 150
    assert min(s.p for s in live) * len(live) > 1e-3
    assert not none.details["found"].significant


def test_a_few_wild_samples_are_left_out_and_name_nothing(none, wild):
    assert none.verdict == "none"
    said = [f for f in none.faults if "isolated sample" in f]
    left_out = sum(int(f.split(": ")[2].split()[0]) for f in said)
    assert 0.9 * wild[1] < left_out < 1.1 * wild[1]
    assert {w.strip(":,") for f in said for w in f.split() if "_" in w} == set(WILD)


def test_samples_that_were_left_out_and_fit_what_was_found_are_put_back(none):
    """Drawn good samples, as if they had stood out before an effect was known: those come back.

    Impacts of a backlash had been left out as shocks, 139 of them, and stayed out beside it.
    """
    evidence, point = none.details["evidence"], none.details["found"].fit.point
    assert evidence.readmitted(point) is None  # what is wild
    rng, kept = drawn_anew("samples that come back"), [*evidence.model.machine.runs]
    wild, chosen = [dict(run.aside) for run in kept], {}
    for i, run in enumerate(kept):
        outputs, aside = dict(run.outputs), dict(run.aside)
        for group in ("dR", "a"):
            mask = np.isfinite(outputs[group]) & (rng.random(outputs[group].shape) < 0.02)
            aside[group] = np.where(mask, outputs[group], aside.get(group, np.nan))
            outputs[group] = np.where(mask, np.nan, outputs[group])
            chosen[i, group] = mask
        kept[i] = dataclasses.replace(run, outputs=outputs, aside=aside)
    model = RigModel(
        evidence.model.rig, kept, evidence.model.noise, evidence.model.laws, evidence.model.window
    )
    model.rebase(point)
    said = ["data", *said_of_outliers(kept)]
    again = RigEvidence(model, evidence.noise, said).readmitted(point)
    assert again is not None
    for i, run in enumerate(again.model.machine.runs):
        for group in ("dR", "a"):
            mask = chosen[i, group]
            assert np.isfinite(run.outputs[group][mask]).mean() > 0.99
            still = np.isfinite(wild[i].get(group, np.full(mask.shape, np.nan)))
            assert np.isfinite(run.aside[group][still]).all()
            assert np.isnan(run.outputs[group][still]).all()
    told = [fault for fault in again.faults if "stand out no longer" in fault]
    assert len(told) == len(kept) and again.faults[0] == "data"
    assert [f for f in again.faults if "isolated" in f] == said_of_outliers(
        again.model.machine.runs
    )
    assert not set(said[1:]) & set(again.faults)


PORTS = ("contact", "mount", "shaft", "shape", "sphere", "surface", "sensor")


@pytest.fixture(scope="module")
def around(none):
    """(model, what a term is fitted around, the ports by name) where nothing is missing."""
    model, fit = none.details["model"], none.details["found"].fit
    ports = {port.port: port for port in ports_of(model)}
    assert tuple(ports) == PORTS
    return model, Unexplained.of(model, fit), ports


@pytest.mark.parametrize("port", PORTS)
def test_columns_of_a_learned_term_are_its_differences(around, port):
    """Of weights about zero, and of the baseline: what the fit of the term steps by."""
    model, unexplained, ports = around
    fitting = TermFit(model, unexplained, ports[port])
    now, inputs = fitting.left(fitting.term, "train")
    count = len(fitting.term.weights)
    table, few = fitting._columns(inputs), {0, 4, count // 2, count - 1}
    assert table.shape == (count + len(model.priors), len(now))
    for j in few:
        size = 1e-3 / np.linalg.norm(table[j])
        term = fitting.term.moved(size * np.eye(count)[j])
        change = (now - fitting.left(term, "train")[0]) / size
        assert np.linalg.norm(change - table[j]) < 1e-4 * np.linalg.norm(table[j])
    shift = np.eye(len(model.priors))[1]
    change = now - fitting.left(fitting.term, "train", shift)[0]
    np.testing.assert_allclose(change, table[count + 1], atol=1e-9)


@pytest.mark.parametrize("port", PORTS)
def test_a_term_that_is_planted_is_learned_with_its_band(around, port):
    """Two drawn coefficients of a port, strong enough to stand out, in the rows of all runs."""
    model, unexplained, ports = around
    rng = np.random.default_rng(list(PORTS).index(port))
    one = TermFit(model, unexplained, ports[port])
    table = one._columns(one.left(one.term, "train")[1])
    live = np.flatnonzero(np.linalg.norm(table[: len(one.term.weights)], axis=1) > 0)
    chosen = rng.choice(live, 2, replace=False)
    true = np.zeros(len(one.term.weights))
    true[chosen] = rng.choice([-1, 1], 2) * 60 / np.linalg.norm(table[chosen], axis=1)
    planted = {}
    for split, rest in unexplained.rest.items():
        planted[split] = 2 * rest - one.left(one.term.moved(true), split)[0]
    moved = dataclasses.replace(unexplained, rest=planted, before=planted["held-out"])
    fitting = TermFit(model, moved, ports[port]).run()
    assert fitting.closed > 0.8
    for j in chosen:
        others = np.delete(table, j, 0).T
        like = others @ np.linalg.lstsq(others, table[j], rcond=None)[0]
        if np.linalg.norm(table[j] - like) < 0.5 * np.linalg.norm(table[j]):
            continue  # others do nearly the same
        assert fitting.active[j]
        assert abs(fitting.term.weights[j] - true[j]) < 5 * fitting.sigma[j]
    curve = fitting.curve(fitting.grid(fitting.strongest()[0]))
    assert np.all(np.isfinite(curve.y)) and np.all(curve.sigma >= 0)


def with_shaft_torques(around, torque) -> Unexplained:
    """What is left where shafts lack `torque` of the scaled inputs, (points, wheels) in N m."""
    model, unexplained, ports = around
    planted, port = {}, ports["shaft"]
    term = TermFit(model, unexplained, port).term
    for split, rest in unexplained.rest.items():
        table = []
        for base in unexplained.bases[split]:
            rows = model.machine.rows[base.index]
            force = torque(port.inputs(base) / term.scales)
            table.append(rows.project(rows.vector(*port.push(base, force))))
        planted[split] = rest + np.concatenate(table)
    tangents = unexplained.tangents
    shift = term_fit.alone(unexplained.u, planted["train"], tangents["train"])
    before = planted["held-out"] + tangents["held-out"] @ shift
    return dataclasses.replace(unexplained, rest=planted, before=before)


def test_dead_zones_of_motors_are_learned_as_functions_of_the_command(around):
    """Drawn widths, between the knees of the basis; without bends held-out runs refused it."""
    model, _, ports = around
    rng = drawn_anew("dead zones")
    n = len(ports["shaft"].wheels)
    width, size = rng.uniform(0.07, 0.5, n), 0.05
    moved = with_shaft_torques(
        around, lambda u: -size * np.clip(u[:, n : 2 * n], -width, width)
    )  # fmt: skip
    assert moved.before @ moved.before > 10 * model.dof("held-out")
    fitting = TermFit(model, moved, ports["shaft"]).run()
    assert fitting.closed > 0.95
    assert all("command" in fitting.grid(i).input for i in fitting.strongest())


@pytest.mark.parametrize("port", PORTS)
def test_a_fit_of_a_term_never_ends_worse_than_none(around, port, monkeypatch):
    """Functions that promise to pay, and in the end do not, are given up: nothing is learned."""
    model, _, ports = around
    monkeypatch.setattr(term_fit, "DAMPINGS", (1e30,))  # steps too short to be worth anything
    moved = with_shaft_torques(
        around, lambda u: 0.05 * np.ones((len(u), len(ports["shaft"].wheels)))
    )
    fitting = TermFit(model, moved, ports[port]).run()
    assert not fitting.active.any() and not fitting.term.weights.any()
    assert fitting.closed == pytest.approx(0.0, abs=1e-9)


def test_no_term_is_credited_with_what_the_baseline_closes_alone(none):
    """A case of one wheel was told "closes 100 %" by seven coefficients of 0."""
    model, fit = none.details["model"], none.details["found"].fit
    k = next(i for i, p in enumerate(model.priors) if not p.limited)
    off = dataclasses.replace(fit, point=Point(fit.point.u + 3.0 * np.eye(len(model.priors))[k]))
    left = [Unexplained.of(model, f).before for f in (off, fit)]
    assert left[0] @ left[0] == pytest.approx(left[1] @ left[1], rel=0.02)


def test_the_nearest_law_of_a_change_is_the_one_that_makes_it(none):
    model, search = none.details["model"], none.details["found"]
    scores = [s for s in search.scans[0].best_per_name() if not s.dead]
    own = next(s for s in scores if s.candidate.id == "bearing-coulomb" and s.gain > 0)
    (column,) = np.asarray(model.columns(search.fit.point, [own.candidate]), float)
    J = search.fit.jacobian[:, : len(model.priors)]
    loud = dataclasses.replace(own, gain=1e9)
    near = near_laws(model, search.fit.point, J, 0.01 * column, [loud, *scores])
    assert (near[0].id, near[0].place) == (own.candidate.id, own.candidate.place)
    assert near[0].cosine == pytest.approx(1.0, abs=1e-4)
    strength = next(k for k, p in EFFECTS["bearing-coulomb"].parameters.items() if p.linear)
    assert near[0].values[strength] == pytest.approx(0.01, rel=1e-3)


@pytest.mark.parametrize("size, there, left", [(60, 1, True), (60, -1, False), (2, 1, False)])
@pytest.mark.parametrize("place, port", [("w2", "shaft"), ("dR_z", "sensor"), ("all", "contact")])
def test_what_a_law_leaves_of_its_own_input_is_seen(around, none, place, port, size, there, left):
    """A planted function of it, where held-out runs show it too; none where they show another."""
    model, _, ports = around
    fit = none.details["found"].fit
    bases = {split: model.bases(fit.point, split) for split in ("train", "held-out")}
    labels, columns = _own_functions(model, ports[port], place, bases)
    j = next(k for k, label in enumerate(labels) if label.startswith("cube"))
    weight = size / np.linalg.norm(columns["train"][:, j])
    (held,) = model.residuals([fit.point], "held-out")
    tangents = tangent_rows(model, fit.point, fit.free, held, split="held-out")
    bent = dataclasses.replace(fit, residual=fit.residual + weight * columns["train"][:, j])
    shown = held + there * weight * columns["held-out"][:, j]
    length, most = _left(model, bent, columns, shown, tangents)
    assert (length > 0) == left
    if left:
        assert labels[most].split(" of ")[1] == labels[j].split(" of ")[1]
        assert 0.2 * size < length < 1.2 * size


def test_a_soft_limit_is_no_hard_one(around, none):
    """What lies between both is nearly all seen, though the hard one loses what is beyond it."""
    model, _, ports = around
    fit, port = none.details["found"].fit, ports["sensor"]
    bases = {split: model.bases(fit.point, split) for split in ("train", "held-out")}
    at, between = port.parts.index("dR_z"), {}
    top = np.abs(bases["train"][0].true["dR"][:, 2]).max()
    for split, some in bases.items():
        tables = []
        for base in some:
            x = base.true["dR"][:, 2] / (top / 5)
            bent = (np.tanh(x) - np.clip(x, -0.95, 0.95))[:, None]
            table = np.empty((1, model.machine.rows[base.index].size))
            term_fit.pushed(model, port, base, [bent * (np.arange(len(port.parts)) == at)], table)
            tables.append(table[0])
        between[split] = np.concatenate(tables)
    labels, columns = _own_functions(model, port, "dR_z", bases)
    weight = 40 / np.linalg.norm(between["train"])
    (held,) = model.residuals([fit.point], "held-out")
    tangents = tangent_rows(model, fit.point, fit.free, held, split="held-out")
    soft = dataclasses.replace(fit, residual=fit.residual + weight * between["train"])
    length, most = _left(model, soft, columns, held + weight * between["held-out"], tangents)
    assert 30 < length < 45
    assert "up to" in labels[most]


@pytest.mark.full
def test_two_per_cent_of_outliers_and_a_dropout_change_no_answer(cases, tmp_path):
    """Every channel has outliers of 10 to 50 sigma; one reads zero for a while."""
    rng, folder = np.random.default_rng(9), tmp_path / "wild"
    sigma = {"dR": 2e-6, "theta": 1e-4, "Omega": 1e-4, "a": 5e-3}
    shutil.copytree(cases["none"], folder)
    for path in sorted(folder.glob("*.csv")):
        names = path.read_text().split("\n", 1)[0].split(",")
        table = np.loadtxt(path, delimiter=",", skiprows=1)
        for c, name in enumerate(names):
            if size := sigma.get(name.rsplit("_", 1)[0]):
                at = rng.choice(len(table), len(table) // 50, replace=False)
                table[at, c] += size * rng.uniform(10, 50, len(at)) * rng.choice([-1, 1], len(at))
        table[900:960, names.index("dR_x")] = 0.0
        np.savetxt(path, table, "%.10g", ",", header=",".join(names), comments="")
    found = diagnose(folder)
    assert found.verdict == "none"
    assert sum("stuck" in f for f in found.faults) == 3
    for gap in found.gap.values():
        assert gap.before == pytest.approx(gap.noise_floor, rel=0.06)


@pytest.mark.full  # in the gate a user's law: test_diagnosis_answers
def test_a_planted_runout_is_named_with_place_and_size(cases, tmp_path):
    found = diagnose(cases["runout"])
    assert found.verdict == "named"
    (effect,) = found.effects
    assert (effect.id, effect.place) == ("wheel-runout", "w2")
    for key, true in (("amplitude", 5e-5), ("phase", -1.9)):
        p = effect.parameters[key]
        assert abs(p["value"] - true) < 4 * p["sigma"]
    assert found.gap["dR"].closed > 0.95
    first = found.where[0]  # the wheel's angle: as its order 1, or as a state of the same angle
    assert first["reference"] == "w2" and first["domain"] in ("order", "phase")
    assert first["domain"] == "phase" or first["value"] == 1.0
    assert first["share"] > 0.9
    written = json.loads(found.save(tmp_path / "diagnosis.json").read_text())
    assert written["verdict"] == "named"
    assert written["effects"][0]["indistinguishable_from"] == []
    rig = load_rig(save_rig(found.rig, tmp_path / "rig-diagnosed.toml"))
    assert [p.law.id for p in rig.effects] == ["wheel-runout"]


@pytest.mark.parametrize("closes", [-0.4, 0.4])
def test_a_term_that_leaves_more_of_the_gap_is_not_learned(monkeypatch, closes):
    """One that made the gap of `a` forty times as large stood in answer and page."""

    class Fitting:
        closed, after, cost, sigma = closes, {"held-out": None}, 0.0, np.zeros(0)
        active = np.ones(1, bool)
        port = SimpleNamespace(networked=False, port="sensor")
        term = SimpleNamespace(port=port)

        def __init__(self, *_):
            pass

        def run(self, *_):
            return self

        def strongest(self):
            return [0]

        def grid(self, part):
            return SimpleNamespace(part=part)

        def curve(self, _):
            return None

    monkeypatch.setattr(learned, "TermFit", Fitting)
    monkeypatch.setattr(Unexplained, "of", lambda *_: None)
    monkeypatch.setattr(learned, "ports_of", lambda _: [Fitting.port])
    monkeypatch.setattr(learned, "_nearest", lambda *_: [])
    monkeypatch.setattr(learned, "axes_of", lambda *_: None)
    monkeypatch.setattr(learned, "_drawn_as", lambda *_: "w1")
    told = []
    term = learned.learn(None, None, [], told.append)  # pyright: ignore
    assert (term is None) == (closes < 0) and told


def test_the_port_that_explains_the_fitted_runs_best_is_learned_at(monkeypatch):
    """Held-out runs may refuse a term, but of those that they allow they choose none.

    Nor is one that has no function credited with what the baseline closes without it.
    """

    class Fitting:
        after, sigma = {"held-out": None}, np.zeros(0)

        def __init__(self, _, __, port):
            self.port, self.cost, self.closed = port, port.cost, port.closed
            self.active = np.array([port.port != "d"])
            self.term = SimpleNamespace(port=port)

        def run(self, *_):
            return self

        def strongest(self):
            return [0]

        def grid(self, part):
            return SimpleNamespace(part=part)

        def curve(self, _):
            return None

    ports = [
        SimpleNamespace(port=name, cost=cost, closed=closed, networked=False)
        for name, cost, closed in (("a", 5, 0.9), ("b", 3, 0.8), ("c", 1, -0.1), ("d", 0, 0.9))
    ]
    monkeypatch.setattr(learned, "TermFit", Fitting)
    monkeypatch.setattr(Unexplained, "of", lambda *_: None)
    monkeypatch.setattr(learned, "ports_of", lambda _: ports)
    monkeypatch.setattr(learned, "_nearest", lambda *_: [])
    monkeypatch.setattr(learned, "axes_of", lambda *_: None)
    monkeypatch.setattr(learned, "_drawn_as", lambda *_: "w1")
    term = learned.learn(None, None, [], lambda _: None)  # pyright: ignore
    assert term is not None and term.port == "b" and term.closed == 0.8


def test_a_coupling_of_two_contacts_is_unknown_and_learned_at_the_contacts(cases):
    found = diagnose(cases["unknown"])
    assert found.verdict == "unknown"
    assert found.effects == []
    assert found.learned is not None and found.learned["uninterpreted"]
    assert found.learned["port"] == "contact"
    assert found.learned["closed"] > 0.9
    assert found.where


@pytest.mark.full
def test_a_drag_with_the_square_of_the_speed_is_no_viscous_one(plant, tmp_path):
    """A viscous one explains 99 % of it; what is left is the function, of which a term is one."""
    rng = np.random.default_rng(31)
    stated = plant.machine(rng)
    true = plant.perturbed(rng, stated)
    drives = [plant.torques(true, plant.wander(rng, SECONDS)) for _ in range(3)]
    planted = {"square": np.array([0.0, 2e-4, 0.0])}
    runs = plant.record(stated, true, planted, np.stack(drives), rng)
    plant.write_case(tmp_path / "drag", stated, runs)
    found = diagnose(tmp_path / "drag")
    assert found.verdict == "unknown" and "|x| x of w2" in found.notes[0]
    assert found.learned is not None and found.learned["port"] == "shaft"
    (term,) = [x for x in found.learned["terms"] if abs(x["coefficient"]) > 20 * x["sigma"]]
    assert (term["place"], term["input"]) == ("w2", "|x| x")
    assert found.learned["nearest"][0]["id"] == "bearing-viscous"


@pytest.mark.full
def test_a_runout_that_an_independent_program_hid_is_named():
    truth = json.loads((RECORDINGS / "case-07" / "truth.json").read_text())
    found = diagnose(RECORDINGS / "case-07")
    want = truth["effects"][0]
    assert [(e.id, e.place) for e in found.effects] == [(want["id"], want["place"])]
    for name, value in want["parameters"].items():
        number = found.effects[0].parameters[name]
        assert abs(number["value"] - value) < 4 * number["sigma"], name
