"""A saved rig reads back as the identical rig: numbers to the last bit, laws, files."""

import math
import tomllib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from machines import RECORDINGS
from references import REFERENCES
from rigs import effect, tables, with_effects

import omnijax
from omnijax._consent import law_files
from omnijax.laws import EFFECTS, TableShape
from omnijax.rig import InputError, load_rig, parse_rig, rig_text, save_rig
from omnijax.rig._check import RESERVED

positive = st.floats(1e-12, 1e12, allow_subnormal=False)
number = st.floats(-1e6, 1e6).map(lambda x: x if abs(x) >= 1e-12 else 0.0)
names = st.text(st.characters(codec="utf-8", exclude_characters="."), min_size=1, max_size=8)
fine_names = names.filter(lambda x: x.isprintable() and x == x.strip() and not x.startswith("a"))

LAW = """
from typing import ClassVar
from omnijax.laws import AbstractShaft, Parameter

class Cogging(AbstractShaft):
    size: float
    id: ClassVar[str] = "toothing"
    places: ClassVar[tuple[str, ...]] = ("wheel", "all")
    parameters: ClassVar[dict[str, Parameter]] = {"size": Parameter("N m", linear=True)}

    def __call__(self, signal, state=None):
        return -self.size * signal.speed
"""


def identical(a, b) -> bool:
    same = jax.tree.structure(a) == jax.tree.structure(b)
    return same and all(map(np.array_equal, jax.tree.leaves(a), jax.tree.leaves(b)))


def there_and_back(rig, folder):
    return load_rig(save_rig(rig, folder / "saved.toml"))


@st.composite
def wheels(draw, name):
    axis = draw(st.permutations([0, 1, 2]))
    sign = draw(st.sampled_from([1.0, -1.0]))
    angle = draw(st.floats(0, 6.2))
    normal = [sign * (i == axis[0]) for i in range(3)]
    drive = [0.0, 0.0, 0.0]
    drive[axis[1]], drive[axis[2]] = math.cos(angle), math.sin(angle)
    kind = draw(st.sampled_from(["gated-sine", "half-sine", "rollers", "dual-row"]))
    top = 0.5 if kind == "dual-row" else 1.0
    return {
        "name": name,
        "normal": normal,
        "drive": drive,
        "radius": draw(st.floats(1e-3, 0.5)),
        "mass": draw(positive),
        "inertia": draw(positive),
        "rollers": draw(st.integers(1, 60)),
        "roundness": draw(st.just(0.0) | st.floats(1e-9, top)),
        "profile": kind,
        "contact": {k: draw(positive) for k in ("stiffness", "damping", "friction")},
        "mount": {k: draw(positive) for k in ("stiffness", "damping")},
        "closure": {k: draw(positive) for k in ("stiffness", "preload")},
        **({"row_spacing": draw(positive)} if kind == "dual-row" else {}),
    }


@st.composite
def rig_tables(draw):
    chosen = draw(st.lists(fine_names, min_size=1, max_size=4, unique=True))
    chosen = [name for name in chosen if name not in RESERVED] or ["w1"]
    size, radius, part = draw(positive), draw(st.floats(0.5, 10)), st.floats(-1, 1)
    inertia = size if draw(st.booleans()) else [[size, 0, 0], [0, 2 * size, 0], [0, 0, size]]
    effects = [
        effect("wheel-runout", chosen[0], amplitude=1e-3 * draw(part), phase=draw(number)),
        effect("unbalance", "sphere", offset=draw(st.lists(number, min_size=3, max_size=3))),
        effect("mount-friction", "all", force=draw(positive)),
        effect("contact-hertz", chosen[-1], exponent=draw(st.floats(1, 3))),
        effect("sensor-crosstalk", "dR", X_xy=draw(number)),
    ]
    return {
        "sphere": {
            "radius": radius,
            "mass": 3 * size / radius**2,  # a body's moments are at most 2 m R^2 together
            "inertia": inertia,
            "centre_of_mass": [0.5 * radius * draw(part) for _ in range(3)],
        },
        "platform": {"mass": draw(positive), "gravity": [0, 0, draw(number)]},
        "wheel": [draw(wheels(name)) for name in chosen],
        "effect": draw(st.lists(st.sampled_from(effects), unique_by=lambda x: x["id"])),
        "uncertainty": {"contact.stiffness": draw(positive), "sphere.mass": draw(positive)},
    }


