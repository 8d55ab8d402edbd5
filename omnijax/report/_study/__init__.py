"""Pages of studies: designs, fronts, sensitivities, tolerances."""

from .pages import study_page as study_page
