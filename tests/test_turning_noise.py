"""Noise of a colour in Omega and theta: told beside the free starts, and weighed as it is."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter
from seeds import drawn_anew
from test_diagnosis_search import balance, law
from tiers import more, tiered

from benchmarks.hidden_effects.cases import drawn
from benchmarks.hidden_effects.sensors import TURNING
from omnijax.diagnosis._machine._motion.smooth import smooth
from omnijax.diagnosis._machine._noise.data_vector import DataRows, make_rows
from omnijax.diagnosis._machine._noise.encoders import smoothed_errors, turned_errors
from omnijax.diagnosis._machine._noise.turning_noise import RunWaves, TurningNoise
from omnijax.diagnosis._machine._where.left_motion import turned_lengths
from omnijax.diagnosis._machine.rig_model import RigModel
from omnijax.diagnosis._machine.runs import Run, with_noise
from omnijax.diagnosis._search import Effect, Point, Search, Spectrum
from omnijax.diagnosis._search.readings import in_all_runs
from omnijax.diagnosis._search.where import Asked, questions, shares
from omnijax.diagnosis._settings import SETTINGS

pytestmark = pytest.mark.long

RATE, SECONDS = 250, 3
N = RATE * SECONDS
TIME = np.arange(N) / RATE
NOISE = {"Omega": 1e-4, "theta": 1e-4}
LENGTHS = np.full(3, 2e-5)  # 1-sigma of the rolled lengths, rad
AXES = np.array([[[1.0, 0.0, 0.0], [-0.5, 0.8, 0.2], [-0.5, -0.8, 0.2]]])
NAMES = ["Omega_x", "Omega_y", "Omega_z", "theta_1", "theta_2", "theta_3"]


def measured(noise=None) -> tuple[Run, DataRows]:
    """A run of a sphere on three wheels, and its rows beside a noise by channel."""
    zero = np.zeros((N, 3))
    run = Run("run", "train", TIME, zero, zero, {"Omega": zero, "theta": zero}, np.ones(N, bool))
    run = run if noise is None else with_noise(run, noise, 3)
    return run, make_rows(run, NOISE, LENGTHS, AXES, 1.0, 3)


def drawn_walk(rng, size: float) -> np.ndarray:
    """A random walk (N,) that ends `size` sigma off, from a level that nobody knows."""
    return size * np.cumsum(rng.normal(size=N)) / np.sqrt(N) + rng.normal(scale=3)


def low_passed(rng, size: float) -> np.ndarray:
    """Noise that is one for about `size` samples, of 1 sigma."""
    keep = np.exp(-1 / size)
    return np.asarray(lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.normal(size=N)))


def residual(rng, own=None) -> np.ndarray:
    """Noise (N, 6) in sigma: white, but for the channels of `own` by number."""
    out = rng.normal(size=(N, 6))
    for channel, values in (own or {}).items():
        out[:, channel] = values
    return out


def left(rows: DataRows, values: np.ndarray) -> np.ndarray:
    """Whitened rows of values (N, 6) in sigma, beside the free starts."""
    scale = np.array([1e-4] * 3 + [2e-5] * 3)
    return rows.project(rows.vector(None, values * scale))


def told(tables: list[np.ndarray]) -> TurningNoise:
    """The noise that runs show whose residuals are given in sigma."""
    run, rows = measured()
    return TurningNoise([RunWaves.of([(rows, left(rows, x))], run.step) for x in tables])


def test_a_gyro_that_wanders_is_told_from_what_the_free_starts_leave_of_it():
    """Half of its bias had gone over to the lengths, whose noise was shown too large."""
    rng, sizes = drawn_anew("wandering gyro"), []
    for _ in range(3):
        size = rng.uniform(2, 6)
        tables = [residual(rng, {1: rng.normal(size=N) + drawn_walk(rng, size)}) for _ in range(3)]
        shown = told(tables).shown(NAMES)
        assert [c for c, x in shown[0].items() if x.colour != "white"] == ["Omega_y"]
        level = shown[0]["Omega_y"]
        assert level.colour == "wandering"
        assert level.spectrum is not None
        assert shown[0]["theta_1"].ratio == pytest.approx(1.0, abs=0.15)
        sizes.append(np.sqrt((2 * np.pi) ** 2 * level.spectrum.walk * N) / size)
    assert np.mean(sizes) == pytest.approx(1.0, abs=0.25)


def test_white_noise_has_no_colour_and_an_offset_of_each_run_does_not_widen_it():
    """A gyro that is turned on anew for every run: its noise had been shown a third too large."""
    rng = drawn_anew("white turning")
    for _ in range(2):
        assert told([residual(rng) for _ in range(2)]).shown(NAMES) == [{}, {}]
        offsets = rng.choice([-1, 1], (2, 6)) * rng.uniform(1, 2, (2, 6)) * ([1.0] * 3 + [0.0] * 3)
        tables = [residual(rng) + offset for offset in offsets]
        shown = told(tables).shown(NAMES)
        assert {x.colour for x in shown[0].values()} == {"offset by run", "white"}
        for noise, table in zip(shown, tables, strict=True):
            rows = measured(noise)[1]
            plain = rows.split(left(rows, table))[1]
            assert [x.ratio for x in noise.values()] == pytest.approx(np.ones(6), abs=0.15)
            assert np.mean(plain**2, axis=0) == pytest.approx(np.ones(6), abs=0.25)


def test_rows_of_a_rig_that_runs_away_are_not_finite_and_end_nothing():
    """Beside noise of a colour a trial that ran away ended the whole diagnosis (seed 1349)."""
    rng = drawn_anew("runaway beside a walk")
    walk = residual(rng, {4: rng.normal(size=N) + drawn_walk(rng, rng.uniform(2, 6))})
    rows = measured(told([walk]).shown(NAMES)[0])[1]
    assert rows.turning is not None
    table = rng.normal(size=(3, rows.size))
    alone = rows.project(table.T).T
    table[1, rng.integers(rows.size, size=5)] = rng.choice([np.nan, np.inf])
    with np.errstate(invalid="ignore"):
        rows.take_off(table)
    assert not np.isfinite(table[1]).all()
    np.testing.assert_allclose(table[[0, 2]], alone[[0, 2]], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("colour", ["walk", "low-pass"])
def test_the_error_of_a_smoothed_angle_is_as_large_as_is_said(colour):
    """A walk of the encoders passes the smoother, and shakes the sphere through the shapes."""
    rng, ratio, draws = drawn_anew(f"smoothed {colour}"), 1e5, 100
    keep, walks = np.exp(-1 / 4), 0.2 * rng.normal(size=(N, draws)).cumsum(axis=0)
    white = rng.normal(size=(N, draws))
    spectrum = Spectrum(1.0, walk=(0.2 / (2 * np.pi)) ** 2)
    noise = white + walks
    if colour == "low-pass":  # 1/(1 + (f/corner)^2) of one that is slow against the sampling
        level, corner = (1 + keep) / (1 - keep), (1 - keep) / (2 * np.pi * np.sqrt(keep))
        spectrum = Spectrum(0.0, low_pass=level, corner=corner)
        noise = np.asarray(lfilter([np.sqrt(1 - keep**2)], [1, -keep], white, axis=0))
    shown = smooth(noise, 1.0, ratio)[0]
    along = np.cos(np.pi * np.outer(np.arange(1, 8), (np.arange(N) + 0.5) / N)) * np.sqrt(2 / N)
    said = np.sum((along @ smoothed_errors(N, ratio, spectrum)) ** 2, axis=1)
    assert np.mean((along @ shown) ** 2, axis=1) / said == pytest.approx(np.ones(7), abs=0.8)
    assert np.mean((along @ shown) ** 2 / said[:, None]) == pytest.approx(1.0, abs=0.25)
    plain = np.sum((along @ smoothed_errors(N, ratio, None)) ** 2, axis=1)
    assert plain == pytest.approx(np.ones(7), abs=0.05)


def test_an_angle_that_a_gyro_tells_is_as_far_off_as_its_noise_brings_it():
    rng, draws = drawn_anew("gyro for an encoder"), 100
    walk = Spectrum(1.0, walk=(0.5 / (2 * np.pi)) ** 2)
    noise = {"Omega_y": SimpleNamespace(ratio=2.0, spectrum=walk)}
    axis, run = np.array([0.6, 0.8, 0.0]), with_noise(measured()[0], noise, 3)
    x, y = rng.normal(size=(2, N, draws))
    y = 2 * (y + 0.5 * rng.normal(size=(N, draws)).cumsum(axis=0))
    angle = np.cumsum(1e-4 * (0.6 * x + 0.8 * y), axis=0) / RATE
    along = np.sin(np.pi * np.outer(np.arange(2, 9), (np.arange(N) + 0.5) / N))  # hardly a slope's
    along -= np.outer(along @ TIME / (TIME @ TIME), TIME)
    said = np.sum((along @ turned_errors(run, axis, 1e-4)) ** 2, axis=1)
    assert np.mean((along @ angle) ** 2 / said[:, None]) == pytest.approx(1.0, abs=0.35)


@pytest.mark.parametrize("channel", tiered([2, 4], (2).__eq__))  # of a gyro, of an encoder
def test_low_pass_noise_of_the_rotation_is_told(channel):
    rng = drawn_anew(f"low-pass turning {channel}")
    shown = told([residual(rng, {channel: low_passed(rng, 4)}) for _ in range(3)]).shown(NAMES)
    assert shown[0][NAMES[channel]].colour == "low-pass"


@pytest.mark.full
@pytest.mark.parametrize("colour", ["wandering", "low-pass"])
def test_numbers_beside_such_noise_are_as_far_off_as_is_said(colour):
    """A drift, an offset beside white starts' noise, a slow and a quick motion of the sphere."""
    rng, off = drawn_anew(f"turning sigmas {colour}"), []
    slow, quick = np.sin(2 * np.pi * 0.4 * TIME), np.sin(2 * np.pi * 7 * TIME)
    signals = np.zeros((4, N, 6))
    signals[0, :, 0], signals[1, :, 0] = TIME - TIME.mean(), quick
    for k, course in ((2, slow), (3, quick)):  # a speed, and what it rolls, in sigma
        signals[k, :, :3] = course[:, None]
        signals[k, :, 3:] = np.cumsum(course)[:, None] / RATE * (AXES[0].sum(axis=1) * 5)
    for _ in range(40):
        tables = []
        for _ in range(2):
            own = rng.normal(size=N) + drawn_walk(rng, 5)
            tables.append(residual(rng, {0: own if colour == "wandering" else low_passed(rng, 4)}))
        shown = told(tables).shown(NAMES)
        assert shown[0]["Omega_x"].colour == colour
        right = above = 0.0
        for x, noise in zip(tables, shown, strict=True):
            plain = {c: SimpleNamespace(ratio=1.0, spectrum=level.spectrum)
                     for c, level in noise.items() if level.spectrum is not None}  # fmt: skip
            ratio = noise["Omega_x"].ratio
            plain["Omega_x"].ratio = ratio
            rows = measured(plain)[1]
            white, *columns = (left(rows, y) for y in (x, *signals))
            right = right + np.array([white @ y for y in columns])
            above = above + np.array([y @ y for y in columns])
        off.append(right / np.sqrt(above))
    spread = np.sqrt(np.mean(np.square(off), axis=0))
    assert np.all(spread < 1.5)
    assert np.all(spread > 0.65)