def tamed(value):
    """Numbers of no size that a machine has are 0: rig files refuse what is smaller than 1e-30."""
    if isinstance(value, dict):
        return {key: tamed(x) for key, x in value.items()}
    if isinstance(value, list):
        return [tamed(x) for x in value]
    return 0.0 if isinstance(value, float) and abs(value) < 1e-29 else value


@settings(max_examples=25)
@given(rig_tables())
def test_any_rig_reads_back_identically(tmp_path_factory, data):
    data = tamed(data)
    rig = parse_rig(data)
    again = there_and_back(rig, tmp_path_factory.mktemp("rig"))
    assert identical(rig, again)
    assert again.uncertainty == rig.uncertainty and again.names == rig.names


@pytest.mark.parametrize("name", omnijax.bundled_rigs())
def test_bundled_rigs_read_back(name, tmp_path):
    assert identical(load_rig(name), there_and_back(load_rig(name), tmp_path))


def test_every_effect_reads_back(tmp_path):
    blocks = []
    for law in EFFECTS.values():
        kinds = {"wheel": "w2", "group": "dR", "channel": "dR_z", "encoder": "theta_1"}
        known = law.parameters.items()
        one = 0.01 if law.id == "wheel-runout" else 1.0  # a wheel runs out by less than its radius
        values = {k: [0.1, 0.2, 0.3] if p.shape else one + (k == "exponent") for k, p in known}
        blocks.append(effect(law.id, kinds.get(law.places[0], law.places[0]), **values))
    rig = parse_rig(with_effects(*blocks))
    assert len(rig.effects) == len(EFFECTS)
    assert identical(rig, there_and_back(rig, tmp_path))


def test_scalar_inertia_stays_a_number(tmp_path):
    rig = there_and_back(load_rig("atlas"), tmp_path)
    assert rig.sphere.inertia.shape == ()
    tensor = [[2.0, 0.1, 0.0], [0.1, 3.0, 0.2], [0.0, 0.2, 4.0]]
    rig = parse_rig(tables((("sphere", "inertia"), tensor)))
    assert there_and_back(rig, tmp_path).sphere.inertia.tolist() == tensor


@pytest.mark.parametrize(("start", "turn"), [(0.0, True), (0.013, True), (0.0, False)])
def test_a_measured_profile_is_kept_beside_the_rig(tmp_path, start, turn):
    period = 2 * math.pi if turn else 2 * math.pi / 14
    theta = start + np.linspace(0, period, 41)[:-1]
    rho = 1e-4 * np.sin(2 * math.pi * theta / period) ** 3
    rows = [f"{x!r},{y!r}" for x, y in zip(theta.tolist(), rho.tolist(), strict=True)]
    (tmp_path / "wheel.csv").write_text("theta,rho\n" + "\n".join(rows))
    data = tables((("wheel", 1, "profile"), "table"), (("wheel", 1, "table"), "wheel.csv"))
    rig = parse_rig(data, tmp_path / "rig.toml")
    profile = rig.profiles[1]
    assert isinstance(profile, TableShape)
    assert float(profile.knots[-1]) == pytest.approx(period)
    at = jnp.asarray(theta + 0.3 * period / 40)
    exact = 1e-4 * np.sin(2 * math.pi * np.asarray(at) / period) ** 3
    assert jax.vmap(lambda x: profile(x, rig.gaps))(at) == pytest.approx(exact, abs=3e-7)
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    assert identical(rig, there_and_back(rig, folder))
    assert (folder / "saved-wheel-2.csv").exists()
    assert identical(rig, parse_rig(tomllib.loads(rig_text(rig))))


def test_a_users_law_travels_with_the_rig(tmp_path):
    (tmp_path / "my_law.py").write_text(LAW)
    block = {**effect("toothing", "w1", size="20 N cm"), "law": "my_law.py"}
    with law_files("trust"):
        rig = parse_rig(with_effects(block), tmp_path / "rig.toml")
    assert float(rig.effects[0].law.size) == pytest.approx(0.2)  # pyright: ignore
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    assert identical(rig, there_and_back(rig, folder))
    assert (folder / "my_law.py").read_text() == LAW
    (folder / "my_law.py").write_text("# another")
    with pytest.raises(InputError, match=r"my_law\.py exists with another text"):
        save_rig(rig, folder / "saved.toml")


