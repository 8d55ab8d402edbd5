"""Study files: what they ask for, checked."""

from .file import Study as Study
from .file import load_study as load_study
from .file import parse_study as parse_study
from .file import study_of as study_of
from .runs import RTOL as RTOL
from .runs import fine_enough as fine_enough
from .runs import trial_designs as trial_designs
from .runs import way_of as way_of