def test_rows_beside_coloured_noise_lack_the_starts_and_come_back():
    """The projection is one: what is taken off again is nothing, and no start is left."""
    rng = drawn_anew("coloured starts")
    table = residual(rng, {0: drawn_walk(rng, 30), 4: drawn_walk(rng, 10)})
    noise = told([table]).shown(NAMES)[0]
    rows = measured(noise)[1]
    start = np.zeros((N, 6))
    start[:RATE, 1] = 1.0  # Omega_y at the start of the first window, and what it rolls
    start[:RATE, 3:] = TIME[:RATE, None] * AXES[0, :, 1] * 5
    assert np.linalg.norm(left(rows, start)) < 1e-6 * np.linalg.norm(start)
    first = left(rows, table)
    again = rows.unwhitened_rotation(first)
    np.testing.assert_allclose(left(rows, again * [level.ratio for level in noise.values()]), first,
                               atol=1e-6 * np.abs(first).max())  # fmt: skip


def test_a_gyro_that_wanders_is_no_motion_that_its_lengths_show():
    """Beside a bias the free starts leave as much in the lengths, the other way round."""
    rng, (run, rows) = drawn_anew("gyro that is no motion"), measured()
    for _ in range(3):
        tables = [residual(rng, {c: drawn_walk(rng, 12) for c in range(3)}) for _ in range(3)]
        parts = [turned_lengths(rows, left(rows, x), AXES, run.step) for x in tables]
        for k in range(3):
            lengths, shapes = zip(*((x[:, k], y[:, k : k + 1]) for x, y in parts), strict=True)
            answer = in_all_runs("motion Omega", lengths, shapes, k)
            assert answer is not None
            assert answer["p"] > 1e-5