def test_a_law_without_a_file_cannot_be_saved(tmp_path):
    space: dict = {"__name__": "here"}
    exec(LAW, space)
    rig = load_rig("atlas").add(space["Cogging"](jnp.asarray(0.1)), "w1")
    with pytest.raises(InputError, match="put its class into a Python file"):
        save_rig(rig, tmp_path / "x.toml")


def test_faults_of_users_law_files(tmp_path):
    def refusal(text):
        (tmp_path / "law.py").write_text(text)
        block = {**effect("toothing", "w1", size=1), "law": "law.py"}
        with law_files("trust"), pytest.raises(InputError) as caught:
            parse_rig(with_effects(block), tmp_path / "rig.toml")
        return str(caught.value)

    assert "cannot be run: ZeroDivisionError" in refusal("1/0")
    assert "defines no law" in refusal("x = 1")
    assert "is one of omnijax's own" in refusal(LAW.replace('"toothing"', '"air-drag"'))
    assert "Did you mean `tothing`?" in refusal(LAW.replace('"toothing"', '"tothing"'))


TABLES = [
    ("", "has no column `theta`"),
    ("tetha,rho\n0,0", "has no column `theta` in its first row. Did you mean `tetha`?"),
    ("theta,rho\n0,0\n1,0\n2,0", "needs four rows of theta and rho at least, but has 3."),
    ("theta,rho\n0,0\n1,x\n2,0\n3,0", "whose row 2 is no pair: ['1', 'x']."),
    ("theta,rho\n0,0\n1\n2,0\n3,0", "whose row 2 is no pair: ['1']."),
    ("theta,rho\n0,0\n1,nan\n2,0\n3,0", "whose row 2 is not finite"),
    ("theta,rho\n0,0\n2,0\n1,0\n3,0", "must have increasing theta, but row 4 has 1.0."),
    ("theta,rho\n0,0\n1,0\n2,0\n3,0", "must cover one pitch (0.448799 rad) or one turn (6.28319"),
    ("theta,rho\n0,0\n2,0\n4,0\n6.283185307179586,1e-3", "does not close: rho is 0.0 at the begin"),
]


@pytest.mark.parametrize(("text", "sentence"), TABLES)
def test_faults_of_measured_profiles(tmp_path, text, sentence):
    (tmp_path / "wheel.csv").write_text(text)
    data = tables((("wheel", 0, "profile"), "table"), (("wheel", 0, "table"), "wheel.csv"))
    with pytest.raises(InputError) as caught:
        parse_rig(data, tmp_path / "rig.toml")
    assert sentence in str(caught.value) and "`wheel.w1.table` " in str(caught.value)


def test_a_missing_measured_profile(tmp_path):
    data = tables((("wheel", 0, "profile"), "table"), (("wheel", 0, "table"), "none.csv"))
    with pytest.raises(InputError, match=r"none\.csv, which cannot be read: No such file"):
        parse_rig(data, tmp_path / "rig.toml")


def test_a_table_that_no_longer_fits_its_wheel_is_not_saved(tmp_path):
    theta = [i * 2 * math.pi / 14 / 8 for i in range(8)]
    columns = {"theta": theta, "rho": [1e-4 * math.cos(14 * x) for x in theta]}
    rig = parse_rig(tables((("wheel", 0, "profile"), "table"), (("wheel", 0, "table"), columns)))
    with pytest.raises(InputError, match=r"`wheel\.w1\.rollers` cannot change: the measured"):
        omnijax.set_parameter(rig, "wheel.w1.rollers", 12)
    rollers = rig.wheels.rollers.at[0].set(12.0)
    changed = eqx.tree_at(lambda r: r.wheels.rollers, rig, rollers)
    with pytest.raises(InputError, match=r"`wheel\.w1\.rollers` is 12, but the wheel's table"):
        save_rig(changed, tmp_path / "x.toml")


@pytest.mark.parametrize("folder", [REFERENCES, RECORDINGS], ids=["references", "recordings"])
def test_rigs_that_others_wrote_load_and_survive_writing(folder):
    files = list(folder.glob("*/rig.toml"))
    assert len(files) >= 2
    for file in files:
        rig = load_rig(file)
        assert eqx.tree_equal(rig, parse_rig(tomllib.loads(rig_text(rig))))
