"""Speeds that do not fit each other and axes hardly driven: every way to a figure says so, once."""

import re
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import machine
from seeds import drawn_anew
from tiers import tiered

from omnijax import load_study, propagate, sensitivity, set_parameter, simulate, steady_state, sweep
from omnijax._errors import DataWarning
from omnijax.cli import run
from omnijax.dynamics import fitting_speeds, sliding, sliding_of
from omnijax.rig import load_rig, save_rig
from omnijax.simulation import ramp, remarks, speeds, table, torques
from omnijax.study._design.cases import RigCases
from omnijax.study._evaluation import Question, evaluation_of
from omnijax.study._evaluation.coarse import coarse_samples
from omnijax.view._panel import _sliding

pytestmark = pytest.mark.brief

AROUND = np.deg2rad([10.0, 95.0, 190.0, 280.0])
_C, _S = np.cos(AROUND), np.sin(AROUND)
FOUR = (
    np.column_stack([-0.7 * _C, -0.7 * _S, np.full(4, np.sqrt(0.51))]),
    np.column_stack([-_S, _C, 0 * _C]),
)
UNFIT = [3.0, 5.1, 7.3, 4.0]  # rad/s
MISFIT = "do not fit each other"


def four_wheels():
    return machine(FOUR)


def nearly_singular():
    """Three wheels that all run along circles of longitude but for 0.004 rad."""
    a = np.deg2rad([180.0, 300.0, 60.0])
    normal = np.column_stack([0.7 * np.cos(a), 0.7 * np.sin(a), np.full(3, np.sqrt(0.51))])
    along = np.cross([0, 0, 1.0], normal)
    along /= np.linalg.norm(along, axis=1)[:, None]
    return machine((normal, np.cos(0.004) * np.cross(normal, along) + np.sin(0.004) * along))


def told(work):
    """The warnings of `work()`."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        work()
    assert all(issubclass(each.category, DataWarning) for each in caught)
    return [str(each.message) for each in caught]


WAYS = ("simulate", "propagate", "steady", "sweep", "slopes")
DEAR = (
    "steady",
    "sweep",
    "slopes",
)  # in the gate a long run's warning: test_hold; a sweep's: below


@pytest.mark.parametrize("way", tiered(WAYS, DEAR.__contains__))
def test_every_way_warns_once_where_speeds_do_not_fit(way):
    rig = four_wheels()
    ways = {
        "simulate": lambda drive: simulate(rig, drive, 0.02),
        "propagate": lambda drive: propagate(rig, drive, 0.02),
        "steady": lambda drive: steady_state(rig, drive),
        "sweep": lambda drive: sweep(rig, "platform.mass=5,6", "rms", speeds=drive),
        "slopes": lambda drive: sensitivity(rig, drive, "rms", parameters=["platform.mass"]),
    }
    (warning,) = told(lambda: ways[way](UNFIT))
    each = 1e3 * np.abs(sliding(rig, np.array(UNFIT)))
    assert MISFIT in warning and f"w1 {each[0]:.3g} mm/s, w2 {each[1]:.3g} mm/s" in warning
    fitting = fitting_speeds(rig, [0.1, -0.2, 0.3])
    assert told(lambda: ways[way](fitting)) == []


def test_rounding_is_no_misfit_and_what_matters_is():
    rng, rig = drawn_anew("misfits"), four_wheels()
    for _ in range(20):
        fitting = np.array(fitting_speeds(rig, rng.normal(size=3)))
        drive = speeds(fitting * (1 + 1e-9 * rng.normal(size=4)))
        assert remarks(rig, drive, None, "coupled") == []
        drive = speeds([float(f"{x:.6g}") for x in fitting])  # as study files have them
        assert remarks(rig, drive, (0.0, 1.0), "coupled") == []
        off = fitting + 0.05 * np.abs(fitting).max() * np.array([1, -1, 1, -1])
        (sentence,) = remarks(rig, speeds(off), None, "coupled")
        assert MISFIT in sentence


def test_speeds_that_part_during_the_run_are_seen():
    """The largest sliding of a ramp is that at its end, as far as the run goes."""
    rig = four_wheels()
    fitting = np.array(fitting_speeds(rig, [0.1, 0.2, 0.3]))
    drive = speeds(ramp(1.0, 3.0, fitting, UNFIT))
    assert remarks(rig, drive, (0.0, 1.0), "coupled") == []
    (sentence,) = remarks(rig, drive, (0.0, 2.0), "coupled")
    half = 1e3 * np.abs(sliding(rig, (fitting + UNFIT) / 2))
    assert f"w1 {half[0]:.3g} mm/s" in sentence
    assert remarks(rig, torques([1.0, 2, 3, 4]), (0.0, 2.0), "coupled") == []


def test_inside_transformations_nothing_warns():
    rig = four_wheels()

    def rms(stiffness):
        return steady_state(set_parameter(rig, "contact.stiffness", stiffness), UNFIT).rms

    def distance(first):
        return simulate(rig, speeds(np.array([0, 5.1, 7.3, 4.0]) + first), np.arange(3) / 500).dR

    assert told(lambda: jax.eval_shape(jax.jit(rms), 2e5)) == []
    assert told(lambda: jax.eval_shape(jax.vmap(distance), np.eye(4)[:2])) == []


def test_an_axis_hardly_driven_is_told():
    rig = nearly_singular()
    (sentence,) = remarks(rig, speeds([1.0, 2.0, 3.0]), None, "coupled")
    assert re.search(r"the wheels hardly drive the axis \(0, 0, -?1\): condition [\d.]+;", sentence)
    assert remarks(machine(), speeds([1.0, 2.0, 3.0]), (0.0, 1.0), "coupled") == []


def test_designs_of_a_sweep_whose_speeds_part_are_told():
    """The rig's own speeds fit; those at the ends of the range do not."""
    rig = four_wheels()
    fitting = speeds(fitting_speeds(rig, [0.1, 0.2, 0.3]))
    asked = Question(rig, (fitting,), ("speed.scale",), ("rms",), "coupled", None)
    assert told(lambda: evaluation_of(asked, ranges=[Between(0.5, 2.0)])) == []
    asked = asked._replace(varied=("speed.w1",))
    (warning,) = told(lambda: evaluation_of(asked, ranges=[Between(0.5, 2.0)]))
    assert MISFIT in warning


