"""What the pages' 3-D scene needs to know of a machine."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader

from ..rig import Rig

WEB = Path(__file__).parent / "web"


def machine_scene(rig: Rig) -> dict[str, Any]:
    """Sphere and wheels as plain numbers: m, unit vectors, whole rollers."""
    wheels = rig.wheels
    return {
        "radius": float(rig.sphere.radius),
        "wheels": [
            {
                "name": name,
                "normal": np.asarray(wheels.normal[i]).tolist(),
                "drive": np.asarray(wheels.drive[i]).tolist(),
                "radius": float(wheels.radius[i]),
                "rollers": round(float(wheels.rollers[i])),
                "roundness": float(wheels.roundness[i]),
            }
            for i, name in enumerate(rig.names)
        ],
    }


@cache
def bundle() -> str:
    """The pages' script, safe to stand inside a script element."""
    return (WEB / "bundle.js").read_text(encoding="utf-8").replace("</script", "<\\/script")


@cache
def chart_style() -> str:
    """The charts' style sheet."""
    return (WEB / "uPlot.min.css").read_text(encoding="utf-8")


def embedded_json(value: Any) -> str:
    """JSON that can stand inside a script element whatever its strings hold."""
    text = json.dumps(value, allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def page(template: str, **values: Any) -> str:
    """One of this package's pages, everything escaped but the script and the style."""
    environment = Environment(loader=PackageLoader("omnijax.view", "web"), autoescape=True)
    return environment.get_template(template).render(
        bundle=bundle(), chart_style=chart_style(), **values
    )
