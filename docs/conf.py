"""Sphinx configuration: `sphinx-build -W docs docs/_build` builds the documentation."""

import re
from importlib.metadata import version as installed_version

project = "omnijax"
author = "the omnijax authors"
copyright = "2026, the omnijax authors"
version = release = installed_version("omnijax")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
]
myst_enable_extensions = ["dollarmath", "deflist", "colon_fence"]
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_default_options = {"members": True, "show-inheritance": False, "imported-members": True}
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "omnijax"
html_static_path = ["_static"]
nitpicky = False


def _without_signature(app, what, name, obj, options, signature, return_annotation):
    """Module classes print their array annotations over several lines: leave those out."""
    if what == "class":
        return "", None
    return None


def _plain_text(app, what, name, obj, options, lines):
    """Docstrings are plain text with `code`: no substitutions, no emphasis, no links."""
    for i, line in enumerate(lines):
        code = re.sub(r"(?<!`)`([^`]+)`(?!`)", r"``\1``", line)
        parts = re.split(r"(``[^`]*``)", code)
        plain = [re.sub(r"([|*_])", r"\\\1", p) if k % 2 == 0 else p for k, p in enumerate(parts)]
        lines[i] = "".join(plain)


def _without_field_numbers(app, what, name, obj, skip, options):
    """Fields of a named tuple have no text of their own; its docstring says what they are."""
    return True if str(getattr(obj, "__doc__", "")).startswith("Alias for field number") else skip


def setup(app):
    app.connect("autodoc-skip-member", _without_field_numbers)
    app.connect("autodoc-process-docstring", _plain_text)
    app.connect("autodoc-process-signature", _without_signature)
