"""What ports hand to laws, and what becomes of what laws return, by numbers worked out by hand.

Laws of its own (`Probe...`) let every field of a signal count, as a user's law may.
"""

import jax.numpy as jnp
import numpy as np
import pytest
from machines import ORTHOGONAL, machine
from test_formulas import made, near

from omnijax import laws
from omnijax.dynamics import sensor_readings
from omnijax.dynamics._forces import (
    RotationMoment,
    TurningLaws,
    actuated,
    command_times,
    contact_forces,
    contact_signals,
    mount_signals,
    mount_tensions,
    rest_memory,
    shaft_torques,
    torques,
)
from omnijax.dynamics._kinematics import rolling, rolling_under, surface_shape
from omnijax.rig import acting

ONE = jnp.array([1.0, 2.0, 3.0])


class ProbeActuator(laws.AbstractActuator):
    """Ten times the angle and a hundred times the speed beside the torque."""

    def __call__(self, signal, state=None):
        return signal.torque + 10 * signal.angle + 100 * signal.speed


class ProbeShaft(laws.AbstractShaft):
    """Every field at another weight."""

    def __call__(self, signal, state=None):
        return signal.angle + 10 * signal.speed + 100 * signal.command + 1000 * signal.load


class ProbeSurface(laws.AbstractSurface):
    """A sphere that is thicker on one side."""

    def __call__(self, direction, state=None):
        return direction @ jnp.array([1.0, 10.0, 100.0])


class ProbeKinematics(laws.AbstractKinematics):
    """Creep that grows with the speed: (1 - 0.05 omega) r omega is the rim's speed."""

    def __call__(self, signal, state=None):
        return -0.05 * signal


def moment(**changes):
    """A moment of three wheels with numbers that differ."""
    zero = jnp.zeros(3)
    given = {
        "axes": jnp.eye(3), "rotation": jnp.eye(3), "omega": zero, "angle": 0.1 * ONE,
        "speed": ONE, "command": 3 * ONE, "delivered": 2 * ONE, "normal_force": 50.0 * ONE,
    }  # fmt: skip
    return RotationMoment(**given | changes)


def placed(law, place="all"):
    """The law on the test rig, as it acts there."""
    rig = machine(ORTHOGONAL).add(law, place)
    return rig, acting(rig.at(law.port), 3)


def check_signals():
    """R' = R r/(R + r) = 1.22 * 0.0758/1.2958; the rest as the rig states it."""
    rig = machine(ORTHOGONAL)
    found = contact_signals(rig, ONE, 2 * ONE)
    near(found.deflection, ONE)
    near(found.rate, 2 * ONE)
    near(found.stiffness, 188208.0 * np.array([1.0, 1.1, 1.2]))
    near(found.damping, 120.0 / np.array([1.0, 1.1, 1.2]))
    near(found.preload, 150.0 / np.array([1.0, 1.1, 1.2]))
    near(found.curvature_radius, [0.092476 / 1.2958] * 3)
    held = mount_signals(rig, ONE, 2 * ONE)
    near(held.deflection, ONE)
    near(held.rate, 2 * ONE)
    near(held.stiffness, 1e6 / np.array([1.0, 1.1, 1.2]))
    near(held.damping, 60.0 * np.array([1.0, 1.1, 1.2]))


def check_contact():
    """N = N0 - K d - C d' - 2e12 d^3; a normal force that would pull becomes tension less."""
    rig, cubic = placed(made("contact-cubic", {"K3": 2e12}), "w1")
    _, off = placed(laws.LiftOff(), "all")
    # K d: 5.64624, 6.210864, 225.8496 N; C d': 0.12, -1.2/11, 0.1 N; K3 d^3 on w1: 0.054 N
    deflection, rate = jnp.array([3e-5, 3e-5, 1e-3]), jnp.array([1e-3, -1e-3, 1e-3])
    found = contact_forces(cubic, off, contact_signals(rig, deflection, rate), (None,))
    pulls = 125.0 - 225.8496 - 0.1
    near(found.normal, [150 - 5.64624 - 0.12 - 0.054, 1500 / 11 - 6.2108640 + 1.2 / 11, 0.0])
    near(found.tension, [0.054, 0.0, pulls])


def check_mount():
    """Dry friction on one wheel, and what the others do not feel."""
    rig, dry = placed(made("mount-friction", {"force": 3.0, "width": 2e-3}), "w2")
    near(
        mount_tensions(dry, mount_signals(rig, ONE, 4e-3 * ONE), (None,))[0],
        [0, 3 * np.tanh(4.0), 0],
    )


def check_command_times():
    """A delay of 30 ms at one wheel; never before the start."""
    rig, _ = placed(made("actuator-delay", {"delay": 0.03}), "w2")
    for time, expected in ((0.1, [0.1, 0.07, 0.1]), (0.01, [0.01, 0.0, 0.01])):
        near(command_times(rig.at("command"), jnp.asarray(time), 3), expected)
    near(command_times((), jnp.asarray(0.2), 3), [0.2, 0.2, 0.2])


