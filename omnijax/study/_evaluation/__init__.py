"""The one evaluation: a design in, its figures and how it ended out, by a method known before."""

from typing import TYPE_CHECKING

from ..._lazy import lazy_face

if TYPE_CHECKING:
    from .batching import batch_size as batch_size
    from .bulk import evaluate_in_bulk as evaluate_in_bulk
    from .choice import evaluation_of as evaluation_of
    from .drives import Drive as Drive
    from .drives import DriveQuantity as DriveQuantity
    from .drives import apply as apply
    from .drives import drive_from_plain as drive_from_plain
    from .drives import drive_of as drive_of
    from .drives import drive_quantities as drive_quantities
    from .drives import drive_to_plain as drive_to_plain
    from .drives import turning as turning
    from .drives import with_few_knots as with_few_knots
    from .evaluation import Evaluation as Evaluation
    from .evaluation import checked_metrics as checked_metrics
    from .evaluation import read_run as read_run
    from .evaluation import samples_of as samples_of
    from .evaluation import without_run as without_run
    from .fixed_steps import checked_after as checked_after
    from .fixed_steps import corners_of_box as corners_of_box
    from .fixed_steps import sample_to_check as sample_to_check
    from .methods import BULK as BULK
    from .methods import METHODS as METHODS
    from .methods import Question as Question
    from .methods import choose as choose
    from .methods import gathers as gathers
    from .rows import Rows as Rows

__getattr__, __dir__ = lazy_face(__name__)
