"""`omnijax explore`: a local page with sliders."""

from typing import Annotated, Any

from cyclopts import Parameter

from ._inputs import Whole, number, numbers
from ._studies import usual_speeds


def explore(
    *rigs: Annotated[str, Parameter(help="Rig files or names of bundled rigs, side by side.")],
    speed: str | None = None,
    omega: str | None = None,
    port: Whole = 8765,
    host: str = "127.0.0.1",
    browser: bool = True,
) -> None:
    """Open a local page: the machine in motion, sliders, live vibration, orders and resonances.

    Example: omnijax explore atlas atlas-tripod --speed 0.6,1.2,0.9

    Parameters
    ----------
    speed
        Wheel speeds to start from in rad/s, one a wheel or one for all; or with units (30 rpm).
        Without it the wheels roll together with the sphere.
    omega
        The sphere's angular velocity to start from in rad/s: x,y,z (or 0,0,10 rpm), in place of
        --speed.
    port
        Port of the page; 0 takes a free one.
    host
        Address to listen on. Anyone who reaches another address than the loopback can use the page.
    browser
        Open the page in the browser.
    """
    from .._errors import InputError, require, tell

    require("starlette", "view3d")
    require("uvicorn", "view3d")
    from ..rig import load_rig

    if not rigs:
        raise InputError("name at least one rig: omnijax explore atlas")
    machines = {name: load_rig(name) for name in rigs}
    from ..simulation import remarks
    from ..simulation import speeds as drive_by
    from ..view import serve

    speeds = {name: start_speeds(speed, omega, machine) for name, machine in machines.items()}
    for name, machine in machines.items():
        tell(remarks(machine, drive_by(speeds[name]), None, "coupled"))
    serve(machines, speeds, host=host, port=port, browser=browser)


def start_speeds(text: str | None, omega: str | None, rig: Any) -> list[float]:
    """Wheel speeds of `--speed` (one a wheel, or one for all) or `--omega`; else some that fit."""
    from .._errors import InputError
    from ..dynamics import fitting_speeds

    if text is not None and omega is not None:
        raise InputError("give one of --speed, --omega, but both are given.")
    if omega is not None:
        return fitting_speeds(rig, numbers("omega", omega, "rad/s", 3, "components"))
    if text is None:
        return usual_speeds(rig)
    if "," not in text:
        return [number("speed", text, "rad/s")] * rig.size
    return numbers("speed", text, "rad/s", rig.size)
