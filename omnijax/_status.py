"""How a run, or the evaluation of a design, ended: one enumeration for all packages."""

from enum import IntEnum


class Status(IntEnum):
    """A code for files and traced arrays, its words, and what to do about it.

    A design without figures is `failed`; one that lifts off or slips keeps its figures.
    """

    text: str
    remedy: str

    def __new__(cls, code: int, text: str, remedy: str = ""):
        """The member with its words."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.text, member.remedy = text, remedy
        return member

    NOT_DONE = -1, "not done"
    OK = 0, "ok"
    NON_FINITE = (
        1,
        "non-finite",
        "figures became infinite: lower `rtol`, or look for a law without bound or an axis of the "
        "sphere that no wheel drives (`omnijax check`).",
    )
    STEP_LIMIT = (
        2,
        "step limit",
        "the step limit was reached: raise `max_steps`, or loosen `rtol`.",
    )
    FAILED = 3, "failed", "the solver gave up: try `solver='kvaerno5'`, or lower `rtol`."
    LIFT_OFF = (
        4,
        "lift-off",
        "a contact lost its load: raise `closure.preload`, or drive more gently.",
    )
    SLIP = (
        5,
        "slip",
        "a drive force passed what friction holds: raise `closure.preload` or `contact.friction`.",
    )
    INTERRUPTED = 6, "interrupted", "what was computed is kept."
    UNHELD = (
        7,
        "unheld",
        "the wheels do not hold the sphere in every direction: turn a `normal`, or add a wheel.",
    )

    @property
    def failed(self) -> bool:
        """Whether the run has no figures."""
        return self in FAILED

    @classmethod
    def of(cls, text: str) -> "Status":
        """The member whose words are `text`; `ValueError` for others."""
        for member in cls:
            if member.text == text:
                return member
        raise ValueError(f"`{text}` is no status.")


FAILED = (Status.NON_FINITE, Status.STEP_LIMIT, Status.FAILED, Status.UNHELD)
