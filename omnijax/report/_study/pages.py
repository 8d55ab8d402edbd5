"""The page of any study's result."""

from typing import Any

from ...study import Design, Front, GlobalSensitivity, Sensitivity, Tolerances
from .._content import Provenance
from .._page import Page
from .design import design_page
from .global_sensitivity import global_sensitivity_page
from .pareto import front_page
from .sensitivity import sensitivity_page
from .tolerances import tolerances_page

PAGES: dict[type, Any] = {
    Design: design_page,
    Front: front_page,
    GlobalSensitivity: global_sensitivity_page,
    Sensitivity: sensitivity_page,
    Tolerances: tolerances_page,
}


def study_page(result: Any, made: Provenance) -> Page:
    """One offline page of a study's result; `made` says what makes it again."""
    return PAGES[type(result)](result, made)
