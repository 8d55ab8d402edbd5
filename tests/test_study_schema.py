"""The JSON Schema of study files accepts what the reader accepts, and both refuse the same."""

import copy
import json
import re
import tomllib
from pathlib import Path
from typing import get_args

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnijax.cli._frame import run
from omnijax.cli._studies.starter import study_text
from omnijax.cli.init import Studies
from omnijax.rig import InputError, load_rig, parameter_info
from omnijax.study import load_study, parse_study, study_schema
from omnijax.study._parameters import may_vary

VALIDATOR = jsonschema.Draft202012Validator(study_schema())
KINDS = get_args(Studies)


def written(kind: str) -> str:
    return study_text(kind, "atlas", Path("study.toml"))


def test_it_is_a_schema():
    jsonschema.Draft202012Validator.check_schema(study_schema())


@pytest.mark.parametrize("kind", KINDS)
def test_what_init_writes_is_valid_and_names_its_schema(kind):
    text = written(kind)
    assert text.startswith("#:schema ./study.schema.json\n")
    VALIDATOR.validate(tomllib.loads(text))
    assert parse_study(tomllib.loads(text)).drives


FULL = {
    "rig": "atlas", "model": "coupled", "duration": 0.5, "rate": 400, "rtol": 1e-6,
    "objective": {"weights": {"rms": 1.0, "peak": 0.5}, "over": "mean", "sigmas": 2},
    "drive": [{"name": "slow", "speed": [3.0, "30 rpm", 7.3], "force": [0, 0, "1 N"]}],
    "load": [{"name": "heavy", "set": {"sphere.mass": 300.0}}],
    "variable": [{"path": "contact.stiffness", "low": 5e4, "high": "1 MN/m", "scale": "log"}],
    "constraint": [{"quantity": "slip_margin", "min": "5 N"}],
    "tolerance": {"draws": 8, "wheel.roundness": 0.1},
    "search": {"starts": 4, "seed": 1}, "pareto": {"metrics": ["rms", "peak"], "points": 5},
    "limit": {"metric": "rms", "max": "1 mm"}, "sampling": {"samples": 64},
}  # fmt: skip


def places(data, path=()):
    """Every table of the file: the path that leads there."""
    if isinstance(data, dict):
        yield path
        for key, value in data.items():
            yield from places(value, (*path, key))
    elif isinstance(data, list):
        for i, value in enumerate(data):
            yield from places(value, (*path, i))


CLOSED = [p for p in places(FULL) if "set" not in p and "weights" not in p and "tolerance" not in p]


def at(data, path):
    for part in path:
        data = data[part]
    return data


def test_the_whole_file_is_right():
    VALIDATOR.validate(FULL)
    assert parse_study(FULL).pareto == ("rms", "peak")


@given(st.data())
def test_a_wrong_key_anywhere_is_refused_by_both_and_named(data):
    path = data.draw(st.sampled_from(CLOSED))
    keys = [key for key in at(FULL, path) if isinstance(key, str)]
    key = data.draw(st.sampled_from(keys)) + "x"
    wrong = copy.deepcopy(FULL)
    at(wrong, path)[key] = 1
    assert not VALIDATOR.is_valid(wrong)
    with pytest.raises(InputError, match=f"{key}` is not a key of a study file. Did you mean"):
        parse_study(wrong)


@given(st.data())
def test_a_wrong_kind_anywhere_is_refused_by_both_and_named(data):
    path = data.draw(st.sampled_from([p for p in places(FULL) if p]))
    wrong = copy.deepcopy(FULL)
    at(wrong, path[:-1])[path[-1]] = 5
    assert not VALIDATOR.is_valid(wrong)
    with pytest.raises(InputError, match="must be a table, but is 5"):
        parse_study(wrong)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("search", "starts"), 0, r"`search.starts` must lie in \[1, inf\), but is 0"),
        (("model",), "couple", "`model` must be one of coupled, paper, but is 'couple'. Did you"),
        (("objective", "over"), "wors", "`objective.over` must be one of worst, mean, but is"),
        (("objective", "weights", "rmss"), 1, "`rmss` is no metric. Did you mean `rms`"),
        (("drive",), 5, r"`drive` must be a list of tables \(\[\[drive\]\]\), but is 5."),
        (("drive", 0, "name"), "", "`drive.1.name` must be printable text|`drive..name` must be"),
        (("variable", 0, "scale"), "ln", "`variable.contact.stiffness.scale` must be one of"),
        (("limit", "confidence"), 2, r"`limit.confidence` must lie in \(0, 0.9999\]"),
        (("rtol",), 1, r"`rtol` must lie in \(0, 0.001\]"),
    ],
)
def test_wrong_values_are_told_by_place_and_refused_by_the_schema(path, value, message):
    wrong = copy.deepcopy(FULL)
    at(wrong, path[:-1])[path[-1]] = value
    assert not VALIDATOR.is_valid(wrong)
    with pytest.raises(InputError, match=message):
        parse_study(wrong)


