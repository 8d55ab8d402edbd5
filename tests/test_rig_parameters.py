"""Parameter paths: every one reads, sets, differentiates and batches."""

import contextlib
import tomllib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import effect, tables, with_effects
from seeds import drawn_anew

from omnijax.cli._starter import EXAMPLES
from omnijax.cli._starter import rig_text as starter
from omnijax.cli._studies.starter import template
from omnijax.laws import EFFECTS, AirDrag, BearingViscous, Creep
from omnijax.rig import (
    InputError,
    closed_numbers,
    get_parameter,
    load_rig,
    parameter_info,
    parameter_paths,
    parse_rig,
    read_parameter,
    set_parameter,
)
from omnijax.rig._places import places_of, port_places


def full_rig():
    data = with_effects(
        effect("wheel-runout", "w2", amplitude=8.1e-5, phase=0.4),
        effect("unbalance", "sphere", offset=[1e-3, 0, 2e-3]),
        effect("contact-hertz", "all"),
        effect("sensor-drift", "dR_z", a=1e-6, b=1e-7),
    )
    data["wheel"][2] |= {"profile": "dual-row", "row_spacing": 0.03, "roundness": 0.4}
    return parse_rig(data)


RIG = full_rig()
PATHS = [info.path for info in parameter_paths(RIG)]


def test_the_list_is_complete_and_each_path_stands_once():
    assert len(set(PATHS)) == len(PATHS)
    wheel = {path.removeprefix("wheel.w1.") for path in PATHS if path.startswith("wheel.w1.")}
    assert len(wheel) == 14
    expected = {"sphere.mass", "platform.gravity", "wheel.radius", "contact.stiffness"}
    expected |= {"effect.wheel-runout.w2.phase", "wheel.w3.row_spacing", "effect.unbalance.sphere"}
    assert expected - {"effect.unbalance.sphere"} <= set(PATHS)
    assert "effect.contact-hertz.all.modulus" not in PATHS  # not given, so not a number


@pytest.mark.parametrize("path", PATHS)
def test_every_path_sets_what_it_reads_and_nothing_else(path):
    old = get_parameter(RIG, path)
    new = 0.5 * old + 0.25
    changed = jax.jit(lambda v: set_parameter(RIG, path, v))(new)
    assert np.array_equal(get_parameter(changed, path), new)
    assert eqx.tree_equal(set_parameter(changed, path, old), RIG)
    kept = sum(
        np.array_equal(a, b)
        for a, b in zip(jax.tree.leaves(changed), jax.tree.leaves(RIG), strict=True)
    )
    assert kept == len(jax.tree.leaves(RIG)) - 1
    assert parameter_info(RIG, path).shape == old.shape


def test_spellings_of_one_parameter():
    rig = set_parameter(RIG, "contact.stiffness", 2e5)
    assert get_parameter(rig, "wheel.contact.stiffness").tolist() == [2e5] * 3
    rig = set_parameter(rig, "wheel.w2.contact.stiffness", 3e5)
    assert get_parameter(rig, "contact.stiffness").tolist() == [2e5, 3e5, 2e5]
    rig = set_parameter(rig, "wheel.contact.stiffness", [1e5, 2e5, 3e5])
    assert float(get_parameter(rig, "wheel.w3.contact.stiffness")) == 3e5


def test_derivatives_go_to_the_named_wheel_only():
    gradient = jax.grad(lambda v: jnp.sum(set_parameter(RIG, "wheel.w2.mass", v).wheels.mass ** 2))(
        3.0
    )
    assert gradient == pytest.approx(6.0)
    batch = jax.vmap(lambda v: set_parameter(RIG, "wheel.mass", v).total_mass)(jnp.arange(3.0))
    assert np.diff(batch) == pytest.approx([3.0, 3.0])


def test_isotropic_inertia_may_become_a_tensor():
    rig = set_parameter(RIG, "sphere.inertia", 2.0 * jnp.eye(3))
    assert rig.sphere.inertia_matrix.tolist() == (2.0 * np.eye(3)).tolist()


