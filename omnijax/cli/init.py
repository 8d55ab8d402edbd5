"""`omnijax init`: a commented rig file, from a geometry or an example, or a study file."""

from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from .._errors import InputError
from .._files import claim, write_bytes
from ._inputs import Force, MaybeWhole, check_ending, number
from ._starter import EXAMPLES, rig_text, starter
from ._studies import study_text, template

Studies = Literal["sweep", "sensitivity", "design", "pareto", "tolerances", "global-sensitivity"]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ShapeOptions:
    """Where the wheels sit."""

    example: Literal["ballbot", "platform", "four-wheel"] | None = None
    """A machine to start from."""
    wheels: MaybeWhole = None
    """Number of wheels, spread evenly around the vertical."""
    zenith: str | None = None
    """Angle from the top of the sphere to the wheels (45 or 45deg)."""
    skew: str | None = None
    """Angle of the rim's direction to the horizontal; 0 where not given."""
    radius: str | None = None
    """Radius of the sphere (120mm)."""
    rollers: MaybeWhole = None
    """Rollers of a wheel."""

    def text(self) -> str | None:
        """The rig file; None where no geometry was asked for."""
        if all(value is None for value in vars(self).values()):
            return None
        zenith, skew = _degrees("zenith", self.zenith), _degrees("skew", self.skew)
        if zenith is not None and not 0 < zenith < 180:
            raise InputError(f"`zenith` must lie between 0 and 180 deg, but is {zenith:g}.")
        radius = None if self.radius is None else number("radius", self.radius, "m")
        if radius is not None and not 0 < radius < float("inf"):
            raise InputError(f"`radius` must lie in (0, inf) m, but is {radius:g}.")
        for name, value, most in self._counts():
            if value is not None and not 1 <= value <= most:
                raise InputError(f"`{name}` must lie in [1, {most}], but is {value}.")
        below = zenith is not None and zenith > 90
        base = EXAMPLES[self.example or ("platform" if below else "ballbot")]
        given = {"wheels": self.wheels, "zenith": zenith, "skew": skew, "radius": radius}
        return rig_text(starter(base, **given, rollers=self.rollers))

    def _counts(self) -> list[tuple[str, int | None, int]]:
        from ..rig import MOST_ROLLERS, MOST_WHEELS

        return [("wheels", self.wheels, MOST_WHEELS), ("rollers", self.rollers, MOST_ROLLERS)]


def init(
    file: Path | None = None,
    /,
    *,
    shape: ShapeOptions = ShapeOptions(),
    study: Studies | None = None,
    rig: str | None = None,
    axis: Annotated[bool, Parameter(negative="")] = False,
    force: Force = False,
) -> None:
    """Write a commented rig file with every key, or a study file, to be filled in.

    Example: omnijax init my-rig.toml

    Example: omnijax init ballbot.toml --wheels 3 --zenith 45 --radius 120mm

    Example: omnijax init study.toml --study design --rig ballbot.toml

    Parameters
    ----------
    file
        The file to write; rig.toml, or study.toml with --study, where it is not given.
    study
        Write a study file for this command instead.
    rig
        The rig that the study file names, whose numbers its ranges are made from; rig.toml where
        it is not given.
    axis
        Write a machine file of one axis (machine.toml) instead.
    """
    if axis and (study is not None or shape != ShapeOptions()):
        raise InputError("--axis writes a machine file: it goes with no study and no geometry.")
    if rig is not None and study is None:
        raise InputError("--rig names the machine of a study file: give --study KIND too.")
    usual = "machine.toml" if axis else "rig.toml" if study is None else "study.toml"
    file = file or Path(usual)
    check_ending(file, ".toml")
    claim([file], force=force)
    if study is not None and (shape != ShapeOptions()):
        raise InputError("a study file has no geometry: write the rig file by a call of its own.")
    if axis:
        made = resources.files("omnijax") / "machine" / "data" / "machine.toml"
        write_bytes(file, made.read_bytes())
        print(f"Wrote {file}. Fill in your numbers, then: omnijax check {file}")
        print("For an editor that checks it: omnijax schema --machine > machine.schema.json")
        return
    text = (
        study_text(study, rig or "rig.toml", file)
        if study is not None
        else shape.text() or template("rig.toml")
    )
    write_bytes(file, text.encode())
    then = "check" if study is None else study
    print(f"Wrote {file}. Fill in your numbers, then: omnijax {then} {file}")
    kind, option = ("rig", "") if study is None else ("study", " --study")
    print(f"For an editor that checks it: omnijax schema{option} > {kind}.schema.json")


def _degrees(name: str, text: str | None) -> float | None:
    """An angle in degrees: a plain number is one, text may carry a unit."""
    import math

    if text is None:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.degrees(number(name, text, "rad"))
    if not -360 <= value <= 360:
        raise InputError(f"`{name}` must lie in [-360, 360] deg, but is {value:g}.")
    return value