@pytest.mark.parametrize(("key", "value", "message"), [
    ("pareto", {"metrics": 0}, "`pareto.metrics` must be a list of 2 or 3 metrics, but is 0."),
    ("constraint", [{"quantity": "frequency_separation", "min": 0.1, "orders": []}],
     r"orders` must be a list of whole numbers from 1, but is \[\]\."),
    ("constraint", [{"quantity": "frequency_separation", "min": 0.1, "orders": [True]}],
     r"orders` must be a list of whole numbers from 1, but is \[True\]\."),
    ("constraint", [{"quantity": "slip_margin", "min": 1, "orders": [2]}],
     "`constraint.slip_margin` takes no `orders`, which belongs to `frequency_separation`."),
    ("constraint", [{"quantity": "preload", "max": 1, "poisson_ratio": [0.3, 0.3]}],
     "`constraint.preload` takes no `poisson_ratio`, which belongs to `patch_pressure`."),
    ("constraint", [{"quantity": "patch_pressure", "max": 1, "youngs_modulus": [1e9, 1e9],
                     "poisson_ratio": [0.3, 1.7]}],
     r"`constraint.patch_pressure.poisson_ratio` must lie in \(-1, 0.5\], but is 1.7."),
    ("load", [{"set": {"sphere.mass": 0}}], r"`load.1.set.sphere.mass` must lie in \(0, inf\)"),
    ("variable", [{"path": "sphere.mass", "low": 0, "high": 9}],
     r"`variable.sphere.mass.low` must lie in \(0, inf\), but is 0\."),
])  # fmt: skip
def test_what_only_the_rig_tells_is_refused_too(key, value, message):
    """The first ended in a traceback; the others were taken.

    With Poisson's ratio above 1 the pressure was 0, which no limit held.
    """
    with pytest.raises(InputError, match=message):
        parse_study(FULL | {key: value})


def test_every_key_that_blocks_lack_is_told():
    """Of a block that lacks two keys a second one went with it; of the last: a traceback."""
    blocks = [{"path": "sphere.mass"}, {"path": "wheel.mas", "low": 1, "high": 2}]
    with pytest.raises(InputError) as caught:
        parse_study(FULL | {"variable": blocks})
    told = "\n".join(caught.value.problems)
    for said in ("variable.sphere.mass.low` is missing", "variable.sphere.mass.high` is missing",
                 "the rig has no parameter `wheel.mas`"):  # fmt: skip
        assert said in told
    with pytest.raises(InputError, match=r"a \[\[variable\]\] needs `path`"):
        parse_study(FULL | {"variable": [{}]})


def test_a_study_names_its_machine():
    wrong = {key: value for key, value in FULL.items() if key != "rig"}
    with pytest.raises(InputError, match=r"`rig` is missing: name a rig file .*atlas-tripod"):
        parse_study(wrong)
    with pytest.raises(jsonschema.ValidationError, match="'rig' is a required property"):
        VALIDATOR.validate(wrong)


def test_a_rig_that_is_not_there_is_told_of_the_study_that_names_it(tmp_path):
    """The sentence named the rig file alone, which nobody had typed."""
    study = tmp_path / "s.toml"
    study.write_text('rig = "rigg.toml"\n[[drive]]\nspeed = [1, 2, 3]\n')
    with pytest.raises(InputError, match=r'(?s)s\.toml.*rig = "rigg\.toml": there is no such file'):
        load_study(study)


SPEEDS, TORQUES = "[[drive]]\nspeed = [3.0, 5.1, 7.3]", "[[drive]]\ntorque = [1.0, 2.0, 3.0]"


