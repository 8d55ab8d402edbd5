"""The numbers that steer a diagnosis, in one frozen object, each with where it comes from.

A section belongs to the file of its name, whose work it steers; `free_` are those of machines that
are run freely.  Numbers that change the time and the memory of a diagnosis but no answer stand
where they are used.  Every number says what it is, and after a colon one of these words:

- derived: follows from the statement beside it, or is computed here from another number;
- required: the project's specification or one of its issues asks for it;
- prototype: from a first program that knew the truth of the twelve public recordings;
- own cases: what a case needed that is for work, of `benchmarks/hidden_effects`, of
  `benchmarks/axes` or of the tests; a seed is one of the first's;
- measured: the figure that was measured stands beside it;
- time: it bounds the work: more costs time, less may end too early;
- memory: it bounds the memory;
- rounding: lies far above what double precision leaves and far below what anybody asks for;
- convention: what the field or this project writes in all such places;
- chosen: the first that worked; what it trades stands beside it.

Of the search's fifteen thresholds that `benchmarks.hidden_effects thresholds` varies, each was
halved and doubled on two seeds, and no answer changed; of the others nothing like it is known.
"""

from dataclasses import dataclass, field

from .answer import (
    AnswerLearnedSettings,
    AnswerResultSettings,
    ExperimentSettings,
    RigEvidenceSettings,
    ShownSettings,
    SizesSettings,
    StretchesSettings,
    UnlistedSettings,
    VerdictSettings,
)
from .candidates import (
    CandidatesSettings,
    FunctionModelSettings,
    StartsSettings,
    ThroughLawsSettings,
)
from .case import AxisCaseSettings, DiagnoseSettings, NoiseSettings, RoomSettings
from .fits import (
    CalibrationSettings,
    DoubtSettings,
    FitSettings,
    GaussNewtonSettings,
    HeldOutSettings,
    ModelSettings,
    RefitsSettings,
    ValleySettings,
    WavesSettings,
)
from .free import (
    FreeBeforeSettings,
    FreeBuildSettings,
    FreeEvidenceSettings,
    FreeExperimentSettings,
    FreeFloorSettings,
    FreeKnownSettings,
    FreeLearnedSettings,
    FreeModelSettings,
    FreeReopenedSettings,
)
from .free_rows import (
    FreeCandidatesSettings,
    FreeColourSettings,
    FreeOrdersSettings,
    FreeRowsSettings,
    FreeSensorNoiseSettings,
    FreeTogetherSettings,
    FreeUndecidedSettings,
)
from .gaps import (
    LevelsSettings,
    LimitsSettings,
    ReadingsSettings,
    SpectrumSettings,
    SteadinessSettings,
    WhereSettings,
)
from .machine import (
    ClocksSettings,
    LineSetsSettings,
    LocateSettings,
    RigModelSettings,
    RigOrdersSettings,
)
from .machine_noise import (
    DataVectorSettings,
    EncodersSettings,
    NoiseModelSettings,
    TurningNoiseSettings,
)
from .prediction import PredictionSettings, SmoothSettings, TangentsSettings
from .preparation import (
    ComparedSettings,
    OutliersSettings,
    RolesSettings,
    RunsSettings,
    StartAnglesSettings,
)
from .search import SearchSettings