def asked_of(rng, own) -> list[float]:
    """By the time and by an order the least chance that channels of a run are noise; `own` see
    `residual`."""
    rows, tables = measured()[1], [residual(rng, own(rng)) for _ in range(3)]
    noise = told(tables).shown(NAMES)[0]
    drawn = rows.left_of_noise([noise.get(c) for c in NAMES], SETTINGS.where.shuffles)
    values = rows.split(left(rows, tables[0]))[1]
    angles, states = {"w1": 2 * np.pi * TIME**1.5}, {"time s": TIME}
    asked = Asked(questions(TIME, angles, states))
    answers = [x for c in range(6) for x in shares(values[:, c], asked, c, drawn=drawn[:, c])]
    return [min(x["p"] for x in answers if x["domain"] == k) for k in ("time", "order")]


def test_what_free_starts_leave_of_a_walk_hangs_on_no_time():
    """A healthy machine was unknown: a slope in every window stood in one of nine bins of time."""
    rng, chances = drawn_anew("bins of time"), []
    for _ in range(2):
        chances.append(asked_of(rng, lambda r: {c: drawn_walk(r, 6) for c in range(3)})[0])
    assert min(chances) > 1e-5
    wave = np.sin(14 * np.pi * TIME**1.5)  # an order is no walk
    own = {4: drawn_walk, 3: lambda r, size: r.normal(size=N) + size / 6 * wave}
    assert asked_of(rng, lambda r: {c: f(r, 6) for c, f in own.items()})[1] < 1e-7


