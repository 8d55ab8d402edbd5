"""What is wrong with the `[[effect]]` blocks of a rig file."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from .._consent import are_read_only
from .._errors import did_you_mean
from ..laws import ANY_LENGTH, EFFECTS
from ._declaration import declared_laws
from ._parameters import law_quantity
from ._placed import stands_twice, without_preload
from ._places import ONE_WHEEL, WORDS, places_of, port_words
from ._quantities import Quantity
from ._schema import ClosureTable, WheelTable, number_in
from ._user_laws import rigs_laws


def law_class(block: Mapping, folder: Path) -> Any:
    """The law of a block: one of omnijax's own, or of the Python file named by `law`.

    Where law files are only read, the law is what its file declares.
    """
    return _known(block, folder).get(block.get("id", ""))


def _known(block: Mapping, folder: Path) -> Mapping[str, Any]:
    if "law" not in block:
        return EFFECTS
    file = folder / str(block["law"])
    return declared_laws(file) if are_read_only() else rigs_laws(file)


def effect_problems(
    blocks: Sequence[Any], wheels: Sequence[Mapping], folder: Path
) -> Iterator[str]:
    """One sentence a problem; what the schema tells of already is left to it."""
    seen: set[tuple[str, str]] = set()
    for block in blocks:
        if not isinstance(block, Mapping) or not isinstance(block.get("id"), str):
            continue
        key, place = f"effect.{block['id']}", block.get("place")
        try:
            law = law_class(block, folder)
        except ValueError as error:
            yield f"`{key}.law`: {error}"
            continue
        if law is None:
            hint = (
                did_you_mean(block["id"], _known(block, folder)) or " `omnijax effects` lists them."
            )
            yield f"`effect.id` must be the id of a known effect, but is {block['id']!r}.{hint}"
            continue
        if isinstance(place, str):
            if (block["id"], place) in seen:
                yield stands_twice(block["id"], place)
            seen.add((block["id"], place))
            names = [str(wheel.get("name")) for wheel in wheels]
            allowed, wrong = law_places(law, names), _place_problem(law, names)
            if wrong is not None:
                yield f"`{key}.law`: {wrong}"
            elif place not in allowed:
                hint = did_you_mean(place, allowed)
                yield f"`{key}.place` must be one of {', '.join(allowed)}, but is {place!r}.{hint}"
        yield from _parameter_problems(law, block, wheels)


def law_places(law: Any, names: Sequence[str]) -> list[str]:
    """The places that a rig with wheels `names` offers a law."""
    return places_of(law.places, names)


def _place_problem(law: Any, names: Sequence[str]) -> str | None:
    """What is wrong with a law's own `places`."""
    words = port_words(law.port, len(names))
    wrong = [repr(word) for word in law.places if word not in (*words, *names)]
    if not law.places or wrong:
        said = f"has {', '.join(wrong)} in its `places`" if wrong else "has no `places`"
        some = ", ".join(WORDS.get(law.port, ONE_WHEEL))
        return f"the law {said}; a law of the port `{law.port}` may have {some}."
    return None


def _parameter_problems(law: Any, block: Mapping, wheels) -> Iterator[str]:
    given, place = block.get("parameters", {}), str(block.get("place", ""))
    if not isinstance(given, Mapping):
        return
    key = ".".join(filter(None, ("effect", law.id, place)))
    for name in given:
        if name not in law.parameters:
            known = ", ".join(law.parameters) or "none"
            hint = did_you_mean(name, law.parameters) or f" Known parameters: {known}."
            yield f"`{key}.{name}` is not a parameter of `{law.id}`.{hint}"
    for name, parameter in law.parameters.items():
        quantity = law_quantity(parameter, place, len(wheels))
        if name not in given:
            if not parameter.optional:
                yield f"`{key}.{name}` is missing. Give a value in {quantity.unit}."
            continue
        if law.id == "damaged-roller" and isinstance(quantity, Quantity) and quantity.whole:
            quantity = _of_one_roller(quantity, place, wheels)
        try:
            quantity.read(given[name])
        except ValueError as error:
            yield f"`{key}.{name}` {error}"
    yield from _length_problems(law, key, given)
    if law.id in ("wheel-runout",):
        yield from _runout_problems(key, given, place, wheels)
    preloads = {
        str(wheel.get("name")): number_in(ClosureTable, "preload", wheel.get("closure"))
        for wheel in wheels
    }
    yield from without_preload(law.id, place, preloads)


def _length_problems(law: Any, key: str, given: Mapping) -> Iterator[str]:
    """The lists of one law are equally long."""
    names = [name for name, parameter in law.parameters.items() if parameter.shape == ANY_LENGTH]
    lengths = {name: len(given[name]) for name in names if isinstance(given.get(name), list)}
    if len(set(lengths.values())) > 1:
        counts = ", ".join(f"{name} {count}" for name, count in lengths.items())
        yield f"the lists of `{key}` must be equally long, but have these entries: {counts}."


def _of_one_roller(quantity: Quantity, place: str, wheels) -> Quantity:
    """The range of a roller's number: below the wheel's number of rollers."""
    rollers = [number_in(WheelTable, "rollers", x) for x in wheels if x.get("name") == place]
    if not rollers or rollers[0] is None:
        return quantity
    return dataclasses.replace(quantity, high=rollers[0] - 1)


def _runout_problems(key: str, given: Mapping, place: str, wheels) -> Iterator[str]:
    """A wheel runs out by less than its radius."""
    try:
        size = abs(Quantity("m").read(given["amplitude"]))
        radii = [Quantity("m").read(w["radius"]) for w in wheels if place in ("all", w.get("name"))]
    except (KeyError, TypeError, ValueError):  # told elsewhere
        return
    if radii and size >= min(radii):
        yield (
            f"`{key}.amplitude` must lie below the wheel's radius {min(radii):g} m, but is "
            f"{given['amplitude']!r}."
        )