class Between:
    """A range of one number, as studies have them."""

    def __init__(self, low, high):
        self.low, self.high = low, high

    def quantile(self, share):
        return self.low + share * (self.high - self.low)


STUDY = """
rig = "four.toml"
[[drive]]
speed = [3, 5.1, 7.3, 4]
[[variable]]
path = "sphere.mass"
low = 4
high = 6
"""


def test_study_files_and_commands_tell_once(tmp_path, capsys):
    """`design`, `pareto`, `global-sensitivity` and `tolerances` begin with the same cases."""
    save_rig(four_wheels(), tmp_path / "four.toml")
    study = tmp_path / "study.toml"
    study.write_text(STUDY, encoding="utf-8")
    (warning,) = told(lambda: RigCases(load_study(study)))
    assert MISFIT in warning
    speed = ["--speed", "3,5.1,7.3,4"]
    rig = str(tmp_path / "four.toml")
    assert run(["sweep", rig, *speed, "--vary", "platform.mass=5,6", "--metric", "rms"]) == 0
    assert capsys.readouterr().err.count(MISFIT) == 1
    assert run(["simulate", rig, *speed, "--duration", "20ms"]) == 0
    assert " ".join(capsys.readouterr().err.split()).count(MISFIT) == 1


def test_the_page_says_how_far_contacts_slide():
    rig = four_wheels()
    (row,) = _sliding(rig, UNFIT)
    most = 1e3 * sliding_of(rig, np.array([UNFIT])).speed.max()
    assert "do not fit" in row["label"] and row["value"] == f"{most:.4g} mm/s"
    assert _sliding(rig, fitting_speeds(rig, [0.1, 0.2, 0.3])) == []


@pytest.mark.full  # in the gate traced rigs, above, and test_gradients
def test_what_is_known_is_told_where_a_caller_is_traced():
    """Parts of an array of sample times are traced there: gradients of runs were a traceback."""
    rig, ts = load_rig("atlas"), jnp.linspace(0, 0.02, 11)

    @jax.jit
    def scaled(x):
        run, steady = simulate(rig, [0.1, 1.2, 0.3], ts), steady_state(rig, [0.1, 1.2, 0.3])
        return x * run.dR[-1, 2], x * propagate(rig, [0.1, 1.2, 0.3], ts).dR[-1, 2], x * steady.rms

    assert all(np.isfinite(float(x)) for x in scaled(1.0))


def test_samples_are_held_against_the_top_of_a_ramp_that_falls_to_0_at_its_end():
    """Rollers passed up to 223 times a second there, but 0 times at every knot."""
    drive = speeds(table([0, 1, 1, 2], [[0, 0, 0], [100, 0, 0], [0, 0, 0], [0, 0, 0]]))
    question = Question(load_rig("atlas"), (drive,), (), ("rms",), "coupled", 2.0)
    sentence = coarse_samples(question, np.linspace(0, 2, 1001), ())
    assert sentence is not None and "up to 222.8 times a second" in sentence
