"""The channels of a rig's rows: what was measured, in the order of their tables."""


def channel_names(wheels: int) -> list[str]:
    """The columns of the elastic and the rotation table."""
    names = [f"{g}_{c}" for g in ("dR", "a", "Omega") for c in "xyz"]
    return [*names, *(f"theta_{k + 1}" for k in range(wheels))]


def channel_index(channel: str) -> int:
    """Which of its group's channels it is."""
    _, _, which = channel.partition("_")
    return "xyz".index(which) if which in "xyz" else int(which) - 1
