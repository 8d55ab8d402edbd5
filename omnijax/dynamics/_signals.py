"""What contacts and mounts hand to their laws."""

from ..laws import ContactSignal, MountSignal
from ..rig import Rig


def contact_signals(rig: Rig, deflection, rate) -> ContactSignal:
    """Signals of the contacts from delta and its rate, one entry a wheel (last axis)."""
    wheels = rig.wheels
    curvature = rig.sphere.radius * wheels.radius / (rig.sphere.radius + wheels.radius)
    contact = wheels.contact
    return ContactSignal(
        deflection, rate, contact.stiffness, contact.damping, wheels.closure.preload, curvature
    )


def mount_signals(rig: Rig, deflection, rate) -> MountSignal:
    """Signals of the mounts from Delta and its rate, one entry a wheel (last axis)."""
    mount = rig.wheels.mount
    return MountSignal(deflection, rate, mount.stiffness, mount.damping)