@pytest.mark.parametrize(("text", "command", "message"), [
    (f"{SPEEDS}\n[sampling]\nsamples = 8", "global-sensitivity",
     "`sampling.samples` must lie in [16, inf)"),
    (f'{SPEEDS}\n[objective]\nmetric = "peak_to_peak"', "design",
     "this study needs a `duration`"),
    (f'{SPEEDS}\n[pareto]\nmetrics = ["rms", "peak_to_peak"]', "pareto",
     "this study needs a `duration`"),
    (f'{SPEEDS}\n[tolerance]\n"wheel.mass" = 0.1\n"wheel.w2.mass" = 0.1', "tolerances",
     "`tolerance`: `wheel.mass` and `wheel.w2.mass` are of the same part."),
    (f"rate = 100\n{SPEEDS}", "design",
     "`rate` is that of a run, which has a `duration`: give both."),
    (f"rtol = 1e-5\n{SPEEDS}", "design",
     "study.toml: `rtol` is that of a run, which has a `duration`: give both."),
    (f'duration = 1\n{TORQUES}\n[[constraint]]\nquantity = "frequency_separation"\nmin = 1',
     "design", "`constraint.frequency_separation` needs constant speeds"),
    (f"{SPEEDS}\n[search]\nstochastic_steps = 9", "design",
     "`search.stochastic_steps` needs a [tolerance] table to draw from."),
])  # fmt: skip
def test_check_refuses_what_the_command_refuses(text, command, message, tmp_path, capsys):
    """It said `right`."""
    rest = '[[variable]]\npath = "contact.stiffness"\nlow = 1e5\nhigh = 3e5\n[limit]\n'
    file = tmp_path / "study.toml"
    file.write_text(f'rig = "atlas"\n{text}\n{rest}metric = "rms"\nrise = 0.1\n')
    for words in (["check", str(file)], [command, str(file)]):
        assert run(words) == 2
        assert message in " ".join(capsys.readouterr().err.split()), words


@pytest.mark.parametrize("path", ["wheel.normals", "wheel.w1.drives", "platform.gravitys"])
def test_no_variable_is_suggested_that_cannot_vary(path):
    """`wheel.normal` was, which is three numbers a wheel."""
    block = {"path": path, "low": 0, "high": 1}
    with pytest.raises(InputError, match=f"the rig has no parameter `{path}`") as told:
        parse_study({"rig": "atlas", "drive": [{"speed": [1, 2, 3]}], "variable": [block]})
    suggested = re.findall(r"Did you mean `(.*?)`", str(told.value))
    rig = load_rig("atlas")
    assert all(may_vary(rig, parameter_info(rig, known)) for known in suggested)


def test_check_shows_what_a_design_would_evaluate(tmp_path, capsys):
    """Loads, forces, the length of runs, bounds of constraints and cases were left out."""
    file = tmp_path / "study.toml"
    file.write_text(f"""
rig = "atlas"
duration = 0.2
rtol = 1e-5
{SPEEDS}
force = [0, 0, 5]
[[load]]
[[load]]
name = "heavy"
set = {{"sphere.mass" = 300}}
[[constraint]]
quantity = "preload"
min = 5
max = 2000
[tolerance]
"wheel.roundness" = 0.1
[limit]
metric = "rms"
max = "1 mm"
""")
    assert run(["check", str(file)]) == 0
    first, *lines = capsys.readouterr().out.splitlines()
    assert first.endswith("A study of a rig with 3 wheels.")
    assert lines == [
        "drive 1: speed 3 rad/s, 5.1 rad/s, 7.3 rad/s; force 0 N, 0 N, 5 N",
        "load 1: the rig as it is",
        "load heavy: sphere.mass 300 kg",
        "of runs of 0.2 s, 500 samples a second, rtol 1e-05",
        "judges by worst rms of 2 cases",
        "holds preload >= 5 N, preload <= 2000 N",
        "tolerances: wheel.roundness ± 10 %; 16 draws, worst",
        "limit of tolerances: rms not over 1 mm",
    ]
    file.write_text(
        f'rig = "atlas"\nmodel = "paper"\n{SPEEDS}\n[pareto]\nmetrics = ["rms", "peak"]'
    )
    assert run(["check", str(file)]) == 0
    assert capsys.readouterr().out.splitlines()[1:] == [
        "drive 1: speed 3 rad/s, 5.1 rad/s, 7.3 rad/s",
        "of the steady state: no duration is given, paper model",
        "judges by rms",
        "front of rms, peak",
    ]
    assert run(["check", str(file), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["duration"], summary["loads"]) == (None, {"as built": {}})