def test_an_inertia_that_no_body_has_is_refused_as_in_a_file():
    """`save_rig` wrote it, and `load_rig` refused the file."""
    rng = drawn_anew("moments of no body")
    low, middle = np.sort(rng.uniform(0.5, 2.0, 2))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    wrong, right = (
        turn @ np.diag([low, middle, share * (low + middle)]) @ turn.T for share in (1.1, 0.99)
    )
    with pytest.raises(InputError, match="must obey the triangle inequality"):
        set_parameter(RIG, "sphere.inertia", (wrong + wrong.T) / 2)
    set_parameter(RIG, "sphere.inertia", (right + right.T) / 2)


def test_a_tensor_may_become_isotropic_inertia_again():
    """A number filled all nine entries: a singular inertia, with which runs were wrong."""
    tensor = set_parameter(RIG, "sphere.inertia", np.diag([0.020, 0.021, 0.022]))
    wanted = (0.03 * np.eye(3)).tolist()
    for given in (0.03, "0.03 kg m^2", jnp.asarray(0.03)):
        rig = set_parameter(tensor, "sphere.inertia", given)
        assert rig.sphere.inertia_matrix.tolist() == wanted
        assert get_parameter(rig, "sphere.inertia") == 0.03

    def matrix(x):
        return set_parameter(tensor, "sphere.inertia", x).sphere.inertia_matrix

    assert jax.vmap(matrix)(jnp.array([0.03, 0.04]))[0].tolist() == wanted
    assert jax.jacobian(matrix)(0.03).tolist() == np.eye(3).tolist()
    with pytest.raises(
        InputError, match=r"`sphere.inertia` has shape \(\), but the value has \(3,"
    ):
        jax.jit(matrix)(jnp.ones(3))


def test_directions_that_are_set_are_held_to_what_files_are():
    """Lengths up to 1 % off stayed as they were, and any angle between the two was taken."""
    normal = np.asarray(RIG.wheels.normal[0])
    rig = set_parameter(RIG, "wheel.w1.normal", 1.005 * normal)
    assert rig.wheels.normal[0].tolist() == normal.tolist()
    tilted = 1.004 * normal + 0.004 * np.asarray(RIG.wheels.drive[0])
    rig = set_parameter(RIG, "wheel.w1.normal", tilted.tolist())
    given = RIG.wheels.drive[0].tolist()
    data = tables((("wheel", 0, "normal"), tilted.tolist()), (("wheel", 0, "drive"), given))
    of_file = parse_rig(data).wheels
    assert rig.wheels.normal[0].tolist() == of_file.normal[0].tolist()
    assert rig.wheels.drive[0].tolist() == of_file.drive[0].tolist()
    for value in (RIG.wheels.drive[0], ["0", "0", "1"], RIG.wheels.drive):
        path = "wheel.normal" if np.ndim(value) == 2 else "wheel.w1.normal"
        with pytest.raises(InputError, match=rf"`{path}`: `drive` of w1 must be perpendicular to"):
            set_parameter(RIG, path, value)


def test_a_preload_of_0_is_refused_where_hertz_contacts_need_one():
    for path in ("closure.preload", "wheel.w2.closure.preload"):
        with pytest.raises(
            InputError, match=r"needs a preload, but `wheel.w\d.closure.preload` is"
        ):
            set_parameter(RIG, path, "0 N")
    set_parameter(load_rig("atlas"), "closure.preload", 0)


def test_numbers_of_a_group_of_sensors_have_its_unit():
    rig = parse_rig(with_effects(effect("sensor-saturation", "dR", limit="1 mm")))
    assert get_parameter(rig, "effect.sensor-saturation.dR.limit") == 1e-3
    assert parameter_info(rig, "effect.sensor-saturation.dR.limit").unit == "m"


def test_the_number_of_a_damaged_roller_is_whole():
    rig = parse_rig(with_effects(effect("damaged-roller", "w1", roller=3, severity=0.1)))
    path = "effect.damaged-roller.w1.roller"
    assert parameter_info(rig, path).whole
    with pytest.raises(InputError, match="must be a whole number in"):
        set_parameter(rig, path, 2.5)