@dataclass(frozen=True)
class Settings:
    """All of them."""

    # cases
    axis_case: AxisCaseSettings = field(default_factory=AxisCaseSettings)
    diagnose: DiagnoseSettings = field(default_factory=DiagnoseSettings)
    noise: NoiseSettings = field(default_factory=NoiseSettings)
    room: RoomSettings = field(default_factory=RoomSettings)
    # the search
    search: SearchSettings = field(default_factory=SearchSettings)
    candidates: CandidatesSettings = field(default_factory=CandidatesSettings)
    starts: StartsSettings = field(default_factory=StartsSettings)
    through_laws: ThroughLawsSettings = field(default_factory=ThroughLawsSettings)
    function_model: FunctionModelSettings = field(default_factory=FunctionModelSettings)
    refits: RefitsSettings = field(default_factory=RefitsSettings)
    calibration: CalibrationSettings = field(default_factory=CalibrationSettings)
    doubt: DoubtSettings = field(default_factory=DoubtSettings)
    fit: FitSettings = field(default_factory=FitSettings)
    gauss_newton: GaussNewtonSettings = field(default_factory=GaussNewtonSettings)
    held_out: HeldOutSettings = field(default_factory=HeldOutSettings)
    model: ModelSettings = field(default_factory=ModelSettings)
    valley: ValleySettings = field(default_factory=ValleySettings)
    waves: WavesSettings = field(default_factory=WavesSettings)
    # what is left
    levels: LevelsSettings = field(default_factory=LevelsSettings)
    spectrum: SpectrumSettings = field(default_factory=SpectrumSettings)
    where: WhereSettings = field(default_factory=WhereSettings)
    readings: ReadingsSettings = field(default_factory=ReadingsSettings)
    steadiness: SteadinessSettings = field(default_factory=SteadinessSettings)
    limits: LimitsSettings = field(default_factory=LimitsSettings)
    # the rig
    prediction: PredictionSettings = field(default_factory=PredictionSettings)
    smooth: SmoothSettings = field(default_factory=SmoothSettings)
    tangents: TangentsSettings = field(default_factory=TangentsSettings)
    runs: RunsSettings = field(default_factory=RunsSettings)
    roles: RolesSettings = field(default_factory=RolesSettings)
    compared: ComparedSettings = field(default_factory=ComparedSettings)
    outliers: OutliersSettings = field(default_factory=OutliersSettings)
    start_angles: StartAnglesSettings = field(default_factory=StartAnglesSettings)
    clocks: ClocksSettings = field(default_factory=ClocksSettings)
    locate: LocateSettings = field(default_factory=LocateSettings)
    rig_orders: RigOrdersSettings = field(default_factory=RigOrdersSettings)
    line_sets: LineSetsSettings = field(default_factory=LineSetsSettings)
    rig_model: RigModelSettings = field(default_factory=RigModelSettings)
    data_vector: DataVectorSettings = field(default_factory=DataVectorSettings)
    encoders: EncodersSettings = field(default_factory=EncodersSettings)
    noise_model: NoiseModelSettings = field(default_factory=NoiseModelSettings)
    turning_noise: TurningNoiseSettings = field(default_factory=TurningNoiseSettings)
    # machines that are run freely
    free_before: FreeBeforeSettings = field(default_factory=FreeBeforeSettings)
    free_build: FreeBuildSettings = field(default_factory=FreeBuildSettings)
    free_evidence: FreeEvidenceSettings = field(default_factory=FreeEvidenceSettings)
    free_experiment: FreeExperimentSettings = field(default_factory=FreeExperimentSettings)
    free_floor: FreeFloorSettings = field(default_factory=FreeFloorSettings)
    free_known: FreeKnownSettings = field(default_factory=FreeKnownSettings)
    free_learned: FreeLearnedSettings = field(default_factory=FreeLearnedSettings)
    free_model: FreeModelSettings = field(default_factory=FreeModelSettings)
    free_reopened: FreeReopenedSettings = field(default_factory=FreeReopenedSettings)
    free_candidates: FreeCandidatesSettings = field(default_factory=FreeCandidatesSettings)
    free_colour: FreeColourSettings = field(default_factory=FreeColourSettings)
    free_orders: FreeOrdersSettings = field(default_factory=FreeOrdersSettings)
    free_rows: FreeRowsSettings = field(default_factory=FreeRowsSettings)
    free_sensor_noise: FreeSensorNoiseSettings = field(default_factory=FreeSensorNoiseSettings)
    free_together: FreeTogetherSettings = field(default_factory=FreeTogetherSettings)
    free_undecided: FreeUndecidedSettings = field(default_factory=FreeUndecidedSettings)
    # the answer
    verdict: VerdictSettings = field(default_factory=VerdictSettings)
    shown: ShownSettings = field(default_factory=ShownSettings)
    stretches: StretchesSettings = field(default_factory=StretchesSettings)
    rig_evidence: RigEvidenceSettings = field(default_factory=RigEvidenceSettings)
    answer_result: AnswerResultSettings = field(default_factory=AnswerResultSettings)
    sizes: SizesSettings = field(default_factory=SizesSettings)
    unlisted: UnlistedSettings = field(default_factory=UnlistedSettings)
    experiment: ExperimentSettings = field(default_factory=ExperimentSettings)
    answer_learned: AnswerLearnedSettings = field(default_factory=AnswerLearnedSettings)


SETTINGS = Settings()