def taken_for_noise(drifts: bool, rng, place: int) -> bool:
    """`RigModel.as_noise` of a drift in a channel that drifts, or wanders, in three runs."""
    line = TIME - TIME.mean()
    shown = left(measured()[1], np.outer(TIME, np.eye(6)[place]))
    per = np.sqrt(1000 / 3 / (shown @ shown))  # sigma a second, of a gain of 1000
    tables = [
        residual(rng) + np.outer(per * TIME if drifts else drawn_walk(rng, 3), np.eye(6)[place])
        for _ in range(3)
    ]
    slope = sum(line @ x[:, place] for x in tables) / (3 * line @ line)
    level = np.mean([x[:, place] for x in tables]) - slope * TIME.mean()
    straight = [x - np.outer(level + slope * TIME, np.eye(6)[place]) for x in tables]
    drift = Effect("sensor-drift", NAMES[place], {})
    fit, less = Point(np.zeros(0), (drift,)), Point(np.zeros(0))
    run, rows = measured()

    def turning_noise(point, levels=None):
        some = straight if point.effects else tables
        waves = [RunWaves.of([(rows, left(rows, x))], run.step) for x in some]
        return TurningNoise(waves, levels)

    whole = SimpleNamespace(turning_noise=turning_noise, settings=SETTINGS.search)
    points = (SimpleNamespace(point=p) for p in (less, fit))
    return RigModel.as_noise(whole, *points, drift)  # pyright: ignore


@pytest.mark.parametrize("place, count", [(1, 1), *more((1, 3), (4, 3))])
def test_a_gyro_or_encoder_that_wanders_is_no_drift_and_a_drift_is_one(place, count):
    """A healthy gyro's walk of two sigma was a drift of 18 sigma, surely."""
    rng = drawn_anew(f"turning drift {place}")
    assert not any(taken_for_noise(True, rng, place) for _ in range(count))
    assert all(taken_for_noise(False, rng, place) for _ in range(count))


def test_an_effect_found_under_another_noise_has_to_stand_under_this_one(monkeypatch):
    """It was kept: a drift of which held-out runs showed 0.63 +- 0.02 of the change."""
    model = balance([law("bearing-coulomb", 0.2)])
    first = Search(model).explore()
    known, asked = first.way.fit.point, []
    assert Search(model).stands(first.way.fit)
    monkeypatch.setattr(Search, "stands", lambda self, fit: asked.append(fit) or False)
    again = Search(model).explore(first.baseline.point, known, doubted=True)
    assert len(asked) == 1
    assert again.way.scans[0].scores  # from none
    assert [e.name for e in again.way.fit.point.effects] == [e.name for e in known.effects]


@pytest.mark.parametrize("count", tiered([40, 80], (80).__eq__))
def test_the_benchmark_wanders_and_drifts_in_every_group_and_its_older_seeds_do_not(count):
    """From a seed on; what older ones drew is compared with their answers."""
    rng = drawn_anew("turning seeds")
    new = [drawn(int(s), "none").noise for s in rng.integers(TURNING, 10**6, count)]
    old = [drawn(int(s), "none").noise for s in rng.integers(100, TURNING, count // 2)]
    colours = ("wander", "low-pass")
    assert any(x["at"][0] in "Ot" for x in new if x["fault"] in colours)
    assert not any(x["at"][0] in "Ot" for x in old if x["fault"] in colours)