def test_unknown_paths_and_wrong_shapes():
    for wrong, near in [
        ("contact.stifness", "contact.stiffness"),
        ("wheel.w2.radus", "wheel.w2.radius"),
        ("effect.wheel-runout.w2.amplitud", "effect.wheel-runout.w2.amplitude"),
        ("wheel.w1.row_spacing", "wheel.w3.row_spacing"),
    ]:
        with pytest.raises(InputError, match=f"no parameter `{wrong}`. Did you mean `{near}`"):
            get_parameter(RIG, wrong)
    with pytest.raises(InputError, match=r"`wheel.mass` has shape \(3,\), but the value has \(2,"):
        set_parameter(RIG, "wheel.mass", [1.0, 2.0])
    with pytest.raises(InputError, match=r"no parameter `effect\.contact-hertz\.all\.modulus`"):
        get_parameter(RIG, "effect.contact-hertz.all.modulus")


def test_units_and_ranges():
    info = parameter_info(RIG, "wheel.roundness")
    assert (info.unit, info.low, info.high, info.shape) == ("1", 0, 1, (3,))
    assert parameter_info(RIG, "effect.sensor-drift.dR_z.b").unit == "m/s"
    assert parameter_info(RIG, "wheel.rollers").whole
    ends = {"wheel.roundness": "[0, 1]", "sphere.mass": "(0, inf)", "sphere.inertia": "(0, inf)"}
    assert {path: parameter_info(RIG, path).range for path in ends} == ends
    assert read_parameter(RIG, "contact.stiffness", "188.2 kN/m") == pytest.approx(188200.0)
    with pytest.raises(InputError, match=r"`wheel.roundness` must lie in \[0, 1\], but is 1\.3\."):
        read_parameter(RIG, "wheel.roundness", 1.3)


def test_uncertainty_speaks_of_paths_that_exist():
    """Every spelling that the file may use is one that `get_parameter` knows."""
    for path in ("contact.damping", "wheel.contact.damping", "wheel.w1.mount.stiffness"):
        rig = parse_rig(tables((("uncertainty", path), 0.2)))
        assert (path, 0.2) in rig.uncertainty
        assert get_parameter(rig, path).size in {1, 3}
    for path, _ in load_rig("atlas").uncertainty:
        assert get_parameter(RIG, path).shape == (3,)


def test_files_to_begin_with_list_what_a_drawing_leaves_open():
    """Parts within tolerance were taken for exact, and named as creep and sensors' gains."""
    starts = [load_rig("atlas"), load_rig("atlas-tripod")]
    starts.append(parse_rig(tomllib.loads(template("rig.toml"))))
    starts.append(parse_rig(tomllib.loads(starter(EXAMPLES["ballbot"]))))
    for rig in starts:
        listed = dict(rig.uncertainty)
        assert {"wheel.radius", "wheel.roundness", "wheel.inertia"} < set(listed)
        assert closed_numbers(rig) == []


def test_a_law_is_added_at_a_place_that_exists():
    rig = RIG.add(BearingViscous(jnp.asarray(0.1)), "all")
    assert rig.effects[-1].wheels == (0, 1, 2)
    assert RIG.add(BearingViscous(jnp.asarray(0.1)), "w2").effects[-1].wheels == (1,)
    with pytest.raises(InputError, match=r"cannot be placed at 'shere': .* Did you mean `sphere`"):
        RIG.add(AirDrag(jnp.asarray(0.1)), "shere")
    with pytest.raises(InputError, match="`creep` cannot be placed at 'all': it stands at w1, w2"):
        RIG.add(Creep(jnp.asarray(0.01)), "all")  # its rig file could not be read again


@pytest.mark.parametrize("id", EFFECTS)
def test_a_law_stands_in_memory_where_it_may_stand_in_a_file(id):
    """`rig.add` took every place of a law's port: some rigs so made were saved and not read."""
    law = EFFECTS[id]
    numbers = (
        jnp.ones(abs(p.shape)) if p.shape else jnp.asarray(1.0) for p in law.parameters.values()
    )
    made, stood = law(*numbers), []
    for place in port_places(law.port, RIG.names):
        with contextlib.suppress(InputError):
            stood.append(RIG.add(made, place).effects[-1].place)
    assert sorted(stood) == sorted(places_of(law.places, RIG.names))
