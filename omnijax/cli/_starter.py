"""A rig file from a geometry: wheels spread evenly on one circle of latitude of the sphere."""

import math
from typing import NamedTuple

GRAVITY = 9.81  # m/s^2


class Geometry(NamedTuple):
    """What `omnijax init` is told, in SI; angles in degrees, zenith from +z (up)."""

    wheels: int
    zenith: float
    skew: float
    radius: float  # m, of the sphere
    sphere_mass: float  # kg
    platform_mass: float  # kg
    wheel_radius: float  # m
    wheel_mass: float  # kg
    rollers: int
    stiffness: float  # kN/m, contact


EXAMPLES = {
    "ballbot": Geometry(3, 45.0, 0.0, 0.12, 2.5, 10.0, 0.03, 0.12, 9, 150.0),
    "platform": Geometry(3, 125.26439, 0.0, 1.22, 5.0, 5.0, 0.0758, 0.25, 14, 188.208),
    "four-wheel": Geometry(4, 125.0, 0.0, 0.6, 8.0, 20.0, 0.06, 0.3, 12, 200.0),
}
WORDS = {
    "ballbot": "wheels above a ball on the ground",
    "platform": "three wheels below a sphere, their contact normals at right angles",
    "four-wheel": "four wheels below a sphere",
}


def starter(base: Geometry, **given: float | None) -> Geometry:
    """`base` with what was given; masses and the wheels' radius follow the sphere's radius."""
    radius = given.get("radius") or base.radius
    size = radius / base.radius
    scaled = base._replace(
        radius=radius,
        sphere_mass=base.sphere_mass * size**2,
        platform_mass=base.platform_mass * size**2,
        wheel_radius=base.wheel_radius * min(size, 1.0),
        wheel_mass=base.wheel_mass * min(size, 1.0) ** 2,
    )
    return scaled._replace(**{key: value for key, value in given.items() if value is not None})


def carried(geometry: Geometry) -> float:
    """Normal force in N of each contact from the weight alone, the same at every wheel.

    Wheels above the equator carry platform and wheels on the ball, wheels below it the sphere:
    n N |cos zenith| = weight.  0 where the wheels stand around the equator.
    """
    up = math.cos(math.radians(geometry.zenith))
    if abs(up) < 1e-3:
        return 0.0
    above = geometry.platform_mass + geometry.wheels * geometry.wheel_mass
    mass = above if up > 0 else geometry.sphere_mass
    return mass * GRAVITY / (geometry.wheels * abs(up))


def rig_text(geometry: Geometry) -> str:
    """The rig file, every number with its unit and where to get it."""
    g = geometry
    weight = carried(g)
    head = _HEAD.format(
        radius=1e3 * g.radius,
        mass=g.sphere_mass,
        inertia=2 / 3 * g.sphere_mass * g.radius**2,
        platform=g.platform_mass,
    )
    numbers = {
        "radius": 1e3 * g.wheel_radius,
        "mass": g.wheel_mass,
        "inertia": 0.5 * g.wheel_mass * g.wheel_radius**2,
        "rollers": g.rollers,
        "stiffness": g.stiffness,
        "damping": 0.12 * math.sqrt(1e3 * g.stiffness * g.sphere_mass),
        "mount_stiffness": 5 * g.stiffness,
        "mount_damping": 0.06 * math.sqrt(1e3 * g.stiffness * g.sphere_mass),
        "closure": 0.1 * g.stiffness,
        "preload": max(2 * weight, 20.0),
        "weight": weight,
    }
    wheels = [_wheel(g, i, numbers) for i in range(g.wheels)]
    return "\n".join([head, *wheels, _TAIL])


def _wheel(geometry: Geometry, index: int, numbers: dict[str, float]) -> str:
    place = {"name": f"w{index + 1}", "zenith": geometry.zenith, "skew": geometry.skew}
    place["azimuth"] = 360.0 * index / geometry.wheels
    body = _PLACE.format(**place) + _WHEEL.format(**numbers)
    if index:  # the words stand once
        lines = [line.partition("  #")[0] for line in body.splitlines() if line[:1] != "#"]
        body = "\n".join(lines) + "\n"
    return body


_HEAD = """\
#:schema ./rig.schema.json
# A rig file.  SI units; a text may carry another unit: "188.2 kN/m", "1.5 mNm", "80 Ns/m".
# Lines with `guess` were not told to `omnijax init`: put your machine's numbers there.
# z points up; x and y are yours, fixed in the platform.  `omnijax check FILE` reads the file.

[sphere]
radius = "{radius:.6g} mm"
mass = {mass:.4g}  # kg, guess
inertia = {inertia:.4g}  # kg m^2, guess: a thin shell (2/3 m R^2); a solid ball has 2/5 m R^2

[platform]
mass = {platform:.4g}  # kg, without the wheels, guess
gravity = [0, 0, -9.81]  # m/s^2
"""
_PLACE = """\
[[wheel]]
name = "{name}"
zenith = "{zenith:.9g} deg"  # where the wheel touches, seen from the sphere's centre, from +z (up)
azimuth = "{azimuth:.9g} deg"  # the same about z, from +x towards +y
skew = "{skew:.9g} deg"  # rim's direction at the contact: 0 horizontal, 90 deg down the meridian
"""
_WHEEL = """\
radius = "{radius:.6g} mm"  # largest radius, over the rollers, guess
mass = {mass:.4g}  # kg, guess
inertia = {inertia:.4g}  # kg m^2 about the axle, with rotor and gears seen through the ratio, guess
rollers = {rollers}  # per row, guess
roundness = 0.45  # gap angle / pitch angle (360 deg / rollers): 0 is a round wheel, guess
profile = "rollers"  # or gated-sine, continuous-sine, half-sine, dual-row, table: docs/glossary.md
contact = {{ stiffness = "{stiffness:.6g} kN/m", damping = {damping:.4g}, friction = 0.5 }}  # guess
mount = {{ stiffness = "{mount_stiffness:.6g} kN/m", damping = {mount_damping:.4g} }}  # guess
# What presses the wheel on: its spring (0 for a weight), and the whole force at rest, weight and
# spring ({weight:.4g} N of it would be weight; here twice that, so that no wheel lifts off).
closure = {{ stiffness = "{closure:.6g} kN/m", preload = {preload:.4g} }}
"""
_TAIL = """\
[uncertainty]  # 1-sigma of what is not known well, a share, for the diagnosis
"contact.stiffness" = 0.3  # guess, as a rubber's data sheet is
"contact.damping" = 0.3
"wheel.radius" = 5e-4  # what a drawing leaves open: a turned rim of 80 mm to 0.08 mm, two sigma
"wheel.roundness" = 0.01  # rollers of moulded rubber: their ends to 0.1 mm of a gap of 10 mm
"wheel.inertia" = 0.03  # by CAD, whose densities and small parts are not the wheel's
# "sphere.inertia" = 0.02, "wheel.zenith" = "0.1 deg", azimuth, skew or "sensor.dR.gain" = 0.01 may
# stand here too.  What is listed is calibrated, in more time, and no effect that acts alike is
# named: creep beside radii, sensor-gain beside roundness, motor-gain of all wheels beside inertias.
"""
