"""The page of the benchmarks, and what commands write into it."""

from pathlib import Path

PAGE = Path(__file__).parent / "README.md"


def written(page: str, name: str, text: str) -> str:
    """`page` with `text` between the two lines that mark the place `name`."""
    begin, end = marks(name)
    head, found, rest = page.partition(begin)
    _, ended, tail = rest.partition(end)
    if not (found and ended):
        raise ValueError(f"{PAGE.name} lacks the lines {begin.strip()} and {end.strip()}.")
    return f"{head}{begin}\n{text}\n\n{end}{tail}"


def marks(name: str) -> tuple[str, str]:
    """The lines before and behind the place `name`."""
    return f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"


def put(name: str, text: str) -> None:
    """Write `text` at the place `name` of the page."""
    PAGE.write_text(written(PAGE.read_text(), name, text))
