"""The keys of a study file: models that pydantic checks files by, and editors by a JSON Schema.

What hangs on the rig (does a parameter exist, does a drive have one number a wheel, what is the
unit of a bound) is checked afterwards, by the modules beside.
"""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic.config import JsonDict
from pydantic_core import core_schema

from ...rig import Quantity
from ...vibration import METRICS
from .._constraints import QUANTITIES


class _Open:
    """Checked where the rig is known; editors see what it may look like."""

    def __init__(self, schema: dict[str, Any]):
        self.schema = schema

    def __get_pydantic_core_schema__(self, source, handler):
        return core_schema.any_schema()

    def __get_pydantic_json_schema__(self, schema, handler):
        return self.schema


class _Text:
    """Printable text of some length."""

    def __get_pydantic_core_schema__(self, source, handler):
        def read(given: Any) -> str:
            if not isinstance(given, str) or not given.strip() or not given.isprintable():
                raise ValueError(f"must be printable text, but is {given!r}.")
            return given

        return core_schema.no_info_plain_validator_function(read)

    def __get_pydantic_json_schema__(self, schema, handler):
        return {"type": "string", "minLength": 1}


class _Word:
    """Text; which words are known is told where they are used."""

    def __init__(self, words: list[str]):
        self.words = words

    def __get_pydantic_core_schema__(self, source, handler):
        return core_schema.str_schema(strict=True)

    def __get_pydantic_json_schema__(self, schema, handler):
        return {"enum": self.words}


LEAST_SAMPLES = 16  # blocks of a global sensitivity
_NUMBER = Quantity("1").json_schema()
Text = Annotated[str, _Text()]
OfPath = Annotated[Any, _Open(_NUMBER | {"description": "in the unit of what it bounds, or text"})]
Vibration = Annotated[str, _Word([name for name, x in METRICS.items() if x.smaller_is_better])]
Numbers = Annotated[Any, _Open({"anyOf": [_NUMBER, {"type": "array", "items": _NUMBER}]})]
Pair = Annotated[Any, _Open({"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": 2})]
Orders = Annotated[Any, _Open({"type": "array", "items": {"type": "integer", "minimum": 1}})]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Objective(_Table):
    """What counts, over drives, loads and tolerances."""

    metric: Vibration = "rms"
    weights: dict[Literal[*METRICS], Annotated[float, Quantity("1", above=0)]] | None = None  # pyright: ignore
    over: Literal["worst", "mean"] = "worst"
    spread: Literal["worst", "mean+sigma"] = "worst"
    sigmas: Annotated[float, Quantity("1", low=0)] = 3.0


class DriveTable(_Table):
    """Constant wheel speeds (rad/s) or motor torques (N m), and a force on the platform (N).

    `omega` is the sphere's angular velocity (rad/s), in place of the wheel speeds that fit it.
    """

    name: Text | None = None  # else its number
    speed: Numbers = []
    omega: Numbers = []
    torque: Numbers = []
    force: Numbers = [0.0, 0.0, 0.0]


class LoadTable(_Table):
    """Parameters with values of their own in one case."""

    name: Text | None = None  # else its number
    set: dict[str, OfPath] = {}


class VariableTable(_Table):
    """A parameter of the rig or its drive that may change."""

    path: Text
    low: OfPath
    high: OfPath
    scale: Literal["linear", "log"] = "linear"
    start: OfPath = None
    distribution: Literal["uniform", "normal"] = "uniform"
    levels: Annotated[int, Quantity("1", low=2, whole=True), AfterValidator(int)] = 10  # of a sweep


class ConstraintTable(_Table):
    """What must hold of a design."""

    quantity: Annotated[str, _Word([*QUANTITIES, *METRICS])]
    min: OfPath = None
    max: OfPath = None
    orders: Orders = [1]
    youngs_modulus: Pair = None
    poisson_ratio: Pair = None


class SearchTable(_Table):
    """How the answer is looked for."""

    starts: Annotated[int, Quantity("1", low=1, whole=True), AfterValidator(int)] = 8
    seed: Annotated[int, Quantity("1", low=0, whole=True), AfterValidator(int)] = 0
    batch: Annotated[int, Quantity("1", low=1, whole=True), AfterValidator(int)] = 8
    stochastic_steps: Annotated[int, Quantity("1", low=0, whole=True), AfterValidator(int)] = 0


class ParetoTable(_Table):
    """The metrics of a front, and its number of points."""

    metrics: Annotated[
        Any,
        _Open({"type": "array", "items": {"enum": list(METRICS)}, "minItems": 2, "maxItems": 3}),
    ] = []
    points: Annotated[int, Quantity("1", low=3, whole=True), AfterValidator(int)] = 12


class LimitTable(_Table):
    """What tolerances must hold, and for what share of machines."""

    metric: Vibration
    max: OfPath = None
    rise: Annotated[float, Quantity("1", above=0)] | None = None  # over the nominal machine's
    confidence: Annotated[float, Quantity("1", above=0, high=0.9999)] = 0.99


class SamplingTable(_Table):
    """How many blocks of runs a global sensitivity takes."""

    samples: Annotated[int, Quantity("1", low=LEAST_SAMPLES, whole=True), AfterValidator(int)] = 256


_Part = Annotated[float, Quantity("1", above=0, high=0.9)]


class ToleranceTable(BaseModel):
    """Relative half widths by path, and the number of draws."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, _Part] = Field(init=False)
    draws: Annotated[int, Quantity("1", low=2, whole=True), AfterValidator(int)] = 16


def _no_default(schema: JsonDict) -> None:
    schema.pop("default", None)


class StudyTable(_Table):
    """A study file."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"required": ["rig", "drive"]})
    rig: Annotated[Text, Field(json_schema_extra=_no_default)] = ""
    model: Literal["coupled", "paper"] = "coupled"
    duration: Annotated[float, Quantity("s", above=0)] | None = None
    rate: Annotated[float, Quantity("1/s", above=0)] | None = None
    rtol: Annotated[float, Quantity("1", above=0, high=1e-3)] | None = None
    objective: Objective = Objective()
    drive: Annotated[list[DriveTable], Field(json_schema_extra={"minItems": 1})] = []
    load: list[LoadTable] = []
    variable: list[VariableTable] = []
    constraint: list[ConstraintTable] = []
    tolerance: ToleranceTable = ToleranceTable()
    search: SearchTable = SearchTable()
    pareto: ParetoTable = ParetoTable()
    limit: LimitTable | None = None
    sampling: SamplingTable = SamplingTable()


def study_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a study file."""
    schema = StudyTable.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "omnijax study file"
    schema["properties"]["rig"]["description"] = "a rig file beside the study, or a bundled rig"
    return schema