def check_port_fields():
    """Each field of the signals by its own weight."""
    rig, (law,) = placed(ProbeActuator(), "w3")
    near(actuated(rig, law, moment(), None)[0], [0.0, 0.0, 6 + 3 + 300])
    rig, (law,) = placed(ProbeShaft(), "all")
    found, _ = shaft_torques(rig, law, moment(), None)
    near(found.shaft, (0.1 + 10 + 300 + 2000) * ONE)
    near(found.opposing, [0, 0, 0])


def check_order():
    """Actuators one after the other on the command: (3 * 1.5) limited to 4, then the friction."""
    rig = machine(ORTHOGONAL)
    for law, place in (
        (made("motor-gain", {"g": 0.5}), "w1"),
        (made("actuator-saturation", {"limit": 4.0}), "all"),
        (made("load-friction", {"mu": 0.1, "width": 1e-3}), "w1"),
    ):
        rig = rig.add(law, place)
    acting_laws = TurningLaws.of(rig)
    at, found, _ = torques(rig, acting_laws, moment(), acting_laws.rest(3))
    near(at.delivered, [4.0, 4.0, 4.0])
    near(found.shaft, [4.0 - 0.4, 4.0, 4.0])


def check_rest_memory():
    """2 (1 - a) + b = 0 and 3 - b = 0: a = 2.5, b = 3."""
    found = rest_memory(
        lambda z: (2 * (1 - z[0]) + z[1], 3 - z[1]), (jnp.asarray(9.0), jnp.asarray(-7.0))
    )
    near(np.array(found), [2.5, 3.0])
    assert rest_memory(lambda z: z, ()) == ()
    creeping = rest_memory(lambda z: (0 * z[0], 3 - z[1]), (jnp.asarray(0.7), jnp.asarray(-7.0)))
    near(np.array(creeping), [0.7, 3.0])  # nothing but turning changes the first


def check_surface():
    """The directions are those from the sphere's centre to the contacts, in the body's frame."""
    rig = machine(ORTHOGONAL).add(ProbeSurface(), "sphere")
    near(surface_shape(rig, jnp.array([1.0, 0, 0, 0])), [-1.0, -10.0, -100.0])
    quarter = jnp.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])  # body x points along inertial y
    near(surface_shape(rig, quarter), [10.0, -1.0, -100.0])


def check_speed_dependent_rolling():
    """(1 - 0.05 w) w = rim/r: w = 10 (1 - sqrt(1 - 0.2 rim/r)), on round rollers."""
    rig = machine(ORTHOGONAL, radius=0.061, roundness=0.0).add(ProbeKinematics(), "all")
    omega = jnp.array([0.2, 0.1, 0.15])  # the wheels drive about y, z, x
    rim = np.array([1.22 * 0.1, 1.22 * 0.15, 1.22 * 0.2]) / 0.061
    speed = 10 * (1 - np.sqrt(1 - 0.2 * rim))
    geometry = rolling_under(rig, jnp.zeros(3), omega)
    near(geometry.axes @ omega, [0.1, 0.15, 0.2])
    near(geometry.radius, 0.061 * (1 - 0.05 * speed), 1e-11)
    near(rolling(rig, jnp.zeros(3), jnp.asarray(speed)).radius, geometry.radius, 1e-11)


def check_readings():
    """Laws in the order of the rig, each on what the former left of its group or channel."""
    rig = machine(ORTHOGONAL)
    for law, place in (
        (made("sensor-gain", {"g": 0.5}), "dR"),
        (made("sensor-drift", {"a": 1.0, "b": 2.0}), "dR_y"),
        (made("sensor-crosstalk", {"X_xy": 0.1}), "dR"),
        (made("sensor-gain", {"g": 9.0}), "a"),
        (made("sensor-saturation", {"limit": 3.0}), "theta_3"),
    ):
        rig = rig.add(law, place)
    time, values = jnp.array([0.0, 0.5]), jnp.array([[1.0, 2.0, 4.0], [2.0, 6.0, 8.0]])
    found = sensor_readings(rig, "dR", time, values)  # 1.5 y + 1 + 2 t, then x += 0.1 y
    near(found, [[1.5 + 0.4, 4.0, 6.0], [3.0 + 1.1, 11.0, 12.0]])
    near(sensor_readings(rig, "theta", time, values), [[1, 2, 3], [2, 6, 3]])
    near(sensor_readings(rig, "Omega", time, values), values)


CHECKS = {
    "signals": check_signals,
    "contact forces": check_contact,
    "mount tensions": check_mount,
    "command times": check_command_times,
    "fields of the ports": check_port_fields,
    "order of actuators": check_order,
    "memory at rest": check_rest_memory,
    "surface": check_surface,
    "rolling that asks for the speed": check_speed_dependent_rolling,
    "sensor readings": check_readings,
}


@pytest.mark.parametrize("name", list(CHECKS))
def test_port(name):
    CHECKS[name]()
