"""Study files: what they ask for, checked."""

from .file import Study as Study
from .file import load_study as load_study
from .file import parse_study as parse_study
from .file import study_of as study_of
from .reach import reach as reach
from .schema import LEAST_SAMPLES as LEAST_SAMPLES
from .schema import study_schema as study_schema
