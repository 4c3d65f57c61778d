"""Sphinx builds the pages and the reference of all rooms: make docs.

The source folder is the root of the project, so that links mean the same here and on a code host.
What stands in the lists of docs/index.md and docs/api/index.md, under which heading and in which
order, is what the navigation shows.
"""

import re
from pathlib import Path

from greybed._version import __version__

ROOT = Path(__file__).parents[1]
project = "greybed"
author = copyright = "the greybed developers"
release = version = __version__
root_doc = "docs/index"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
include_patterns = ["*.md", "docs/**.md", "docs/**.rst", "examples/**/README.md"]
exclude_patterns = [".venv", "build", "runs", "shared", "greybed", "tests", "benchmarks"]
myst_heading_anchors = 4
html_theme = "furo"
html_title = f"greybed {__version__}"
html_extra_path = ["site"]
html_copy_source = False
autodoc_member_order = "groupwise"
autodoc_typehints = "none"  # docstrings state types together with shapes and units
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_param = False  # else every "shape" in a type becomes a link to some attribute
napoleon_custom_sections = [("Attributes", "params_style")]
highlight_language = "none"
# Errors are in greybed.core and in greybed.core.errors; either is right.
suppress_warnings = ["ref.python"]

LINK = re.compile(r"\[([^\]]+)\]\(([^)#\s]+)\)")


def without_folders(app, docname, source):
    """Links to folders and to files that are no pages become plain text: a page has no folders."""
    here = (ROOT / docname).parent

    def plain(found):
        target = (here / found[2]).resolve()
        page = target.suffix in {".md", ".rst", ".png"} or ":" in found[2]
        return found[0] if page else f"{found[1]}"

    source[0] = LINK.sub(plain, source[0])


def with_navigation(app, docname, source):
    """Each list of links under a second heading of an index becomes a part of the navigation."""
    if Path(docname).name != "index":
        return
    here = (ROOT / docname).parent
    trees = []
    for part in re.split(r"^## ", source[0], flags=re.MULTILINE)[1:]:
        entries = [
            f"{title} </{(here / page).resolve().relative_to(ROOT).with_suffix('')}>"
            for title, page in re.findall(
                r"^- \[(.+?)\]\(([^)#]+\.(?:md|rst))\)", part, re.MULTILINE
            )
        ]
        caption = part.splitlines()[0]
        trees.append(
            "\n".join(["```{toctree}", ":hidden:", f":caption: {caption}", "",
                       *entries, "```"])
        )  # fmt: skip
    source[0] += "\n\n" + "\n\n".join(trees) + "\n"


def setup(app):
    """Register both."""
    app.connect("source-read", without_folders)
    app.connect("source-read", with_navigation)
