"""A diagnosis in a mechanic's words: channels, places of the gap, sizes of effects."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .._text import estimate, estimated
from ..diagnosis import Diagnosis, Named
from ._content import Fact

MOST = 5  # sentences about where the gap is
PLAIN = 2.0  # times the noise: a gap that anyone sees
MINOR = 0.01  # of the largest discovery's power: below this a place is left to the table
GROUPS = {
    "dR": "the sphere's displacement", "a": "the platform's acceleration",
    "Omega": "the sphere's turning", "theta": "the wheels' angles",
    "position": "the position", "acceleration": "the acceleration",
}  # fmt: skip
_CHANNELS = {"dR": "{} in {}", "a": "{} in {}", "Omega": "{} about {}", "theta": "the angle of {1}"}


def effect_sizes(effect: Named) -> str:
    """The parameters of an effect with their 1-sigma: "gap 5.660 ± 0.002 µm"."""
    said = [
        f"{key} {', '.join(estimate(v, d, p['unit']) for v, d in _each(p))}"
        for key, p in effect.parameters.items()
    ]
    return "; ".join(said) or "no free size"


def size_facts(diagnosis: Diagnosis) -> list[Fact]:
    """The parameters of one effect, one fact each; of several effects their sizes alone."""
    facts, effects = [], diagnosis.effects
    for effect in effects:
        of = f"{effect.id} at {effect.place}" if effect.place != "axis" else effect.id
        law = diagnosis.laws.get(effect.id)
        strengths = [k for k, p in law.parameters.items() if p.linear] if law else []
        keep = set(strengths) if strengths and len(effects) > 1 else set(effect.parameters)
        for key, p in effect.parameters.items():
            if key in keep:
                facts.append(Fact(f"{key}, {of}", *_value(p)))
    return facts


def _value(parameter: Mapping[str, Any]) -> tuple[str, str]:
    """A parameter with its 1-sigma and unit, apart where it is one number."""
    each = [estimated(v, d, parameter["unit"]) for v, d in _each(parameter)]
    each = [(number.replace("-", "−"), unit) for number, unit in each]
    if len(each) > 1:
        return ", ".join(" ".join(x).strip() for x in each), ""
    number, unit = each[0]
    return (f"{number}°", "") if unit == "°" else (number, unit)


def _each(parameter: Mapping[str, Any]) -> list[tuple[float, float]]:
    """Values and 1-sigmas of one parameter, which may be a vector."""
    values, sigma = np.atleast_1d(parameter["value"]), parameter["sigma"]
    sigmas = np.broadcast_to(np.nan if sigma is None else sigma, values.shape)
    return [(float(v), float(d)) for v, d in zip(values, sigmas, strict=True)]


def channel_words(channel: str, wheels: tuple[str, ...] = ()) -> str:
    """A channel or a group in words: "the sphere's displacement in x (`dR_x`)"."""
    group, _, which = channel.partition("_")
    if group == "theta" and which.isdigit() and int(which) <= len(wheels):
        which = f"wheel {wheels[int(which) - 1]}"
    words = GROUPS.get(group, "")
    words = _CHANNELS.get(group, "{}").format(words, which) if which else words
    return f"{words} (`{channel}`)" if words else f"`{channel}`"


def where_sentences(diagnosis: Any) -> list[str]:
    """At most five sentences on where the gap is, the largest first."""
    stand = [w for w in diagnosis.where if w["stands"]]
    wheels = getattr(diagnosis.rig, "names", ())
    wheels = tuple(wheels) if not isinstance(wheels, Mapping) else ()
    rollers = {}
    if wheels and hasattr(diagnosis.rig, "wheels"):
        each = np.asarray(diagnosis.rig.wheels.rollers)
        rollers = {name: round(float(n)) for name, n in zip(wheels, each, strict=True)}
    if not stand:
        return _nothing_stands(diagnosis.where, wheels, rollers)
    said, places, largest = [], {}, max(_power(w) for w in stand)
    for w in stand:
        if _power(w) >= MINOR * largest:
            places.setdefault(_place(w, rollers), []).append(w)
    named: set[str] = set()
    for place, every in places.items():
        own = [w for w in every if w["channel"] not in named] or every[:1]
        first, *others = own
        misses = channel_words(first["channel"], wheels)
        lead = f"{_percent(first)} of what the model misses of {misses}"
        also = ", ".join(f"{_percent(w)} of `{w['channel']}`" for w in others[:2])
        said.append(f"{lead}{f' (and {also})' if also else ''} {place}.")
        named |= {w["channel"] for w in own}
    first = stand[0]
    over = first["rms_over_noise"]
    head = f"`{first['channel']}` is missed by {over:.3g} times its noise."
    said = [said[0], head, *said[1:]] if said else [head]
    return said[:MOST]


def _nothing_stands(where: Sequence[Mapping], wheels: tuple, rollers: Mapping) -> list[str]:
    """That no place is sure; where the gap is plain, the likeliest all the same."""
    plain = [w for w in where if w["rms_over_noise"] > PLAIN]
    if not plain:
        return ["Nothing stands out against chance in any channel."]
    likely = max(plain, key=_power)
    misses, over = channel_words(likely["channel"], wheels), likely["rms_over_noise"]
    return [
        f"`{likely['channel']}` is missed by {over:.3g} times its noise, but these runs are too "
        "short to tell by themselves where that comes from.",
        f"The likeliest: {_percent(likely)} of what the model misses of {misses} "
        f"{_place(likely, rollers)}.",
    ]


def _power(w: Mapping[str, Any]) -> float:
    return w["share"] * max(1e-6, w["rms_over_noise"] ** 2 - 1)


def _percent(w: Mapping[str, Any]) -> str:
    return f"{100 * w['share']:.2g} %".replace("1e+02", "100")


def _place(w: Mapping[str, Any], rollers: Mapping[str, int]) -> str:
    """When it comes: "comes once a turn of w2"."""
    name, domain, value = w["reference"], w["domain"], w["value"]
    of = "the sphere" if name == "sphere" else name
    if domain == "frequency":
        return f"comes at {value:.4g} Hz, whatever the speed"
    if domain == "order":
        count, each = round(value), rollers.get(name, 0)
        if each and count % each == 0:
            times = "" if count == each else f" {count // each} times"
            return f"comes{times} with every roller of {of} ({each} a turn)"
        turn = "over the whole travel" if name == "travel" else f"a turn of {of}"
        return f"comes {'once' if count == 1 else f'{count} times'} {turn}"
    of = f"of {of}" if name != "axis" else "of the axis"
    words = {
        "time": "comes and goes over the run: it hangs on the time",
        "phase": f"comes back with every turn {of}: it hangs on the angle {of}",
        "speed": f"hangs on how fast {'the axis moves' if name == 'axis' else f'{name} turns'}",
        "direction": f"changes with the direction of the motion {of}",
        "position": f"hangs on the position {of}",
        "load": f"follows the load {of}",
        "deflection": f"follows how far the contact {of} is pressed",
        "motion": f"is the acceleration of what is left of {name}: a body moves otherwise",
        "reading": "hangs on the reading itself: the sensor or a stiffness is not linear",
        "change": f"grows or fades over the run as a change {of} would, which is taken as constant",
    }
    return words.get(domain, f"hangs on the {domain} {of}")
