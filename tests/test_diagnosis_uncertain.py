"""What a rig file leaves open: numbers, tensors, directions as angles, sensors."""

import numpy as np
import pytest

from omnijax import InputError
from omnijax.diagnosis._machine.uncertain import rig_priors, with_parameters, with_sensors
from omnijax.rig import load_rig, rig_text, save_rig

LINES = """
"wheel.radius" = 5e-4
"wheel.normal" = "0.2 deg"
"wheel.w1.drive" = 0.01
"sphere.inertia" = 0.02
"sensor.dR.gain" = 0.005
"sensor.a.delay" = "0.2 ms"
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """The bundled rig with everything open."""
    text = rig_text(load_rig("atlas"))
    head, _, _ = text.partition("[uncertainty]")
    path = tmp_path_factory.mktemp("rig") / "rig.toml"
    path.write_text(head + "\n[uncertainty]\n" + LINES)
    return load_rig(path)


def test_every_open_number_is_a_prior(rig, tmp_path):
    priors = {p.name: p for p in rig_priors(rig)}
    names = list(rig.names)
    assert {f"wheel.{n}.radius" for n in names} <= set(priors)
    assert priors[f"wheel.{names[0]}.normal.first"].sigma == pytest.approx(np.deg2rad(0.2))
    assert f"wheel.{names[1]}.drive.first" not in priors
    assert priors["sensor.a.delay"].sigma == pytest.approx(2e-4)
    assert not priors["sensor.dR.gain"].relative
    save_rig(rig, tmp_path / "again.toml")
    assert rig_priors(load_rig(tmp_path / "again.toml")) == rig_priors(rig)


def test_a_direction_is_tilted_by_the_angle_and_stays_a_direction(rig):
    name = rig.names[1]
    paths = (f"wheel.{name}.normal.first", f"wheel.{name}.normal.second")
    tilted = with_parameters(rig, paths, np.array([0.003, 0.004]))
    old, new = np.asarray(rig.wheels.normal), np.asarray(tilted.wheels.normal)
    assert np.linalg.norm(new, axis=1) == pytest.approx(np.ones(rig.size), abs=1e-12)
    turned = np.arccos(np.clip(np.sum(old * new, axis=1), -1, 1))
    assert turned[1] == pytest.approx(0.005, rel=1e-3)
    assert np.delete(turned, 1) == pytest.approx(0.0, abs=1e-7)


def test_a_tensor_is_scaled_and_a_sensor_gets_a_law(rig):
    paths = ("sphere.inertia", "sensor.dR.gain", "sensor.a.delay")
    values = (np.asarray(rig.sphere.inertia) if np.ndim(rig.sphere.inertia) == 0 else 1.0) * 1.1
    changed = with_sensors(with_parameters(rig, paths, np.array([values, 0.01, 0.0])), paths,
                           (values, 0.01, 0.0))  # fmt: skip
    old, new = (np.diag(np.asarray(x.sphere.inertia_matrix)) for x in (rig, changed))
    assert new == pytest.approx(1.1 * old)
    (placed,) = changed.at("sensor")
    assert placed.place == "dR" and float(placed.law.g) == 0.01


def test_what_cannot_be_open_is_refused(tmp_path):
    text = rig_text(load_rig("atlas")).partition("[uncertainty]")[0]
    for line, match in (('"wheel.rollers" = 0.1', "must be a parameter of the rig"),
                        ('"sensor.b.gain" = 0.1', "must be a parameter of the rig"),
                        ('"wheel.radius" = "0.1 mm"', "wheel.radius"),
                        ('"sensor.a.delay" = -1', "must lie in")):  # fmt: skip
        path = tmp_path / "rig.toml"
        path.write_text(f"{text}\n[uncertainty]\n{line}\n")
        with pytest.raises(InputError, match=match):
            load_rig(path)
