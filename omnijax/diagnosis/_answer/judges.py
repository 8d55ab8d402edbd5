"""Who confirms an answer, in the words of each place that says so."""

from typing import NamedTuple


class Judges(NamedTuple):
    """The runs that judge an answer, or parts of one."""

    name: str
    confirm: str  # the end of a sentence that names effects
    fitted: str  # how far they were fitted, as a sentence
    shown: str  # one of them, after "on"


JUDGES = {  # by `Diagnosis.confirmed_on`
    "held-out": Judges(
        "held-out runs",
        "and held-out runs confirm it",
        "Held-out runs are never fitted, but for their start (where wheels without encoder stand, "
        "and the motion there) and, where the notes tell them, the offsets of their clocks.",
        "a run that was not fitted",
    ),
    "blocks": Judges(
        "the parts that were kept out of the fit",
        "and the parts that were kept out of the fit confirm it",
        "On the parts of the runs that were kept out of the fit.",
        "a part of a run that was kept out of the fit",
    ),
    "nothing": Judges(
        "the fitted runs themselves",
        "and no run is left to confirm it",
        "On the only run, which was fitted: nothing was kept out.",
        "the fitted run itself",
    ),
}
