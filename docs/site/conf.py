"""Sphinx: the manual, the READMEs of the packages and the public names; `./run docs` builds it."""

import os
import sys
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).parent))

from site_pages import contents, draw_diagrams, link_sources, toctree  # noqa: E402

project = "Crazyflie workspace"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.graphviz", "numpydoc"]
root_doc = "docs/README"
include_patterns = ["README.md", "docs/**.md", "docs/site/api.rst", "ros/**/README.md"]
# src/launch_shared is a link to launch_shared.
exclude_patterns = [
    ".*",
    "out",
    "ros/.*",
    "ros/build",
    "ros/devel",
    "ros/install",
    "ros/src/launch_shared",
]

html_theme = "furo"
html_title = project
templates_path = ["templates"]
html_additional_pages = {"index": "redirect.html"}
html_copy_source = False
html_show_copyright = False
html_static_path = ["static"]
html_css_files = ["site.css"]

highlight_language = "text"
graphviz_output_format = "svg"
myst_heading_anchors = 6
default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "none"
numpydoc_show_class_members = False

_GITHUB = [os.environ.get(f"GITHUB_{name}") for name in ("SERVER_URL", "REPOSITORY", "SHA")]
SOURCES = "{}/{}/blob/{}".format(*_GITHUB) if all(_GITHUB) else TOP.as_uri()
"""Links to files that are not pages lead here."""

_PLACEHOLDER = "https://sources.invalid"
"""Of SOURCES in Markdown, whose parser refuses file: URLs."""


def prepare(app, name, texts) -> None:
    """Make a page from the Markdown file of this name; called by Sphinx when it has been read."""
    file = Path(app.env.doc2path(name))
    if file.suffix != ".md":
        return
    text = draw_diagrams(link_sources(texts[0], file, TOP, _PLACEHOLDER))
    if name in ("docs/README", "docs/course/README"):
        for caption, pages in contents(texts[0]):
            text += toctree(caption, pages)
    if name == root_doc:
        others = sorted(f"/{page}" for page in app.env.found_docs if not page.startswith("docs/"))
        text += toctree("Packages", others) + toctree("Reference", ["/docs/site/api"])
    texts[0] = text


def lead_to_sources(app, doctree, name) -> None:
    """Replace the placeholder; called by Sphinx when references of a page have been resolved."""
    for node in doctree.findall(lambda node: "refuri" in getattr(node, "attributes", {})):
        node["refuri"] = node["refuri"].replace(_PLACEHOLDER, SOURCES)


def setup(app) -> None:
    """Connect the functions above; called by Sphinx."""
    app.connect("source-read", prepare)
    app.connect("doctree-resolved", lead_to_sources)
